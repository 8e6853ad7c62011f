"""The folder of a density, as a fit and the operations on its model leave it, and other results."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from orbiflow.runtime import Note, ResultFolder, Sink, Written, write_atomic

SAMPLES = "samples.csv"
"""Samples beside the density that they are of."""

CATEGORY_FILE = "category-{}.safetensors"
"""The density where a word is known, beside that of all rows."""


def category_files(folder: Path) -> dict[str, str]:
    """Return the files of a folder's densities where a word is known, by the word, or {}."""
    try:
        document = json.loads((folder / "report.json").read_text(encoding="utf-8"))
        files = {word: own["file"] for word, own in document["categories"].items()}
        safe = all(re.fullmatch(CATEGORY_NAME, name) for name in files.values())
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return {}
    return files if safe and isinstance(document.get("given"), str) else {}


CATEGORY_NAME = CATEGORY_FILE.replace(".", r"\.").format(r"[A-Za-z0-9_+-]{1,60}")


def written_files(folder: Path) -> set[str]:
    """Return the names of the files that a fit wrote into a folder, and of pictures of its model."""
    document: Any = {}
    try:
        document = json.loads((folder / "report.json").read_text(encoding="utf-8"))
        ours = "space" in document and "report" in document
    except (OSError, ValueError, TypeError, RecursionError):
        ours = False
    if not ours:
        return set()

    from orbiflow.density.pictures import MODEL, PICTURES, REPORT, TABLE, THUMBNAIL

    samples = {SAMPLES} if "samples" in document else set[str]()
    return {MODEL, REPORT, TABLE, THUMBNAIL, *PICTURES, *samples, *category_files(folder).values()}


def write_files(folder: ResultFolder, files: Mapping[str, str | bytes], tell: Sink) -> None:
    """Replace a folder's files by these, by their names, and tell which were written."""
    with folder.replaced() as staged:
        for name, content in files.items():
            write_atomic(staged / name, content)
    for name in files:
        tell(Written(folder.path / name))


def write_file(path: Path, content: str | bytes, tell: Sink, *notes: str) -> None:
    """Write a file, and tell so before other notes."""
    write_atomic(path, content)
    tell(Written(path))
    for note in notes:
        tell(Note(note))
