"""Maps from a silhouette to a tile: its mesh laid onto the tile it was bent to, or outlines matched."""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

from __future__ import annotations

from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray

from orbiflow.arrays import Array, Integers
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.geometry import arc_lengths, orient, plane_points, points_along, resampled
from orbiflow.tiles.search.bending import Bent
from orbiflow.tiles.silhouette import Bending, Mesh, harmonic, triangulate, unfolded
from orbiflow.tiles.tilings import Tile

SAME = 1e-9  # distance along the outline, in outlines, below which points are one


def map_of_bent(bent: Bent, factor: complex, shift: complex, tile: Tile) -> Bending:
    """Return the map that a bent silhouette and its similarity z -> factor z + shift make.

    Its outline is laid onto the tile; an `OrbiflowError` if the inside cannot follow without folds.
    """
    hand = bent.hand
    flip = np.array([1.0, -1.0]) if hand.mirrored else np.ones(2)
    z = factor * bent.points + shift
    placement, n = bent.placement, hand.fine.size
    first = np.cumsum(placement.lengths[0]) - placement.lengths[0]
    mesh, images = onto_polygon(
        hand.fine.mesh,
        plane_points(z),
        tile.polygon * flip,
        (first + placement.starts[0]) % n,
        np.array(tile.corners),
    )
    images = unfolded(mesh, images)
    triangles = mesh.triangles[:, ::-1] if hand.mirrored else mesh.triangles
    return Bending(mesh.points * flip, images * flip, triangles)


def onto_polygon(
    mesh: Mesh, images: Array, polygon: Array, corners: Integers, vertices: Integers
) -> tuple[Mesh, Array]:
    """Move the outline's images (of `images` (N, 2)) onto a polygon (Q, 2); return the mesh and images.

    A vertex of the polygon that is none of the outline's points becomes one; points between two
    vertices are laid onto their side in proportion. The points `corners` (K,) go to the `vertices`
    (K,), both in order round.
    """
    n, outline = mesh.size, mesh.size + len(mesh.sides)
    knots = arc_lengths(np.roll(images[:n], -corners[0], axis=0))
    polygon = np.roll(polygon, -vertices[0], axis=0)
    own, goal = (corners - corners[0]) % n, (vertices - vertices[0]) % len(polygon)
    if len(own) != len(goal) or (np.diff(own) < 1).any() or (np.diff(goal) < 1).any():
        raise OrbiflowError("the corners of the outline and the polygon do not correspond")
    places = _places(np.roll(images[:n], -corners[0], axis=0), polygon, knots, own, goal)

    share: Array = (np.concatenate([np.arange(n), mesh.sides + mesh.shares]) - corners[0]) % n
    known = np.interp(share, np.arange(n + 1), knots)
    order = np.argsort(known)
    places, fresh = _snapped(places, known[order], knots[-1])
    closed = np.append(places, knots[-1])
    along = np.concatenate([known, places[fresh]])
    laid = np.stack(
        [np.interp(along, closed, np.append(column, column[0])) for column in polygon.T], axis=-1
    )
    at = np.interp(places[fresh], knots, np.arange(n + 1)) + corners[0]
    divided = _with_points(mesh, at % n, order, np.searchsorted(known[order], places[fresh]))
    return divided, np.concatenate([laid, images[outline:]])


def _places(ring: Array, polygon: Array, knots: Array, own: Integers, goal: Integers) -> Array:
    """(Q,) where on the ring, in arc length, the polygon's vertices belong: increasing from 0."""
    lengths = arc_lengths(polygon)
    closed, loop = np.concatenate([ring, ring[:1]]), np.concatenate([polygon, polygon[:1]])
    found = np.empty(len(polygon))
    ends = zip(own, [*own[1:], len(ring)], goal, [*goal[1:], len(polygon)], strict=True)
    for a, b, p, q in ends:
        edge = shapely.LineString(closed[a : b + 1])
        at = knots[a] + shapely.line_locate_point(edge, shapely.points(loop[p : q + 1]))
        at[0], at[-1] = knots[a], knots[b]
        # vertices that are points of the edge lie exactly there
        apart = abs(loop[p : q + 1, None] - closed[None, a : b + 1]).max(axis=2)
        same = apart.min(axis=1) < SAME
        same[[0, -1]] = False
        at = np.where(same, knots[a : b + 1][apart.argmin(axis=1)], at)
        if (np.diff(at) <= SAME * knots[-1]).any():
            # where the edge comes back to itself the nearest point may be out of order
            at = np.interp(lengths[p : q + 1], lengths[[p, q]], knots[[a, b]])
        found[p:q] = at[:-1]
    return found


