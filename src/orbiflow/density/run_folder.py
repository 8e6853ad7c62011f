"""The folder of a density, as a fit and the operations on its model leave it, and other results."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from orbiflow.runtime import Note, ResultFolder, Sink, Written, write_atomic


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

    # of earlier versions
    samples = {"samples.csv"} if "samples" in document else set[str]()
    before = {"conditional.safetensors"} if "given" in document else set[str]()
    return {MODEL, REPORT, TABLE, THUMBNAIL, *PICTURES, *samples, *before}


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
