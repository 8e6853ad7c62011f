"""The folder of a reproduction: its page, `paper.json` with all numbers, and what a run wrote."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from orbiflow.runtime import write_atomic
from reproduction.exhibit import Shown
from reproduction.extent import Extent
from reproduction.page import paper_page

NUMBERS, INDEX = "paper.json", "index.html"
SCHEMA_VERSION = 1

_OURS = re.compile(r"(figure|table)-[a-z0-9-]+\.(png|pdf|html)")


def write_page(shown: Sequence[Shown], extent: Extent, folder: Path, seconds: float) -> None:
    """Write `index.html` and `paper.json` beside the pictures.

    Raises:
        OutputError: if a file cannot be written.
    """
    write_atomic(folder / INDEX, paper_page(shown, extent, seconds))
    document = numbers(shown, extent, seconds)
    write_atomic(folder / NUMBERS, json.dumps(document, allow_nan=False, indent=1))


def numbers(shown: Sequence[Shown], extent: Extent, seconds: float) -> dict[str, Any]:
    """Everything that was measured, ready for JSON."""
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
    """Names of the files that an earlier run wrote into `folder`, by its `paper.json`; maybe none."""
    try:
        document = json.loads((folder / NUMBERS).read_text(encoding="utf-8"))
        ours = isinstance(document["schema_version"], int)
        files = {str(file) for entry in document["exhibits"] for file in entry["files"]}
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return set()
    return {NUMBERS, INDEX, *filter(_OURS.fullmatch, files)} if ours else set()
