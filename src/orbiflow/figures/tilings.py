"""PNG pictures: a tiling, and a tile over its target."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely.geometry.base import BaseGeometry

from orbiflow.arguments import instance, numbers
from orbiflow.errors import OrbiflowError
from orbiflow.figures.canvas import blank_figure, fill_geometry, fill_rings, plane_axes, png_bytes
from orbiflow.figures.palette import DEFAULT_PALETTE, Palette, palette
from orbiflow.figures.window import default_window
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings import Colouring, Tile, colouring, patch
from orbiflow.tilings.patch import Window

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
    bounds = np.array(goal.bounds)
    low = np.minimum(tile.polygon.min(axis=0), bounds[:2])
    high = np.maximum(tile.polygon.max(axis=0), bounds[2:])
    margin = 0.03 * float((high - low).max())
    window = (*(low - margin).tolist(), *(high + margin).tolist())
    picture = round(width_px * (window[3] - window[1]) / (window[2] - window[0]))
    legend = round(0.075 * width_px)
    figure = blank_figure(width_px, picture + legend)
    share = legend / (picture + legend)
    axes = plane_axes(figure, window, y_down=y_down, box=(0.0, share, 1.0, 1.0 - share))
    fill_geometry(axes, common, COMMON)
    fill_geometry(axes, shapely.difference(goal, shape), MISSING)
    fill_geometry(axes, shapely.difference(shape, goal), ADDED)
    fill_rings(axes, [tile.polygon], "none", "#1a1a1a", 1.6)
    _legend(figure, share, f"{label or tile.isohedral_class}  IoU {overlap:.3f}".strip())
    return png_bytes(figure)


def _legend(figure: Figure, share: float, text: str) -> None:
    from matplotlib.patches import Rectangle

    strip = figure.add_axes((0.0, 0.0, 1.0, share))
    strip.set_axis_off()
    strip.set_xlim(0, 1)
    strip.set_ylim(0, 1)
    size = 10.5 * figure.get_figwidth() / 8
    strip.text(0.03, 0.5, text, va="center", fontsize=size, weight="bold", color="#1a1a1a")
    entries = [("in both", COMMON, 0.40), ("missing", MISSING, 0.58), ("added", ADDED, 0.76)]
    for name, colour, x in entries:
        strip.add_patch(Rectangle((x, 0.32), 0.03, 0.36, facecolor=colour, edgecolor="none"))
        strip.text(x + 0.04, 0.5, name, va="center", fontsize=size, color="#1a1a1a")


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
