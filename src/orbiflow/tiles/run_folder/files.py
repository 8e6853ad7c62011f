"""The files of a search's folder, by name: what an earlier search wrote may be replaced."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from orbiflow.tiles.result_file import RESULT, folder_names, part_file

# The files in every tile's folder
TILE_FILES = ("tile.svg", "tiling.svg", "tiling.png", "overlay.png", "model.safetensors")
FIELD_FILES = ("field.png", "field.pdf")
# The further files, for print, if figures were asked for; the field if a flow made the tile
FIGURE_FILES = ("tiling.pdf", "overlay.pdf", *FIELD_FILES)
# Of the files above, those that each figure of a tile has, see `part_file`
FIGURES_OWN = ("overlay.png", "model.safetensors", "overlay.pdf")
OVERVIEW, INDEX, READ = "overview.png", "index.html", "read.png"
# what was read for a search that has not replaced an earlier run yet
READ_NEXT = "read-next.png"
READ_FILES = (READ, part_file(READ, 1))  # of the silhouette, and of the second one
READ_NEXT_FILES = (READ_NEXT, part_file(READ_NEXT, 1))
SOFTWARE = "orbiflow"  # what pictures of what was read say that they were made with


def written_files(folder: Path) -> set[str]:
    """Return the paths of the files that an earlier search wrote into a folder, by its result.json.

    They are relative, with slashes; there are none if there is no such run.
    """
    try:
        document = json.loads((folder / RESULT).read_text(encoding="utf-8"))
        classes = [str(entry["class"]) for entry in document["tiles"]]
        counts = [len(entry.get("parts") or [0]) for entry in document["tiles"]]
        ours = isinstance(document["schema_version"], int)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        ours, classes, counts = False, [], []
    if not ours:
        return {file for file in READ_FILES if is_read_png(folder / file)}
    inside = {
        f"{name}/{file}"
        for name, count in zip(folder_names(classes), counts, strict=True)
        for file in files_of((*TILE_FILES, *FIGURE_FILES), count)
    }
    return {RESULT, OVERVIEW, INDEX, *READ_FILES, *READ_NEXT_FILES} | inside


def files_of(names: Sequence[str], figures: int) -> tuple[str, ...]:
    """Return the names of files of a tile that so many figures divide.

    >>> files_of(("tile.svg", "overlay.png"), 2)
    ('tile.svg', 'overlay.png', 'overlay-2.png')
    """
    more = (part_file(n, k) for k in range(1, figures) for n in names if n in FIGURES_OWN)
    return (*names, *more)


def is_read_png(path: Path) -> bool:
    """Whether a file is a picture that `read_png` made."""
    try:
        with path.open("rb") as file:
            return b"Software\0" + SOFTWARE.encode() in file.read(100)
    except OSError:
        return False
