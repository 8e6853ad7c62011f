"""A map from a silhouette to a tile over it, where the search left none: by matching the outlines."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import spsolve

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.geometry import arc_lengths, orient, points_along
from orbiflow.tiles.silhouette import Bending, Mesh, triangulate, unfolded

TILE, SILHOUETTE = 240, 480
"""Points along the two outlines that are matched."""

STEPS = 12
"""Most points of the silhouette that one step along the tile passes."""

EVENNESS = 2e-3
"""Cost of a step that is not the usual two points, in areas a point squared."""

PROPORTION = 0.15
"""Share of the matching that goes evenly round: no part of the silhouette is squeezed to nothing."""


def matched(silhouette: Array, polygon: Array) -> Bending:
    """A map without folds from a silhouette to a tile that lies over it.

    Points of the outlines are matched in order, near ones with near ones (dynamic programming over
    both outlines, from the two points that are nearest); the inside follows harmonically and
    is untangled.

    Args:
        silhouette: outline (N, 2) in the target's normal form.
        polygon: (M, 2) of the tile, there.

    Raises:
        OrbiflowError: if the inside cannot follow without folds.
    """
    rest = orient(silhouette, counter_clockwise=True)
    ring = orient(polygon, counter_clockwise=True)
    mesh = triangulate(ring)
    tile, goal = _spread(ring, TILE), _spread(rest, SILHOUETTE)
    first, start = np.unravel_index(_apart(tile, goal).argmin(), (TILE, SILHOUETTE))
    steps = _matching(np.roll(tile, -first, axis=0), np.roll(goal, -start, axis=0))
    even = np.linspace(0, SILHOUETTE, TILE + 1)
    places = (1 - PROPORTION) * steps + PROPORTION * even
    share = _shares(mesh, ring)
    turn = (share * TILE - first) % TILE
    place = (np.interp(turn, np.arange(TILE + 1), places) + start) % SILHOUETTE
    lengths = arc_lengths(rest)
    outline = points_along(rest, place / SILHOUETTE * lengths[-1])
    points = _harmonic(mesh, outline)
    try:
        return Bending(unfolded(mesh, points), mesh.points, mesh.triangles)
    except OrbiflowError as error:
        raise OrbiflowError(
            "the silhouette cannot be carried to this tile without folds: they differ too much"
        ) from error


def _spread(ring: Array, count: int) -> Array:
    total = arc_lengths(ring)[-1]
    return points_along(ring, np.arange(count) / count * total)


def _apart(first: Array, second: Array) -> Array:
    """(N, M) squared distances."""
    return ((first[:, None] - second[None]) ** 2).sum(axis=2)


def _matching(tile: Array, goal: Array) -> Array:
    """(TILE + 1,) for each point of the tile, from 0 to SILHOUETTE, its point of the silhouette."""
    cost = _apart(tile, np.concatenate([goal, goal[:1]]))
    cost = np.concatenate([cost, cost[:1]])
    pay = EVENNESS * (np.arange(STEPS + 1) - SILHOUETTE / TILE) ** 2
    best = np.full(SILHOUETTE + 1, np.inf)
    best[0] = 0.0
    taken = np.zeros((TILE + 1, SILHOUETTE + 1), dtype=np.int64)
    for i in range(1, TILE + 1):
        options = np.full((STEPS + 1, SILHOUETTE + 1), np.inf)
        for k in range(STEPS + 1):
            options[k, k:] = best[: SILHOUETTE + 1 - k] + pay[k]
        taken[i] = options.argmin(axis=0)
        best = options.min(axis=0) + cost[i]
    found = np.empty(TILE + 1)
    place = SILHOUETTE
    for i in range(TILE, -1, -1):
        found[i] = place
        place -= taken[i, place]
    return found


def _shares(mesh: Mesh, ring: Array) -> Array:
    """(B,) how far round the polygon, 0 to 1, each point of the mesh on its outline lies."""
    lengths = arc_lengths(ring)
    vertex = np.concatenate([np.arange(mesh.size), mesh.sides + mesh.shares])
    return np.interp(vertex, np.arange(len(lengths)), lengths) / lengths[-1]


def _harmonic(mesh: Mesh, outline: Array) -> Array:
    """(N, 2) the mesh's points moved: those inside by the mean of how their neighbours are."""
    count, fixed = len(mesh.points), len(outline)
    ends = np.concatenate([mesh.triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    links = sparse.coo_array((np.ones(len(ends)), ends.T), shape=(count, count)).tocsr()
    links = links + links.T
    own, degrees = np.arange(count), np.asarray(links.sum(axis=1)).ravel()
    degree = sparse.coo_array((degrees, (own, own)), shape=(count, count)).tocsr()
    laplacian = sparse.csr_array(degree - links)
    moved = outline - mesh.points[:fixed]
    inner = spsolve(
        sparse.csc_array(laplacian[fixed:, fixed:]), -(laplacian[fixed:, :fixed] @ moved)
    )
    return mesh.points + np.concatenate([moved, np.asarray(inner).reshape(-1, 2)])
