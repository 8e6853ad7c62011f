"""PNG pictures: a tiling, and a tile over its target."""

from __future__ import annotations

import math

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely.geometry.base import BaseGeometry

from orbiflow.arguments import numbers
from orbiflow.arrays import Window, checked_window
from orbiflow.drawing import (
    DEFAULT_PALETTE,
    Palette,
    Picture,
    Raster,
    Sheet,
    caption,
    captioned,
    palette,
    strip_middle,
    vector_picture,
)
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.tilings import (
    Colouring,
    Tile,
    Tiles,
    as_tiling,
    colouring,
    copies_meeting,
)

ASPECT = 1.5
"""Width over height of the default window."""


def default_window(tile: Tiles) -> Window:
    """A landscape window around the tile or prototiles, about four to five tiles across."""
    tiling = as_tiling(tile)
    width, height = tiling.box[1] - tiling.box[0]
    # by area, but so that a long tile with its limbs among its neighbours shows whole
    across = max(5.5 * math.sqrt(tiling.tile_area), 1.8 * width, 1.4 * ASPECT * height)
    x, y = tiling.center
    half, high = across / 2, across / 2 / ASPECT
    return float(x - half), float(y - high), float(x + half), float(y + high)


COMMON, MISSING, ADDED = "#c9d3dc", "#d95f02", "#2b6cb0"
"""Fills of the overlay: in both, in the target only, in the tile only."""


DOTS = 200 / 72
"""Pixels of a point, where widths are given in points."""


def tiling_png(
    tile: Tiles,
    window: Window | None = None,
    *,
    width_px: int = 1600,
    palette_name: str | Palette = DEFAULT_PALETTE,
    colours: Colouring | None = None,
    outline_pt: float = 0.8,
    y_down: bool = False,
) -> bytes:
    """PNG of the tiles that meet `window`, edge to edge.

    Args:
        tile: a tile or a tiling.
        window: (xmin, ymin, xmax, ymax) in the tile's units, default `default_window`.
        width_px: the height follows from the window.
        colours: default `colouring(tile)`.
        outline_pt: outline in points of 1/72 inch at 200 dots per inch; 0 for none.
        y_down: whether the tile's y axis points down, as in images.

    Raises:
        OrbiflowError: for an unknown palette, a size that cannot be made, or a window that is
            empty or holds too many tiles.
    """
    return tiling_raster(
        tile,
        window,
        width_px=width_px,
        palette_name=palette_name,
        colours=colours,
        outline_px=outline_pt * DOTS,
        y_down=y_down,
    ).png()


def tiling_raster(
    tile: Tiles,
    window: Window | None = None,
    *,
    width_px: int,
    palette_name: str | Palette = DEFAULT_PALETTE,
    colours: Colouring | None = None,
    outline_px: float = 2.0,
    y_down: bool = False,
    strip_px: int = 0,
) -> Raster:
    """The picture of `tiling_png`, to be drawn on or to be made an image; outline in pixels.

    Args:
        strip_px: height of a strip below it, for words.
    """
    chosen, tiling = palette(palette_name), as_tiling(tile)
    colours = colours or colouring(tiling)
    window = checked_window(window or default_window(tiling))
    raster = Raster(window, width_px, y_down=y_down, paper=chosen.paper, strip_px=strip_px)
    copies = copies_meeting(tiling, window)
    rings, own = copies.rings(), colours.colours(copies)
    for number in range(colours.count):
        raster.fill([rings[k] for k in np.flatnonzero(own == number)], chosen.fill(number))
    if outline_px > 0:
        for ring in rings:
            raster.line(ring, chosen.outline, outline_px, closed=True)
    return raster


def tiling_picture(
    tile: Tiles,
    window: Window | None = None,
    *,
    palette_name: str | Palette = DEFAULT_PALETTE,
    colours: Colouring | None = None,
    y_down: bool = False,
    sheet: Sheet | None = None,
) -> Picture:
    """The picture of `tiling_png` for print, in curves.

    Args:
        window, palette_name, colours, y_down: as for `tiling_png`.
        sheet: default a journal's single column, as PDF.

    Raises:
        OrbiflowError: as `tiling_png`.
    """
    raster = tiling_raster(
        tile, window, width_px=1600, palette_name=palette_name, colours=colours, y_down=y_down,
        outline_px=3.0,
    )  # fmt: skip
    kind = tile.isohedral_class if isinstance(tile, Tile) else ""
    several = f"{len(as_tiling(tile).prototiles)} tiles"
    name = "a tile" if len(as_tiling(tile).prototiles) == 1 else several
    title = f"Tiling by copies of {name}" + (f" of class {kind}" if kind else "")
    return vector_picture(raster, sheet or Sheet.column(), title=title, caption="")


def overlay_png(
    tile: Tile,
    target: ArrayLike | BaseGeometry,
    *,
    width_px: int = 1200,
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
    """The picture of `overlay_png` for print, in curves; the caption has its legend.

    Args:
        target, y_down: as for `overlay_png`.
        sheet: default a journal's single column, as PDF.

    Raises:
        OrbiflowError: as `overlay_png`.
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
    """The picture of `overlay_png` without its legend; and without a strip for an empty `text`."""
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