def _snapped(places: Array, known: Array, total: float) -> tuple[Array, NDArray[np.bool_]]:
    """Places moved to the known ones that they agree with, and which agree with none."""
    after = np.searchsorted(known, places).clip(1, len(known) - 1)
    near = np.where(
        places - known[after - 1] < known[after] - places, known[after - 1], known[after]
    )
    fresh = abs(near - places) > SAME * total
    return np.where(fresh, places, near), fresh


def _with_points(mesh: Mesh, at: Array, order: Integers, slots: Integers) -> Mesh:
    """The mesh with points on the outline at `at` (m,), in vertices from the first.

    Point j lies between `order[slots[j] - 1]` and `order[slots[j]]`, after those before it there.
    """
    if not len(at):
        return mesh
    n, outline = mesh.size, mesh.size + len(mesh.sides)
    side = np.minimum(np.floor(at).astype(np.int64), n - 1)
    start, end = mesh.points[side], mesh.points[(side + 1) % n]
    points = start + (at - side)[:, None] * (end - start)
    triangles = np.where(mesh.triangles >= outline, mesh.triangles + len(at), mesh.triangles)
    owner = {(t[k - 1], t[k]): (i, k) for i, t in enumerate(triangles.tolist()) for k in range(3)}
    rows = triangles.tolist()
    for slot in np.unique(slots):
        a, b = int(order[slot - 1]), int(order[slot % len(order)])
        i, k = owner[a, b]
        apex = rows[i][k - 2]
        chain = [a, *(outline + np.flatnonzero(slots == slot)).tolist(), b]
        pieces = [[u, v, apex] for u, v in pairwise(chain)]
        rows[i] = pieces[0]
        rows += pieces[1:]
    return Mesh(
        np.concatenate([mesh.points[:outline], points, mesh.points[outline:]]),
        np.array(rows, dtype=np.int64),
        np.concatenate([mesh.sides, side]),
        np.concatenate([mesh.shares, at - side]),
        n,
    )


TILE, SILHOUETTE = 240, 480  # points along the two outlines that are matched
STEPS = 12  # most points of the silhouette that one step along the tile passes
EVENNESS = 2e-3  # cost of a step that is not the usual two points, in areas a point squared
# Share of the matching that goes evenly round: no part of the silhouette is squeezed to nothing
PROPORTION = 0.15


def matched(silhouette: Array, polygon: Array) -> Bending:
    """Return a map without folds from a silhouette (N, 2) to a tile (M, 2) over it, in normal form.

    Points of the outlines are matched in order, near ones with near ones (dynamic programming over
    both outlines, from the two points that are nearest); the inside follows harmonically and
    is untangled.

    Raises:
        OrbiflowError: if the inside cannot follow without folds.
    """
    rest = orient(silhouette, counter_clockwise=True)
    ring = orient(polygon, counter_clockwise=True)
    mesh = triangulate(ring)
    tile, goal = resampled(ring, TILE), resampled(rest, SILHOUETTE)
    first, start = np.unravel_index(_apart(tile, goal).argmin(), (TILE, SILHOUETTE))
    steps = _matching(np.roll(tile, -first, axis=0), np.roll(goal, -start, axis=0))
    even = np.linspace(0, SILHOUETTE, TILE + 1)
    places = (1 - PROPORTION) * steps + PROPORTION * even
    # how far round the polygon each point of the mesh on its outline lies
    knots = arc_lengths(ring)
    vertex = np.concatenate([np.arange(mesh.size), mesh.sides + mesh.shares])
    share: Array = np.interp(vertex, np.arange(len(knots)), knots) / knots[-1]
    turn = (share * TILE - first) % TILE
    place = (np.interp(turn, np.arange(TILE + 1), places) + start) % SILHOUETTE
    lengths = arc_lengths(rest)
    outline = points_along(rest, place / SILHOUETTE * lengths[-1])
    moved = harmonic(mesh, outline - mesh.points[: len(outline)])
    points = mesh.points + moved
    try:
        return Bending(unfolded(mesh, points), mesh.points, mesh.triangles)
    except OrbiflowError as error:
        raise OrbiflowError(
            "the silhouette cannot be carried to this tile without folds: they differ too much"
        ) from error


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
