"""The files of an escherized class: artwork, pictures and the model."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from orbiflow.escher.placed_field import placed_field
from orbiflow.escher.result import TileResult
from orbiflow.export.svg import tile_svg, tiling_svg
from orbiflow.figures.bending import bending_png
from orbiflow.figures.field import field_png
from orbiflow.figures.tilings import overlay_png, tiling_png
from orbiflow.files import make_folder, write_atomic
from orbiflow.silhouette.target import Target
from orbiflow.tilings import colouring

TILE_FILES = (
    "tile.svg",
    "tiling.svg",
    "tiling.png",
    "overlay.png",
    "field.png",
    "model.safetensors",
)


def overlay(result: TileResult, target: Target, *, label: str = "", width_px: int = 1600) -> bytes:
    """PNG of a tile and its silhouette: how it bent, or what is missing and added."""
    y_down = target.y_down
    label = label or result.name
    if result.bent is None or result.rest is None:
        return overlay_png(
            result.tile, target.outline, y_down=y_down, label=label, width_px=width_px
        )
    label = f"{label}  IoU {result.metrics.iou:.3f}"
    return bending_png(
        result.tile, result.rest, result.bent, y_down=y_down, label=label, width_px=width_px
    )


def write_tile_folder(result: TileResult, target: Target, folder: Path) -> list[Path]:
    """Write the `TILE_FILES`.

    Raises:
        OutputError: if a file cannot be written.
    """
    make_folder(folder)
    y_down = target.y_down
    colours = colouring(result.tile)
    title = f"{target.source.rsplit('/', 1)[-1]}, {result.name} ({result.group_name})"
    if not result.certificate.valid:
        title += ", NOT CERTIFIED"
    label = f"{result.name} ({result.group_name})"
    contents: dict[str, Callable[[], str | bytes]] = {
        "tile.svg": lambda: tile_svg(result.tile, y_down=y_down, title=title),
        "tiling.svg": lambda: tiling_svg(result.tile, y_down=y_down, title=title, colours=colours),
        "tiling.png": lambda: tiling_png(result.tile, y_down=y_down, colours=colours),
        "overlay.png": lambda: overlay(result, target, label=label),
        "field.png": lambda: field_png(
            placed_field(result.model.restore()), result.normal_tile.group, result.normal_tile
        ),
        "model.safetensors": result.model.to_bytes,
    }
    if result.objective == "likeness":  # no flow moves it
        del contents["field.png"]
    return [
        write_atomic(folder / name, contents[name]()) for name in TILE_FILES if name in contents
    ]
