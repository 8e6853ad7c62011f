"""Which part of the plane a picture shows."""

from __future__ import annotations

import math

from orbiflow.tilings import Tiles, as_tiling
from orbiflow.tilings.window import Window

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
