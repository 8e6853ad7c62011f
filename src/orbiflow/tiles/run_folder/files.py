"""The files of a search's folder, by name: what an earlier search wrote may be replaced."""

from __future__ import annotations

import json
from pathlib import Path

from orbiflow.tiles.result_file import RESULT, folder_names

# The files in every tile's folder
TILE_FILES = ("tile.svg", "tiling.svg", "tiling.png", "overlay.png", "model.safetensors")
FIELD_FILES = ("field.png", "field.pdf")
# The further files, for print, if figures were asked for; the field if a flow made the tile
FIGURE_FILES = ("tiling.pdf", "overlay.pdf", *FIELD_FILES)
OVERVIEW, INDEX, READ = "overview.png", "index.html", "read.png"
# what was read for a search that has not replaced an earlier run yet
READ_NEXT = "read-next.png"
SOFTWARE = "orbiflow"  # what pictures of what was read say that they were made with


def written_files(folder: Path) -> set[str]:
    """Return the paths of the files that an earlier search wrote into a folder, by its result.json.

    They are relative, with slashes; there are none if there is no such run.
    """
    try:
        document = json.loads((folder / RESULT).read_text(encoding="utf-8"))
        classes = [str(entry["class"]) for entry in document["tiles"]]
        ours = isinstance(document["schema_version"], int)
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        ours, classes = False, []
    if not ours:
        return {READ} if is_read_png(folder / READ) else set()
    files = (*TILE_FILES, *FIGURE_FILES)
    inside = {f"{name}/{file}" for name in folder_names(classes) for file in files}
    return {RESULT, OVERVIEW, INDEX, READ, READ_NEXT} | inside


def is_read_png(path: Path) -> bool:
    """Whether a file is a picture that `read_png` made."""
    try:
        with path.open("rb") as file:
            return b"Software\0" + SOFTWARE.encode() in file.read(100)
    except OSError:
        return False
