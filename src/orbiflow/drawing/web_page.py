"""Web pages from templates, with the head, colours and letters that all pages share.

A page refers to nothing but files beside it, so it works from a disk, out of an archive and on a
server.
"""

from __future__ import annotations

import html
from importlib import resources
from typing import Any

CLOSING = "</body>\n</html>\n"


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
        home = resources.files(package).joinpath(name)
        return home.read_text("utf-8") if home.is_file() else css("orbiflow.drawing", name)

    pages = Environment(
        loader=FunctionLoader(load),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return pages.get_template(template).render(values)


def opening(title: str, style: str = "", *, dark: bool = True) -> str:
    """Return a page up to its body.

    Args:
        title: The title in plain text.
        style: CSS of its own, after what all pages share.
        dark: Whether it is dark if the reader prefers that.

    >>> opening("a < b").splitlines()[6]
    '<title>a &lt; b</title>'
    """
    here = "orbiflow.drawing"
    shared = css(here, "web_page.css") + (css(here, "web_page_dark.css") if dark else "")
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="orbiflow">
<title>{html.escape(title)}</title>
<style>
{shared}{style}</style>
</head>
<body>
"""


def css(package: str, name: str) -> str:
    """Return the text of a file in a package."""
    return resources.files(package).joinpath(name).read_text("utf-8")
