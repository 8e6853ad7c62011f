"""The neighbours of a tile: those that share a piece of its boundary, or only points of it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from orbiflow.arguments import number, whole
from orbiflow.geometry import subdivided
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings.edge_matching import segment_tree
from orbiflow.tilings.images import Surroundings, surroundings
from orbiflow.tilings.placed import Placed
from orbiflow.tilings.tile import Tiles, as_tiling

_SAMPLES = 200  # points on the boundary at least, so that coarse polygons are seen as curves


class Neighbours(NamedTuple):
    """The other tiles that touch a prototile, each as one group element, nearest first.

    Args:
        edge: those that share a piece of boundary of positive length.
        point: those that only touch at points.
    """

    edge: tuple[Placed, ...]
    point: tuple[Placed, ...]


def neighbours(tile: Tiles, prototile: int = 0, *, tolerance: float = 1e-7) -> Neighbours:
    """The tiles that touch a prototile.

    Args:
        tile: a tile or a tiling, certified or not.
        prototile: whose neighbours; each of them says of which prototile it is a copy.
        tolerance: what counts as touching, in square roots of the tile's area.

    Raises:
        OrbiflowError: if polygon and group are of very different size.

    >>> from orbiflow.tilings import Tile
    >>> from orbiflow.tilings.classes import isohedral_class
    >>> floret = isohedral_class("IH21")
    >>> found = neighbours(Tile(floret.template(), floret.group()))
    >>> len(found.edge), len(found.point)
    (5, 3)
    """
    tiling = as_tiling(tile)
    tolerance = number(tolerance, "tolerance", 0)
    prototile = whole(prototile, "the prototile", 0, len(tiling.prototiles) - 1)
    around = surroundings(tiling, prototile, tolerance)
    near, shares = touching(around, tolerance)
    return Neighbours(near.select(shares).elements(), near.select(~shares).elements())


def touching(around: Surroundings, tolerance: float) -> tuple[Surroundings, NDArray[np.bool_]]:
    """Those of the tiles around that touch the prototile, and which of them share boundary."""
    if not len(around):
        return around, np.zeros(0, dtype=bool)
    outline = shapely.linearrings(around.ring)
    shapely.prepare(outline)
    near = around.select(np.asarray(shapely.dwithin(outline, around.rings, tolerance)))
    shares: NDArray[np.bool_] = np.zeros(len(near), dtype=bool)
    if len(near):
        points = shapely.points(_boundary_samples(near.ring))
        _, hits = segment_tree(near).query(points, predicate="dwithin", distance=tolerance)
        shares[near.owner[hits]] = True
    return near, shares


def _boundary_samples(ring: Array) -> Array:
    """Interior points of the segments, midpoints among them: never the corners."""
    per_segment = 2 * math.ceil(_SAMPLES / (2 * len(ring))) + 1 if len(ring) < _SAMPLES else 1
    return subdivided(ring, per_segment, phase=0.5)
