"""Tiles whose sides meet in part, such as bricks in half bond: with the vertices that they lack."""

from __future__ import annotations

import numpy as np
import shapely

from orbiflow.symmetry.isometry import Array, Isometry
from orbiflow.tilings.edges import TOLERANCE
from orbiflow.tilings.images import Surroundings, surroundings
from orbiflow.tilings.prototile import Prototile
from orbiflow.tilings.tile import Tiles, as_tiling
from orbiflow.tilings.tiling import Tiling
from orbiflow.typed_shapely import ufuncs


def edge_to_edge(tile: Tiles) -> Tiling:
    """The same tiling, with a vertex wherever a neighbour, or the tile's own image, has one.

    After that the vertices on a boundary are all those of the tiling that lie there, so shared sides
    agree. One that is edge to edge already comes back with the same vertices.

    Args:
        tile: a tile or a tiling.

    Raises:
        OrbiflowError: if polygon and group are of very different size.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> bricks = Tiling(wallpaper_group("p1", [[2, 1], [0, 1]]), [[[0, 0], [2, 0], [2, 1], [0, 1]]])
    >>> len(edge_to_edge(bricks).prototiles[0].polygon)
    6
    """
    tiling = as_tiling(tile)
    return Tiling(tiling.group, [_with_vertices(tiling, k) for k in range(len(tiling.prototiles))])


def _with_vertices(tiling: Tiling, k: int) -> Prototile:
    own, around = tiling.prototiles[k], surroundings(tiling, k, TOLERANCE)
    ring = own.ring
    points = np.concatenate(
        [_back(around, own, tiling), *(s(ring) for s in _symmetries(tiling, k))]
    )
    reach = TOLERANCE * float(np.sqrt(tiling.tile_area))
    line = shapely.LinearRing(ring)
    points = points[shapely.dwithin(line, shapely.points(points), reach)]
    near = np.linalg.norm(points[:, None] - ring, axis=2).min(axis=1, initial=np.inf)
    points = points[near > 2 * reach]
    if not len(points):
        return own
    along = ufuncs.line_locate_point(line, ufuncs.points(points))
    order = np.argsort(along)
    fresh = np.diff(along[order], prepend=-np.inf) > 2 * reach
    points, along = points[order][fresh], along[order][fresh]
    steps = np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1)
    at = np.searchsorted(np.cumsum(steps) - steps, along, side="right")
    corners = np.searchsorted(own.kept, own.corners, side="left")
    moved = corners + np.searchsorted(at, corners, side="right")
    return Prototile(np.insert(ring, at, points, axis=0), tuple(int(c) for c in moved))


def _back(around: Surroundings, own: Prototile, tiling: Tiling) -> Array:
    """The vertices of the tiles around, in the tiling's own coordinates."""
    return around.points * np.sqrt(tiling.tile_area) + own.center


def _symmetries(tiling: Tiling, k: int) -> list[Isometry]:
    return list(tiling.stabilisers[k].elements[1:])
