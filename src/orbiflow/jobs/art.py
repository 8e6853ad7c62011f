"""Artwork on a tiling: the job of an `ArtRequest`."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from orbiflow.jobs.asked import given, read_as
from orbiflow.jobs.place import check_place
from orbiflow.jobs.run import Sink
from orbiflow.jobs.tile_requests import ArtRequest
from orbiflow.runtime import (
    Cancel,
    Finished,
    Note,
    Progress,
    RecordError,
    Written,
    write_atomic,
)
from orbiflow.tiles import (
    ArtSettings,
    Artwork,
    EscherTile,
    artwork,
    read_over,
    read_result,
    with_map,
    write_artwork,
)
from orbiflow.units import pixel_size, pixels


def art(request: ArtRequest, tell: Sink, cancel: Cancel) -> Finished:
    """Write the picture.

    Returns:
        `summary`: the `file`, its `width` and `height` in pixels, how many `tiles` it shows, the
        `class`, the `tile_size` in pixels.

    Raises:
        OrbiflowError: for anything that the user can mend.
        Cancelled: if it was told to stop; nothing is written.
    """
    settings = _settings(request)
    tile = with_map(read_result(request.result, request.tile))
    tile.require_certified(
        force=request.force, otherwise="so it is not exported; --force exports it, marked so"
    )
    out = request.out or Path(f"{tile.name}.png")
    check_place(out, request.result, request.picture)
    tell(Progress(0.0, "laying out"))
    made = _prepared(request, tile, settings)
    cancel.check()
    tell(Progress(0.2, "drawing"))
    content = write_artwork(made, out.suffix, cancel=cancel)
    cancel.check()
    path = write_atomic(out, content)
    for note in made.notes:
        tell(Note(note))
    tell(Note(_said(made, path)))
    tell(Written(path))
    page = made.page
    summary = {
        "file": str(path),
        "width": page.width,
        "height": page.height,
        "tiles": page.shown,
        "class": page.tile.isohedral_class,
        "tile_size": page.tile_size,
    }
    return Finished("done", summary)


def _prepared(request: ArtRequest, tile: EscherTile, settings: ArtSettings) -> Artwork:
    if request.picture is None:
        return artwork(tile, settings)
    tile.require_map()
    over = read_over(request.picture, tile)
    return artwork(tile, settings, picture=over.picture, drawing=over.drawing, notes=over.notes)


def _said(made: Artwork, path: Path) -> str:
    page = made.page
    return (
        f"written {path}: {page.width} x {page.height} pixels, {page.shown:.0f} tiles of "
        f"{page.tile.isohedral_class}, {page.tile_size:.0f} pixels each"
    )


def _settings(request: ArtRequest) -> ArtSettings:
    asked = given(request, ("tolerance", "palette", "colour", "dpi"))
    dpi = request.dpi or ArtSettings.dpi
    if request.engrave or request.strokes:
        asked["engrave"] = request.strokes or "hatch"
    if request.size is not None:
        asked["size"] = read_as("size", partial(pixel_size, dpi=dpi), request.size)
    if request.tile_size is not None:
        asked["tile_size"] = read_as("tile_size", partial(pixels, dpi=dpi), request.tile_size)
    if request.outline is not None:
        asked["outline"] = read_as("outline", partial(_outline, dpi=dpi), request.outline)
    eyes = tuple(_eye(text) for text in request.eyes)
    return ArtSettings(repeat=request.repeat, eyes=eyes, **asked)


def _outline(text: str, dpi: float) -> float:
    return 0.0 if text.strip().lower() == "none" else pixels(text, dpi, zero=True)


def _eye(text: str) -> tuple[float, ...]:
    try:
        parts = tuple(float(part) for part in text.split(","))
    except ValueError:
        parts = ()
    if len(parts) not in (2, 3):
        raise RecordError(
            f"{{eyes}} {text!a:.60} is no place; write x,y or x,y,radius in the silhouette's "
            "coordinates"
        )
    return parts
