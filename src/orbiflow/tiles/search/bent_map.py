"""Maps from a silhouette to a tile: its mesh laid onto the tile it was bent to, or outlines matched."""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

from __future__ import annotations

import contextlib
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from orbiflow.arrays import Array, Integers
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.geometry import (
    arc_lengths,
    border,
    orient,
    plane_points,
    points_along,
    resampled,
    signed_area,
)
from orbiflow.tiles.search.bending import Bent
from orbiflow.tiles.silhouette import Bending, SilhouetteMesh, harmonic, triangulate, unfolded
from orbiflow.tiles.tilings import Tile

SAME_PLACE = 1e-9  # distance along the outline, in outlines, below which points are one
SHARPENINGS = 80  # most tries to follow the outline's finest parts


def map_of_bent(bent: Bent, factor: complex, shift: complex, tile: Tile) -> Bending:
    """Return the map that a bent silhouette and its similarity z -> factor z + shift make.

    Its outline is laid onto the tile, the points between those that were bent as well; an
    `OrbiflowError` if the inside cannot follow without folds.
    """
    side = bent.orientation
    flip = np.array([1.0, -1.0]) if side.mirrored else np.ones(2)
    z = factor * bent.points + shift
    n = side.fine.size
    # how far along the outline each vertex of the mesh lies: all are points of it
    knots = arc_lengths(side.outline)
    line = shapely.LinearRing(side.outline)
    vertices = shapely.points(side.fine.mesh.points[:n])
    along: Array = np.asarray(shapely.line_locate_point(line, vertices))
    places: Array = np.append((along - along[0]) % knots[-1], knots[-1])
    passed: Array = (knots - along[0]) % knots[-1]
    numbers = np.interp(passed, places, np.arange(n + 1))
    mesh, images = divided(side.fine.mesh, _unknown(side.fine.mesh, numbers), plane_points(z))
    mesh, images = onto_polygon(
        mesh, images, tile.polygon * flip, bent.tile.corners, np.array(tile.corners)
    )
    outline = points_along(
        side.outline, along[0] + np.interp(shares(mesh), np.arange(n + 1), places)
    )
    rest = with_outline(mesh, mesh.points, outline)
    images = unfolded(mesh, images)
    triangles = mesh.triangles[:, ::-1] if side.mirrored else mesh.triangles
    return Bending(rest * flip, images * flip, triangles)


def onto_polygon(
    mesh: SilhouetteMesh, images: Array, polygon: Array, corners: Integers, vertices: Integers
) -> tuple[SilhouetteMesh, Array]:
    """Move the outline's images, of `images` (N, 2), onto a polygon (Q, 2); return mesh and images.

    Vertices of the polygon become points of the mesh; points between two vertices are laid onto their
    side in proportion. The points `corners` (K,) go to the `vertices` (K,), both in order round.
    """
    n, outline = mesh.size, mesh.size + len(mesh.sides)
    knots = arc_lengths(np.roll(images[:n], -corners[0], axis=0))
    polygon = np.roll(polygon, -vertices[0], axis=0)
    starts, goal = (corners - corners[0]) % n, (vertices - vertices[0]) % len(polygon)
    if len(starts) != len(goal) or (np.diff(starts) < 1).any() or (np.diff(goal) < 1).any():
        raise OrbiflowError("the corners of the outline and the polygon do not correspond")
    places = _places(np.roll(images[:n], -corners[0], axis=0), polygon, knots, starts, goal)

    share: Array = (shares(mesh) - corners[0]) % n
    lengths = np.interp(share, np.arange(n + 1), knots)
    places, fresh = _snapped(places, np.sort(lengths), knots[-1])
    closed = np.append(places, knots[-1])
    along = np.concatenate([lengths, places[fresh]])
    laid = np.stack(
        [np.interp(along, closed, np.append(column, column[0])) for column in polygon.T], axis=-1
    )
    at = np.interp(places[fresh], knots, np.arange(n + 1)) + corners[0]
    mesh, images = divided(mesh, at % n, np.concatenate([laid[:outline], images[outline:]]))
    images[: len(laid)] = laid
    return mesh, images


