"""What all pages begin with: the head, and the colours and letters that they share.

A page refers to nothing but files beside it, so it works from a disk, out of an archive and on a
server.
"""

from __future__ import annotations

import html
from importlib import resources

CLOSING = "</body>\n</html>\n"


def opening(title: str, style: str = "", *, dark: bool = True) -> str:
    """A page up to its body.

    Args:
        title: in plain text.
        style: CSS of its own, after what all pages share.
        dark: whether it is dark where the reader likes it so.

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
    """A text that ships beside the code of a package."""
    return resources.files(package).joinpath(name).read_text("utf-8")
