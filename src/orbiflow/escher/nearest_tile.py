"""The tiles of a class that are nearest to an outline, in closed form, thousands at a time."""

from __future__ import annotations

import numpy as np

from orbiflow.escher.placements import Complex, Placements
from orbiflow.escher.tile_space import NearestTiles, TileSpace
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings import IsohedralClass

CHUNK = 4000
"""Placements worked on at a time: bounds the memory at some hundred MB."""


def nearest_tiles(
    kind: IsohedralClass,
    outline: Complex,
    placements: Placements,
    weights: Array | None = None,
) -> NearestTiles:
    """Project an outline onto the tiles of a class, for every placement (see `tile_space`).

    Args:
        kind: the isohedral class.
        outline: (n,) points x + iy, counter-clockwise.
        placements: C of them, of this class and n.
        weights: (n,) positive weights of the points; default 1.
    """
    found: list[NearestTiles] = []
    pieces = max(1, -(-len(placements.starts) // CHUNK))
    for index in np.array_split(np.arange(len(placements.starts)), pieces):
        space = TileSpace(kind, placements.take(index), weights)
        found.append(space.nearest(np.broadcast_to(outline, (space.count, len(outline)))))
    return NearestTiles(*(np.concatenate(parts) for parts in zip(*found, strict=True)))
