"""The documentation as one site: `make docs`, read by Sphinx. It builds without a network."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import orbiflow

if TYPE_CHECKING:
    from sphinx.application import Sphinx

project = "orbiflow"
author = "the orbiflow developers"
project_copyright = author
release = version = orbiflow.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
exclude_patterns = ["gallery/silhouettes", "gallery/drawings"]
html_theme = "furo"
html_title = "orbiflow"
html_logo = None
html_copy_source = False
html_extra_path: list[str] = []
html_theme_options = {"navigation_with_keys": True}

autodoc_member_order = "groupwise"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
autodoc_type_aliases = {name: name for name in ("Array", "ArrayLike", "Points", "TileSource")}
toc_object_entries_show_parents = "hide"
napoleon_numpy_docstring = False
napoleon_use_rtype = False
myst_heading_anchors = 4
# links to files of the repository that are no pages are left as they are
suppress_warnings = ["myst.xref_missing", "myst.header"]


def plain_prose(
    _app: Any, what: str, _name: str, obj: Any, _options: Any, lines: list[str]
) -> None:
    """Docstrings are prose with code between backticks: |G| and 2 * 3 are not markup in it."""
    if what == "data" and type(obj).__module__ == "builtins":  # a table has dict's own docstring
        lines.clear()
    blocks = re.split(r"(\n\s*\n)", "\n".join(lines))
    for k, block in enumerate(blocks):
        if block.lstrip().startswith(">>>"):
            continue
        parts = block.split("`")
        for i, part in enumerate(parts):
            if i % 2:
                # what follows at once would hide the end of the code from Sphinx
                follows = parts[i + 1][:1] if i + 1 < len(parts) else ""
                parts[i] = f"``{part}``" + ("\\ " if re.match(r"[\w(]", follows) else "")
            else:
                parts[i] = re.sub(r"([|*]|(?<=\w)_(?!\w))", r"\\\1", part)
        blocks[k] = "".join(parts)
    lines[:] = "".join(blocks).split("\n")


def plain_types(
    _app: Any, _what: str, _name: str, _obj: Any, _options: Any, signature: str, returns: str
) -> tuple[str, str] | None:
    """Signatures with aliases by their names alone."""
    if not signature:
        return None
    known = re.compile(r"TypeAliasForwardRef\('(\w+)'\)")
    return known.sub(r"\1", signature or ""), known.sub(r"\1", returns or "")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("autodoc-process-docstring", plain_prose, priority=400)  # before napoleon
    app.connect("autodoc-process-signature", plain_types)
    return {"parallel_read_safe": True}
