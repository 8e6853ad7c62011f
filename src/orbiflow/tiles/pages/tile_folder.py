"""The folder of one tile: drawings, pictures and the map."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from orbiflow.drawing import Picture, Sheet, field_picture
from orbiflow.runtime import make_folder, write_atomic
from orbiflow.tiles.exporting import tile_svg, tiling_svg
from orbiflow.tiles.pictures import (
    bending_picture,
    bending_png,
    overlay_picture,
    overlay_png,
    placed_field,
    tiling_picture,
    tiling_png,
)
from orbiflow.tiles.silhouette import Target
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tile_map import TileMap
from orbiflow.tiles.tilings import Colouring, colouring

TILE_FILES = ("tile.svg", "tiling.svg", "tiling.png", "overlay.png", "model.safetensors")
"""The files in every tile's folder."""

FIELD_FILES = ("field.png", "field.pdf")
FIGURE_FILES = ("tiling.pdf", "overlay.pdf", *FIELD_FILES)
"""The further files if figures were asked for: for print, as wide as a journal's column; and the field
of the flow if there is one."""


def overlay(result: EscherTile, target: Target, *, label: str = "", width_px: int = 1200) -> bytes:
    """Return a PNG of a tile and its silhouette: how it bent, or what is missing and added."""
    y_down = target.y_down
    label = label or result.isohedral_class
    if result.bent is None or result.rest is None:
        return overlay_png(
            result.tile, target.outline, y_down=y_down, label=label, width_px=width_px
        )
    label = f"{label}  IoU {result.metrics.iou:.3f}"
    return bending_png(
        result.tile, result.rest, result.bent, y_down=y_down, label=label, width_px=width_px
    )


def figure_files(result: EscherTile) -> tuple[str, ...]:
    """Return the `FIGURE_FILES` of a tile: there is no flow where the silhouette bent into the tile."""
    likeness = result.objective == "likeness"
    return tuple(file for file in FIGURE_FILES if not (likeness and file in FIELD_FILES))


def _overlay_picture(result: EscherTile, target: Target) -> Picture:
    """Return the picture of `overlay` for print."""
    y_down = target.y_down
    if result.bent is None or result.rest is None:
        return overlay_picture(result.tile, target.outline, y_down=y_down)
    return bending_picture(result.tile, result.rest, result.bent, y_down=y_down)


def _field_picture(result: EscherTile, sheet: Sheet) -> Picture:
    field = placed_field(result.model())
    return field_picture(field, result.normal_tile.group, result.normal_tile, sheet=sheet)


def _map(result: EscherTile) -> TileMap:
    return result.map or TileMap()


def write_tile_folder(
    result: EscherTile,
    target: Target,
    folder: Path,
    *,
    colours: Colouring | None = None,
    figures: bool = False,
) -> list[Path]:
    """Write the `TILE_FILES` of a tile.

    Args:
        result: The tile.
        target: Its silhouette.
        folder: The folder, which is made if need be.
        colours: The tiling's colouring. Default: `colouring(result.tile)`.
        figures: Write the `FIGURE_FILES`, too; they take much longer.

    Raises:
        OutputError: If a file cannot be written.
    """
    make_folder(folder)
    y_down = target.y_down
    colours = colours or colouring(result.tile)
    title = f"{target.source.rsplit('/', 1)[-1]}, {result.isohedral_class} ({result.group_name})"
    if not result.certificate.valid:
        title += ", NOT CERTIFIED"
    label = f"{result.isohedral_class} ({result.group_name})"
    contents: dict[str, Callable[[], str | bytes]] = {
        "tile.svg": lambda: tile_svg(result.tile, y_down=y_down, title=title),
        "tiling.svg": lambda: tiling_svg(result.tile, y_down=y_down, title=title, colours=colours),
        "tiling.png": lambda: tiling_png(result.tile, y_down=y_down, colours=colours),
        "overlay.png": lambda: overlay(result, target, label=label),
        "tiling.pdf": lambda: tiling_picture(result.tile, y_down=y_down, colours=colours).file(),
        "overlay.pdf": lambda: _overlay_picture(result, target).file(),
        "field.png": lambda: _field_picture(result, Sheet.screen(1200)).file(),
        "field.pdf": lambda: _field_picture(result, Sheet.column()).file(),
        "model.safetensors": lambda: _map(result).to_bytes(),
    }
    names = (*TILE_FILES, *(figure_files(result) if figures else ()))
    return [write_atomic(folder / name, contents[name]()) for name in names]
