"""The folder of a reproduction: its page, `paper.json` with all numbers, and what a run wrote."""

import html
import itertools
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
_INDEX = re.compile(r"\b([A-Z])_(\w+)")  # such as the c of R_c
_BADGES = {"agrees": "yes", "agrees in part": "partly", "differs": "no", "": "failed"}


def paper_page(shown: Sequence[Shown], extent: Extent, seconds: float) -> str:
    """Return the page of exhibits in the paper's order, which all together took `seconds`."""
    return rendered(
        "reproduction",
        "page.html",
        title="The paper, reproduced",
        dark=False,
        shown=shown,
        fast=extent.name == "fast",
        seconds=seconds,
        badges=_BADGES,
        words=lambda text: Markup(_INDEX.sub(r"\1<sub>\2</sub>", html.escape(text))),
    )


def write_page(shown: Sequence[Shown], extent: Extent, folder: Path, seconds: float) -> None:
    """Write `index.html` and `paper.json` beside the pictures."""
    write_atomic(folder / INDEX, paper_page(shown, extent, seconds))
    document = {
        "schema_version": SCHEMA_VERSION,
        "extent": extent._asdict(),
        "seconds": round(seconds, 1),
        "exhibits": [_exhibit(one) for one in shown],
    }
    write_atomic(folder / NUMBERS, json.dumps(document, allow_nan=False, indent=1))


def _exhibit(one: Shown) -> dict[str, Any]:
    findings = one.findings
    files = ((picture.file, *dict(picture.others).values()) for picture in one.pictures)
    return {
        "name": one.exhibit.name,
        "label": one.exhibit.label,
        "verdict": None if findings is None else findings.verdict,
        "failure": one.failure or None,
        "files": list(itertools.chain(*files)),
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
