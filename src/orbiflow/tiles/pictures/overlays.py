"""Pictures of a tile laid over its silhouette: what is missing and what is added."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely.geometry.base import BaseGeometry

from orbiflow.arguments import numbers
from orbiflow.drawing import (
    Picture,
    Raster,
    Sheet,
    caption,
    captioned,
    strip_middle,
    vector_picture,
)
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.tilings import Tile

COMMON, MISSING, ADDED = "#c9d3dc", "#d95f02", "#2b6cb0"
"""Fills of the overlay: in both, in the target only, in the tile only."""


def overlay_png(
    tile: Tile,
    target: ArrayLike | BaseGeometry,
    *,
    width_px: int = 1200,
    y_down: bool = False,
    label: str = "",
) -> bytes:
    """Return a PNG of a tile over its target, with what is missing and what is added in two colours.

    Args:
        tile: The tile.
        target: The outline (M, 2), or a shapely polygon, in the tile's coordinates.
        width_px: The width in pixels; the height follows.
        y_down: Whether the y axis points down, as in images.
        label: The words in front of the legend. Default: the class.

    Raises:
        OrbiflowError: If the target is empty or not an outline.
    """
    shape, goal = _clean(shapely.Polygon(tile.polygon)), _target(target)
    common = shapely.intersection(shape, goal)
    overlap = common.area / shapely.union(shape, goal).area
    text = f"{label or tile.isohedral_class}  IoU {overlap:.3f}".strip()
    raster = overlay_raster(tile, goal, width_px=width_px, y_down=y_down, text=text)
    _legend(raster)
    return raster.png()


def overlay_picture(
    tile: Tile,
    target: ArrayLike | BaseGeometry,
    *,
    y_down: bool = False,
    sheet: Sheet | None = None,
) -> Picture:
    """Return the picture of `overlay_png` for print, in curves; the caption has its legend.

    Args:
        tile, target, y_down: As for `overlay_png`.
        sheet: The sheet it is drawn on. Default: a journal's single column, as PDF.

    Raises:
        OrbiflowError: As `overlay_png`.
    """
    raster = overlay_raster(tile, target, width_px=1600, y_down=y_down)
    title = f"Tile {tile.isohedral_class} over the silhouette".replace("  ", " ")
    caption = "Grey: in both. Orange: missing, in the silhouette alone. Blue: added."
    return vector_picture(raster, sheet or Sheet.column(), title=title, caption=caption)


def overlay_raster(
    tile: Tile,
    target: ArrayLike | BaseGeometry,
    *,
    width_px: int,
    y_down: bool = False,
    text: str = "",
) -> Raster:
    """Return the picture of `overlay_png` without its legend; no strip if `text` is empty."""
    shape, goal = _clean(shapely.Polygon(tile.polygon)), _target(target)
    bounds = np.array(goal.bounds).reshape(2, 2)
    raster = captioned([tile.polygon, bounds], width_px, y_down=y_down, text=text)
    raster.fill_geometry(shapely.intersection(shape, goal), COMMON)
    raster.fill_geometry(shapely.difference(goal, shape), MISSING)
    raster.fill_geometry(shapely.difference(shape, goal), ADDED)
    raster.line(tile.polygon, "#1a1a1a", max(1.0, 0.0028 * width_px), closed=True)
    return raster


def _legend(raster: Raster) -> None:
    entries = [("in both", COMMON, 0.40), ("missing", MISSING, 0.58), ("added", ADDED, 0.76)]
    y, high = strip_middle(raster), 0.014 * raster.width
    for name, colour, x in entries:
        left, right = x * raster.width, (x + 0.03) * raster.width
        ring = [[left, y - high], [right, y - high], [right, y + high], [left, y + high]]
        raster.fill_pixels(np.array(ring), colour)
        caption(raster, x + 0.04, name)


def _target(target: ArrayLike | BaseGeometry) -> BaseGeometry:
    if not isinstance(target, BaseGeometry):
        outline = numbers(target, "the target's outline", (...,))
        if outline.ndim != 2 or outline.shape[1] != 2 or len(outline) < 3:
            raise OrbiflowError(f"a target's outline is (M >= 3, 2) numbers, got {outline.shape}")
        target = shapely.Polygon(outline)
    cleaned = _clean(target)
    if not cleaned.area > 0:
        raise OrbiflowError("the target has no area")
    return cleaned


def _clean(geometry: BaseGeometry) -> BaseGeometry:
    return geometry if shapely.is_valid(geometry) else shapely.make_valid(geometry)
