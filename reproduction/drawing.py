"""Vector drawings that several exhibits have in common: a tile over its goal, a tiling."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from orbiflow.arrays import Array, Window
from orbiflow.drawing import (
    PALETTES,
    Palette,
    fill_rings,
)
from orbiflow.tiles import (
    Tile,
    colouring,
    copies_meeting,
)
from reproduction.panels import around

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TILE, GOAL, EDGE = "#8ab6d9", "#c2410c", "#16202a"
"""A tile's fill, a goal's outline over it, a tile's outline."""


def draw_over(axes: Axes, ring: Array, goal: Array, *, width: float = 1.0) -> None:
    """A tile (N, 2), filled, and the outline (M, 2) of what it is to look like."""
    fill_rings(axes, [ring], TILE, EDGE, 0.7 * width)
    fill_rings(axes, [goal], "none", GOAL, width)


def draw_tiling(axes: Axes, tile: Tile, window: Window, palette: Palette | None = None) -> None:
    """All copies of a tile that meet a window, neighbours in different colours."""
    palette = palette or PALETTES["delft"]
    copies = copies_meeting(tile, window)
    rings, own = copies.images(tile.polygon), colouring(tile).colours(copies)
    for number in np.unique(own):
        fill_rings(
            axes, list(rings[own == number]), palette.fill(int(number)), palette.outline, 0.5
        )


def window_of(rings: list[Array], aspect: float, margin: float = 0.05) -> Window:
    """The window of that width over height about all points of `rings`."""
    points = np.concatenate(rings)
    low, high = points.min(axis=0), points.max(axis=0)
    half = (0.5 + margin) * (high - low)
    half = np.maximum(half, half[::-1] * (aspect, 1 / aspect))
    return around((low + high) / 2, float(half[0]), float(half[1]))
