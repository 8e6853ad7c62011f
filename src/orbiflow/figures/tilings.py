"""PNG pictures: a tiling, and a tile over its target."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely.geometry.base import BaseGeometry

from orbiflow.arguments import instance, numbers
from orbiflow.errors import OrbiflowError
from orbiflow.figures.canvas import (
    blank_figure,
    captioned_axes,
    fill_geometry,
    fill_rings,
    plane_axes,
    png_bytes,
    strip_text,
)
from orbiflow.figures.palette import DEFAULT_PALETTE, Palette, palette
from orbiflow.figures.window import default_window
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings import Colouring, Tile, colouring, patch
from orbiflow.tilings.patch import Window

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COMMON, MISSING, ADDED = "#c9d3dc", "#d95f02", "#2b6cb0"
"""Fills of the overlay: in both, in the target only, in the tile only."""


def tiling_png(
    tile: Tile,
    window: Window | None = None,
    *,
    width_px: int = 1800,
    palette_name: str | Palette = DEFAULT_PALETTE,
    colours: Colouring | None = None,
    outline_pt: float = 0.8,
    y_down: bool = False,
) -> bytes:
    """PNG of the tiles that meet `window`, edge to edge.

    Args:
        window: (xmin, ymin, xmax, ymax) in the tile's units, default `default_window`.
        width_px: the height follows from the window.
        colours: default `colouring(tile)`.
        outline_pt: outline in points of 1/72 inch at 200 dots per inch; 0 for none.
        y_down: whether the tile's y axis points down, as in images.

    Raises:
        OrbiflowError: for an unknown palette, a size that cannot be made, or a window that is
            empty or holds too many tiles.
    """
    instance(tile, Tile, "the tile", "Tile(polygon, group) makes one")
    chosen = palette(palette_name)
    colours = colours or colouring(tile)
    window = window or default_window(tile)
    groups: list[list[Array]] = [[] for _ in range(colours.count)]
    for element in patch(tile, window):
        groups[colours.colour(element)].append(element(tile.polygon))
    height = round(width_px * (window[3] - window[1]) / (window[2] - window[0]))
    figure = blank_figure(width_px, height, chosen.paper)
    axes = plane_axes(figure, window, y_down=y_down)
    for number, rings in enumerate(groups):
        fill = chosen.fill(number)
        # without an outline, a line in the tile's own colour closes the seams of antialiasing
        edge, width = (chosen.outline, outline_pt) if outline_pt > 0 else (fill, 0.4)
        fill_rings(axes, rings, fill, edge, width)
    return png_bytes(figure)


def overlay_png(
    tile: Tile,
    target: ArrayLike | BaseGeometry,
    *,
    width_px: int = 1600,
    y_down: bool = False,
    label: str = "",
) -> bytes:
    """PNG of a tile over its target, with what is missing and what is added in two colours.

    Args:
        target: outline (M, 2), or a shapely polygon, in the tile's coordinates.
        label: in front of the legend, default the class.
        y_down: whether the y axis points down, as in images.

    Raises:
        OrbiflowError: if the target is empty or not an outline.
    """
    shape, goal = _clean(shapely.Polygon(tile.polygon)), _target(target)
    common = shapely.intersection(shape, goal)
    overlap = common.area / shapely.union(shape, goal).area
    text = f"{label or tile.isohedral_class}  IoU {overlap:.3f}".strip()
    bounds = np.array(goal.bounds).reshape(2, 2)
    figure, axes, strip = captioned_axes([tile.polygon, bounds], width_px, y_down=y_down, text=text)
    fill_geometry(axes, common, COMMON)
    fill_geometry(axes, shapely.difference(goal, shape), MISSING)
    fill_geometry(axes, shapely.difference(shape, goal), ADDED)
    fill_rings(axes, [tile.polygon], "none", "#1a1a1a", 1.6)
    _legend(strip)
    return png_bytes(figure)


def _legend(strip: Axes) -> None:
    from matplotlib.patches import Rectangle

    entries = [("in both", COMMON, 0.40), ("missing", MISSING, 0.58), ("added", ADDED, 0.76)]
    for name, colour, x in entries:
        strip.add_patch(Rectangle((x, 0.32), 0.03, 0.36, facecolor=colour, edgecolor="none"))
        strip_text(strip, x + 0.04, name)


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