def _places(ring: Array, polygon: Array, knots: Array, begins: Integers, goal: Integers) -> Array:
    """Return where (Q,) the polygon's vertices belong on the ring, in arc length: increasing from 0."""
    lengths = arc_lengths(polygon)
    closed, loop = np.concatenate([ring, ring[:1]]), np.concatenate([polygon, polygon[:1]])
    places = np.empty(len(polygon))
    ends = zip(begins, [*begins[1:], len(ring)], goal, [*goal[1:], len(polygon)], strict=True)
    for a, b, p, q in ends:
        edge = shapely.LineString(closed[a : b + 1])
        at = knots[a] + shapely.line_locate_point(edge, shapely.points(loop[p : q + 1]))
        at[0], at[-1] = knots[a], knots[b]
        # vertices that are points of the edge lie exactly there
        apart = abs(loop[p : q + 1, None] - closed[None, a : b + 1]).max(axis=2)
        same = apart.min(axis=1) < SAME_PLACE
        same[[0, -1]] = False
        at = np.where(same, knots[a : b + 1][apart.argmin(axis=1)], at)
        if (np.diff(at) <= SAME_PLACE * knots[-1]).any():
            # where the edge comes back to itself the nearest point may be out of order
            at = np.interp(lengths[p : q + 1], lengths[[p, q]], knots[[a, b]])
        places[p:q] = at[:-1]
    return places


def _snapped(places: Array, marks: Array, total: float) -> tuple[Array, NDArray[np.bool_]]:
    """Return places moved to the known ones that they agree with, and which agree with none."""
    after = np.searchsorted(marks, places).clip(1, len(marks) - 1)
    near = np.where(
        places - marks[after - 1] < marks[after] - places, marks[after - 1], marks[after]
    )
    fresh = abs(near - places) > SAME_PLACE * total
    return np.where(fresh, places, near), fresh


def with_outline(mesh: SilhouetteMesh, points: Array, outline: Array) -> Array:
    """Return a map's points (N, 2) with those of the outline moved a little, to `outline` (O, 2).

    All stay in place where the inside cannot follow without folds: behind hairs.
    """
    with contextlib.suppress(OrbiflowError):
        return unfolded(mesh, np.concatenate([outline, points[len(outline) :]]), SHARPENINGS)
    return points


def shares(mesh: SilhouetteMesh) -> Array:
    """Return where (O,) the points of a mesh's outline lie on it, in vertices from the first."""
    return np.concatenate([np.arange(mesh.size), mesh.sides + mesh.shares])


def _unknown(mesh: SilhouetteMesh, at: Array) -> Array:
    """Return the places (m,) on the outline, in vertices from the first, that are no points of it."""
    places = np.sort(at % mesh.size)
    places = places[_snapped(places, np.append(np.sort(shares(mesh)), mesh.size), 1.0)[1]]
    return places[np.diff(places, prepend=-1.0) > SAME_PLACE]


def divided(mesh: SilhouetteMesh, at: Array, images: Array) -> tuple[SilhouetteMesh, Array]:
    """Return a mesh with new points on its outline, and its `images` (N, 2) extended linearly.

    The points lie at `at` (m,), in vertices from the first. Where several divide the side of one
    triangle, each gets a point behind it, so that triangles can follow an outline that winds.
    """
    before = shares(mesh)
    order, outline, count = np.argsort(before), len(before), len(mesh.points) + len(at)
    slots = np.searchsorted(before[order], at)
    start, end = order[slots - 1], order[slots % outline]
    part = ((at - before[start]) / ((before[end] - before[start]) % mesh.size))[:, None]
    rows = np.where(mesh.triangles >= outline, mesh.triangles + len(at), mesh.triangles).tolist()
    sides = np.array(rows)[:, [[2, 0], [0, 1], [1, 2]]]
    on_outline = np.argwhere((sides < outline).all(axis=2)).tolist()
    owner = {(rows[i][k - 1], rows[i][k]): (i, k) for i, k in on_outline}
    behind: list[tuple[int, int]] = []
    for slot in np.unique(slots):
        a, b = int(order[slot - 1]), int(order[slot % outline])
        i, k = owner[a, b]
        apex = rows[i][k - 2]
        within = np.flatnonzero(slots == slot)
        fresh = (outline + within[np.argsort(at[within])]).tolist()
        second = [*range(count + len(behind), count + len(behind) + len(within))]
        behind += [(point, apex) for point in fresh] if len(within) > 1 else []
        chain, inner = [a, *fresh, b], [a, *(second if len(within) > 1 else fresh), b]
        rows[i] = []
        for (u, v), (p, q) in zip(pairwise(chain), pairwise(inner), strict=True):
            rows += [t for t in ([u, v, q], [u, q, p], [p, q, apex]) if len({*t}) == 3]

    def extended(values: Array) -> Array:
        new = (1 - part) * values[start] + part * values[end]
        longer = np.concatenate([values[:outline], new, values[outline:]])
        return np.concatenate(
            [longer, longer[np.array(behind, dtype=int).reshape(-1, 2)].mean(axis=1)]
        )

    side = np.minimum(np.floor(at).astype(np.int64), mesh.size - 1)
    sides, at_side = np.concatenate([mesh.sides, side]), np.concatenate([mesh.shares, at - side])
    triangles = np.array([t for t in rows if t], dtype=np.int64)
    return SilhouetteMesh(extended(mesh.points), triangles, sides, at_side, mesh.size), extended(
        images
    )


