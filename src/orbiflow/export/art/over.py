"""What a user lays over the silhouette: an image, or a drawing in curves."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from orbiflow.arguments import path as as_path
from orbiflow.export.art.drawing import read_drawing
from orbiflow.export.art.picture import Picture, read_picture
from orbiflow.export.art.source import ArtTile
from orbiflow.export.scene import Motif
from orbiflow.silhouette.readers.reading import check_file, read_head


class Over(NamedTuple):
    """One of the two, and what was decided for the user."""

    picture: Picture | None = None
    drawing: Motif | None = None
    notes: tuple[str, ...] = ()


def read_over(path: str | Path, tile: ArtTile) -> Over:
    """The picture or drawing in a file, by its content.

    Raises:
        InputFileError: as `read_picture` and `read_drawing`.
        OrbiflowError: for a tile without a map.
    """
    tile.require_map()
    path = as_path(path, "the picture's file")
    check_file(path)
    head = read_head(path, 4096).lstrip(b"\xef\xbb\xbf \t\r\n")
    if head.startswith(b"<") or (path.suffix.lower() == ".svg" and b"\0" not in head[:64]):
        drawing, notes = read_drawing(path, tile)
        return Over(None, drawing, notes)
    picture = read_picture(path, tile)
    return Over(picture, None, picture.notes)
