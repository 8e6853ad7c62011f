"""Web pages from templates, with the head, colours and letters that all pages share.

A page refers to nothing but files beside it, so it works from a disk, out of an archive and on a
server.
"""

from __future__ import annotations

from importlib import resources
from typing import Any


def rendered(package: str, template: str, **values: Any) -> str:
    """Return a page from a Jinja template that ships beside the code of a package.

    The template begins with `{% extends "web_page.html" %}` and fills the blocks `style` and `body`;
    it can include the package's other files, such as its CSS. Texts are escaped, lines that hold only
    a statement leave no trace, and a name that is not given is an error.

    Args:
        package: The name of the package, such as "orbiflow.drawing".
        template: The name of the file.
        values: What the template shows: `title` in plain text, `dark=False` if the page is never dark,
            and what it uses itself.
    """
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    def load(name: str) -> str:
        local = resources.files(package).joinpath(name)
        shared = resources.files("orbiflow.drawing").joinpath(name)
        return (local if local.is_file() else shared).read_text("utf-8")

    pages = Environment(
        loader=FunctionLoader(load),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return pages.get_template(template).render(values)