def carried_on(
    bending: Bending,
    before: Array,
    after: Array,
    sharpenings: int | None = None,
    inner: Callable[[Array], Array] | None = None,
) -> Bending:
    """Return a map to a tile `before` (N, 2), composed with the move of its vertices to `after` (N, 2).

    All are in normal form; the polygons may be clockwise. The inside follows harmonically, or goes
    where `inner` says, and is untangled, with so many `sharpenings` at most. Raises an `OrbiflowError`
    if it cannot follow without folds.
    """
    first = border(bending.triangles)
    order = np.concatenate([first, np.setdiff1d(np.arange(len(bending.rest)), first)])
    triangles = np.argsort(order)[bending.triangles]
    mesh = SilhouetteMesh(bending.rest[order], triangles, np.zeros(0, int), np.zeros(0), len(first))
    images = bending.images[order]
    old, new = (p[:: -1 if signed_area(before) < 0 else 1] for p in (before, after))
    # both run along the same curve, from a point that they share
    offset, start = divmod(int(cdist(images[: mesh.size], old).argmin()), len(old))
    old, new = np.roll(old, -start, axis=0), np.roll(new, -start, axis=0)
    knots = arc_lengths(np.roll(images[: mesh.size], -offset, axis=0))
    places: Array = arc_lengths(old) * (knots[-1] / arc_lengths(old)[-1])
    numbers = np.arange(len(knots))
    at = offset + np.interp(places[:-1], knots, numbers)
    mesh, images = divided(mesh, _unknown(mesh, at), images)
    along = np.interp((shares(mesh) - offset) % mesh.size, numbers, knots)
    steps = [np.interp(along, places, np.append(step, step[0])) for step in (new - old).T]
    moved = images + harmonic(mesh, np.stack(steps, axis=-1))
    if inner is not None:
        fixed = mesh.size + len(mesh.sides)
        moved[fixed:] = inner(images[fixed:])
    return Bending(mesh.points, unfolded(mesh, moved, sharpenings), mesh.triangles)


def carried_anew(bending: Bending, before: Array, after: Array, sharpenings: int) -> Bending:
    """Return what `carried_on` does, with triangles of its own, where the map's own would fold.

    The outline of the silhouette is followed between the new points by straight lines.
    """
    way = -1 if signed_area(after) < 0 else 1
    old, new = before[::way], after[::way]
    mesh = triangulate(new)
    places = shares(mesh)
    side, part = np.divmod(places, 1.0)
    numbers, part = side.astype(np.int64) % len(old), part[:, None]
    outline = (1 - part) * old[numbers] + part * old[(numbers + 1) % len(old)]
    back = mesh.points + harmonic(mesh, outline - mesh.points[: len(places)])
    rest = bending.inverse(np.concatenate([outline, back[len(places) :]]))
    for start in (
        rest,
        mesh.points + harmonic(mesh, rest[: len(places)] - mesh.points[: len(places)]),
    ):
        with contextlib.suppress(OrbiflowError):
            return Bending(unfolded(mesh, start, sharpenings), mesh.points, mesh.triangles)
    raise OrbiflowError("what lies on the tile cannot follow there without folds")


