"""The folder of a reproduction: its page, `paper.json` with all numbers, and what a run wrote."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from orbiflow.drawing import rendered
from orbiflow.runtime import write_atomic
from reproduction.exhibit import Extent, Shown

NUMBERS, INDEX = "paper.json", "index.html"
SCHEMA_VERSION = 1
_OURS = re.compile(r"(figure|table)-[a-z0-9-]+\.(png|pdf|html)")
_BADGES = {"agrees": "yes", "agrees in part": "partly", "differs": "no", "": "failed"}


def paper_page(shown: Sequence[Shown], extent: Extent, seconds: float) -> str:
    """Return the page, to be written beside the pictures.

    Args:
        shown: The exhibits, in the paper's order.
        extent: How much work they were.
        seconds: The time that all of them took.
    """
    return rendered(
        "reproduction",
        "page.html",
        title="The paper, reproduced",
        dark=False,
        shown=shown,
        fast=extent.name == "fast",
        seconds=seconds,
        badges=_BADGES,
        words=_words,
    )


def _words(text: str) -> Markup:
    """Return text as HTML, with the index of R_c below."""
    return Markup(re.sub(r"\b([A-Z])_(\w+)", r"\1<sub>\2</sub>", html.escape(text)))


def write_page(shown: Sequence[Shown], extent: Extent, folder: Path, seconds: float) -> None:
    """Write `index.html` and `paper.json` beside the pictures.

    Raises:
        OutputError: If a file cannot be written.
    """
    write_atomic(folder / INDEX, paper_page(shown, extent, seconds))
    document = numbers(shown, extent, seconds)
    write_atomic(folder / NUMBERS, json.dumps(document, allow_nan=False, indent=1))


def numbers(shown: Sequence[Shown], extent: Extent, seconds: float) -> dict[str, Any]:
    """Return everything that was measured, ready for JSON."""
    return {
        "schema_version": SCHEMA_VERSION,
        "extent": extent._asdict(),
        "seconds": round(seconds, 1),
        "exhibits": [_exhibit(one) for one in shown],
    }


def _exhibit(one: Shown) -> dict[str, Any]:
    findings = one.findings
    return {
        "name": one.exhibit.name,
        "label": one.exhibit.label,
        "verdict": None if findings is None else findings.verdict,
        "failure": one.failure or None,
        "files": [
            f for picture in one.pictures for f in (picture.file, *dict(picture.others).values())
        ],
        "numbers": {} if findings is None else dict(findings.numbers),
    }


def written_files(folder: Path) -> set[str]:
    """Return the names of the files that an earlier run wrote into a folder, by its `paper.json`."""
    try:
        document = json.loads((folder / NUMBERS).read_text(encoding="utf-8"))
        ours = isinstance(document["schema_version"], int)
        files = {str(file) for entry in document["exhibits"] for file in entry["files"]}
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return set()
    return {NUMBERS, INDEX, *filter(_OURS.fullmatch, files)} if ours else set()
