"""Which part of the plane a picture shows."""

from __future__ import annotations

import math

from orbiflow.tilings import Tile
from orbiflow.tilings.images import expected_area
from orbiflow.tilings.window import Window

ASPECT = 1.5
"""Width over height of the default window."""


def default_window(tile: Tile) -> Window:
    """A landscape window around the tile, about four to five tiles across."""
    width, height = tile.polygon.max(axis=0) - tile.polygon.min(axis=0)
    # by area, but so that a long tile with its limbs among its neighbours shows whole
    across = max(5.5 * math.sqrt(expected_area(tile)), 1.8 * width, 1.4 * ASPECT * height)
    x, y = tile.center
    half, high = across / 2, across / 2 / ASPECT
    return float(x - half), float(y - high), float(x + half), float(y + high)