TILE_POINTS, SILHOUETTE_POINTS = 240, 480  # points along the two outlines that are matched
MAX_STEP_POINTS = 12  # most points of the silhouette that one step along the tile passes
UNEVEN_COST = 2e-3  # cost of a step that is not the usual two points, in areas a point squared
# Share of the matching that goes evenly round: no part of the silhouette is squeezed to nothing
EVEN_SHARE = 0.15


def matched(silhouette: Array, polygon: Array) -> Bending:
    """Return a map without folds from a silhouette (N, 2) to a tile (M, 2) over it, in normal form.

    Points of the outlines are matched in order, near ones with near ones (dynamic programming over
    both outlines, from the two points that are nearest); the inside follows harmonically and is
    untangled. Raises `OrbiflowError` if it cannot follow without folds.
    """
    rest = orient(silhouette, counter_clockwise=True)
    ring = orient(polygon, counter_clockwise=True)
    mesh = triangulate(ring)
    tile, goal = resampled(ring, TILE_POINTS), resampled(rest, SILHOUETTE_POINTS)
    first, start = np.unravel_index(
        cdist(tile, goal, "sqeuclidean").argmin(), (TILE_POINTS, SILHOUETTE_POINTS)
    )
    steps = _matching(np.roll(tile, -first, axis=0), np.roll(goal, -start, axis=0))
    even = np.linspace(0, SILHOUETTE_POINTS, TILE_POINTS + 1)
    places = (1 - EVEN_SHARE) * steps + EVEN_SHARE * even
    # what matches: how far round the polygon, in vertices, and how far round the silhouette
    knots, lengths = arc_lengths(ring), arc_lengths(rest)
    turns, numbers = np.arange(TILE_POINTS + 1), np.arange(len(knots))

    def outline(mesh: SilhouetteMesh) -> Array:
        turn: Array = np.interp(shares(mesh), numbers, knots) / knots[-1] * TILE_POINTS
        place: Array = np.interp((turn - first) % TILE_POINTS, turns, places) + start
        return points_along(rest, place / SILHOUETTE_POINTS * lengths[-1])

    moved = mesh.points + harmonic(mesh, outline(mesh) - mesh.points[: len(shares(mesh))])
    try:
        moved = unfolded(mesh, moved)
    except OrbiflowError as error:
        raise OrbiflowError(
            "the silhouette cannot be carried to this tile without folds: they differ too much"
        ) from error
    place: Array = (lengths / lengths[-1] * SILHOUETTE_POINTS - start) % SILHOUETTE_POINTS
    turn = np.interp(place, places, turns)
    along: Array = (turn + first) % TILE_POINTS / TILE_POINTS * knots[-1]
    at = np.interp(along, knots, numbers)
    mesh, moved = divided(mesh, _unknown(mesh, at), moved)
    return Bending(with_outline(mesh, moved, outline(mesh)), mesh.points, mesh.triangles)


def _matching(tile: Array, goal: Array) -> Array:
    """Return for each point of the tile, and the first again, its point of the silhouette."""
    cost = cdist(tile, np.concatenate([goal, goal[:1]]), "sqeuclidean")
    cost = np.concatenate([cost, cost[:1]])
    pay = UNEVEN_COST * (np.arange(MAX_STEP_POINTS + 1) - SILHOUETTE_POINTS / TILE_POINTS) ** 2
    best = np.full(SILHOUETTE_POINTS + 1, np.inf)
    best[0] = 0.0
    taken = np.zeros((TILE_POINTS + 1, SILHOUETTE_POINTS + 1), dtype=np.int64)
    for i in range(1, TILE_POINTS + 1):
        options = np.full((MAX_STEP_POINTS + 1, SILHOUETTE_POINTS + 1), np.inf)
        for k in range(MAX_STEP_POINTS + 1):
            options[k, k:] = best[: SILHOUETTE_POINTS + 1 - k] + pay[k]
        taken[i] = options.argmin(axis=0)
        best = options.min(axis=0) + cost[i]
    points = np.empty(TILE_POINTS + 1)
    place = SILHOUETTE_POINTS
    for i in range(TILE_POINTS, -1, -1):
        points[i] = place
        place -= taken[i, place]
    return points
