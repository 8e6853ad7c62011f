"""How the tiles of a tiling lie, in plain words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orbiflow.arrays import Array
from orbiflow.symmetry import symmetry_elements
from orbiflow.tiles.tilings.surroundings import neighbours
from orbiflow.tiles.tilings.tile_copies import Placed, copies_meeting
from orbiflow.tiles.tilings.tiling import Tiles, Tiling, as_tiling

_NUMBERS = {3: "three", 4: "four", 6: "six", 8: "eight", 12: "twelve"}
_ROUNDING = 1e-6


def arrangement(tile: Tiles) -> str:
    """Return how the tiles of a tiling lie, in plain words, from its group and from who meets whom.

    The words are about copies of the first prototile.

    >>> from orbiflow.tiles import CLASSES, Tile
    >>> arrangement(Tile(CLASSES["IH21"].template(), CLASSES["IH21"].group()))
    'six around a point'
    """
    tiling = as_tiling(tile)
    shapes = len(tiling.prototiles)
    return (f"{shapes} shapes, " if shapes > 1 else "") + _words(tiling)


def _words(tiling: Tiling) -> str:
    own, cosets = tiling.stabilisers[0].elements, tiling.group.cosets
    flips = any(g.determinant < 0 for g in cosets) and all(s.determinant > 0 for s in own)
    turns = sum(g.determinant > 0 for g in cosets) // sum(s.determinant > 0 for s in own)
    if turns > 2:
        return _around(tiling) + (", with their mirror images" if flips else "")
    half = ", half turned over" if flips else ""
    if turns == 2 and any(np.allclose(s.linear, -np.eye(2)) for s in own):
        return f"every other one turned a quarter{half}"
    near = [g for g in neighbours(tiling).edge if g.prototile == 0]
    rows = [g.translation for g in near if np.allclose(g.linear, np.eye(2))]
    if turns == 2 and not rows:
        return f"every other one upside down{half}"
    if turns == 2:
        both = "upside down and turned over by turns"
        return f"rows, {both if flips else 'every other row upside down'}"
    if not flips:
        return "rows, all alike"
    return _flipped_rows(near, rows[0]) if rows else "every other one turned over"


def _around(tiling: Tiling) -> str:
    """Return how many tiles meet at the centre of a rotation, where these are most."""
    centers = [c.point for c in symmetry_elements(tiling.group).centers if c.order > 2]
    size = _ROUNDING * float(np.sqrt(tiling.tile_area))
    met = [copies_meeting(tiling, (*(p - size), *(p + size))).prototiles for p in centers]
    count = max(int((prototiles == 0).sum()) for prototiles in met)
    return f"{_NUMBERS.get(count, count)} around a point"


def _flipped_rows(near: Sequence[Placed], row: Array) -> str:
    """Return the words for rows along a vector, with every other row turned over."""
    flipped = [g for g in near if g.determinant < 0]
    image = flipped[0].linear @ row
    size = _ROUNDING * float(np.linalg.norm(row))
    if np.linalg.norm(image + row) < size:
        return "rows, every other row facing the other way"
    mirrored = any(np.linalg.norm((g @ g).translation) < size for g in flipped)
    bricks = np.linalg.norm(image - row) < size and not mirrored
    return f"{'brick ' if bricks else ''}rows, every other row turned over"
