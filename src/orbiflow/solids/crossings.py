"""Which triangles of a surface cross or touch where they should not, decided exactly."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array, Integers

ROUNDING = 2.0**-53
DETERMINANT_ERROR = (7 + 56 * ROUNDING) * ROUNDING
"""Of a determinant of differences, relative to the sum of its terms' sizes: J. R. Shewchuk, Adaptive
precision floating-point arithmetic and fast robust geometric predicates, 1997."""

PAIRS_AT_ONCE = 1_500_000
Vector = tuple[Fraction, ...]
Mask = NDArray[np.bool_]


def crossing_pairs(points: Array, faces: Integers, moved: Mask | None = None) -> Integers:
    """Return the pairs (n, 2) of triangles that meet elsewhere than in the corners they share.

    Triangles that touch are among them, and those that lie on one another. Signs of determinants are
    decided by floating point where its error allows, and by fractions where it does not. So the
    answer is exact for the coordinates as they are, of triangles that have an area.

    Args:
        points: The points (N, 3).
        faces: The corners (M, 3).
        moved: A mask (M,): of each pair at least one triangle is among these. Default: all.
    """
    corners = points[faces]
    pairs = [np.empty((0, 2), np.int64)]
    for first, second in _near_pairs(corners, moved):
        same = faces[first][:, :, None] == faces[second][:, None, :]
        number = same.sum(axis=(1, 2))
        for shared, meets in enumerate((_disjoint_meet, _fans_meet, _hinges_meet)):
            chosen = number == shared
            a, b = _shared_first(corners, first[chosen], second[chosen], same[chosen])
            hit = np.flatnonzero(chosen)[meets(a, b)]
            pairs.append(np.stack([first[hit], second[hit]], axis=1))
        equal = number == 3
        pairs.append(np.stack([first[equal], second[equal]], axis=1))
    return np.concatenate(pairs)


def orientation_signs(a: Array, b: Array, c: Array, d: Array) -> Integers:
    """Return the exact signs (n,) of the determinants of b - a, c - a, d - a.

    It is 1 where a, b, c are counter-clockwise as seen from d, 0 where all are in one plane.
    """
    x, y, z = np.moveaxis(a - d, -1, 0), np.moveaxis(b - d, -1, 0), np.moveaxis(c - d, -1, 0)
    terms = [(x[i], y[j] * z[k], y[k] * z[j]) for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1))]
    value = sum(u * (v - w) for u, v, w in terms)
    size = sum(np.abs(u) * (np.abs(v) + np.abs(w)) for u, v, w in terms)
    # the determinant about d is minus that about a
    signs = -np.sign(value).astype(np.int64)
    unsure = np.flatnonzero(np.abs(value) <= DETERMINANT_ERROR * size)
    for k in unsure:
        rows = [_exact(corner[k]) for corner in (a, b, c, d)]
        signs[k] = _sign(_determinant(*(_less(row, rows[0]) for row in rows[1:])))
    return signs


def _near_pairs(corners: Array, moved: Mask | None) -> Iterator[tuple[Integers, Integers]]:
    """Yield pairs of triangles whose boxes meet, each once, in portions."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    size = 1.5 * np.mean((high - low).max(axis=1)) + 1e-300
    origin = low.min(axis=0)
    while True:
        start = np.floor((low - origin) / size).astype(np.int64)
        counts = np.floor((high - origin) / size).astype(np.int64) - start + 1
        total = counts.prod(axis=1)
        if total.sum() <= 12 * len(corners) + 100_000:
            break
        size *= 1.5
    owner = np.repeat(np.arange(len(corners)), total)
    place = np.arange(len(owner)) - np.repeat(np.cumsum(total) - total, total)
    rest, z = np.divmod(place, counts[owner, 2])
    x, y = np.divmod(rest, counts[owner, 1])
    cells = start[owner] + np.stack([x, y, z], axis=1)
    shape = tuple(cells.max(axis=0, initial=0) + 1)
    keys = np.asarray(np.ravel_multi_index(tuple(cells.T), shape), np.int64)
    order = np.argsort(keys, kind="stable")
    owner, cells, keys = owner[order], cells[order], keys[order]
    # each entry goes with all later ones of its cell
    ends = np.asarray(np.searchsorted(keys, keys, side="right"), np.int64)
    later = ends - np.arange(len(keys)) - 1
    for part in np.array_split(np.arange(len(keys)), later.sum() // PAIRS_AT_ONCE + 1):
        left = np.repeat(part, later[part])
        before = np.cumsum(later[part]) - later[part]
        right = left + 1 + np.arange(len(left)) - np.repeat(before, later[part])
        first, second = owner[left], owner[right]
        if moved is not None:
            some = moved[first] | moved[second]
            left, first, second = left[some], first[some], second[some]
        corner = np.maximum(low[first], low[second])
        meet = np.all(corner <= np.minimum(high[first], high[second]), axis=1)
        # two boxes share many cells; the pair counts in that of their intersection's lowest corner
        home = np.floor((corner - origin) / size).astype(np.int64)
        keep = meet & np.all(home == cells[left], axis=1)
        yield first[keep], second[keep]


def _shared_first(
    corners: Array, first: Integers, second: Integers, same: Array
) -> tuple[Array, Array]:
    """Return the corners of both triangles of each pair, the shared ones first, in like order."""
    mine = np.argsort(~same.any(axis=2), axis=1, kind="stable")
    a = np.take_along_axis(corners[first], mine[:, :, None], axis=1)
    ranked = np.take_along_axis(same, mine[:, :, None], axis=1)
    partner = np.where(ranked.any(axis=1), ranked.argmax(axis=1), 3)
    theirs = np.argsort(partner, axis=1, kind="stable")
    return a, np.take_along_axis(corners[second], theirs[:, :, None], axis=1)


def _hinges_meet(a: Array, b: Array) -> Mask:
    """Return whether pairs with a common edge lie on one another: a plane, and on one side of it."""
    edge = a[:, 1] - a[:, 0]
    mine, other = np.cross(edge, a[:, 2] - a[:, 0]), np.cross(edge, b[:, 2] - a[:, 0])
    dots, sizes = np.einsum("ij,ij->i", mine, other), _norms(mine) * _norms(other)
    meet = dots > -1e-9 * sizes  # the others are folded by less than a right angle
    rest = np.flatnonzero(meet)
    flat = orientation_signs(a[rest, 0], a[rest, 1], a[rest, 2], b[rest, 2]) == 0
    meet[rest[~flat]] = False
    for k in rest[flat]:
        v, w, p, q = (_exact(row) for row in (*a[k], b[k, 2]))
        along = _less(w, v)
        meet[k] = _dot(_cross(along, _less(p, v)), _cross(along, _less(q, v))) > 0
    return meet


def _fans_meet(a: Array, b: Array) -> Mask:
    """Return whether pairs with one common corner, the first, meet elsewhere too."""
    apart = _planes_part(a, b, 1) | _planes_part(b, a, 1)
    meet = np.zeros(len(a), bool)
    rest = np.flatnonzero(~apart)
    rest = rest[~_fans_part(a[rest], b[rest])]
    meet[rest] = _edge_meets(a[rest, 1], a[rest, 2], b[rest]) | _edge_meets(
        b[rest, 1], b[rest, 2], a[rest]
    )
    return meet


def _disjoint_meet(a: Array, b: Array) -> Mask:
    """Return whether pairs without a common corner meet."""
    apart = _planes_part(a, b, 0) | _planes_part(b, a, 0)
    meet = np.zeros(len(a), bool)
    rest = np.flatnonzero(~apart)
    rest = rest[~_edges_part(a[rest], b[rest])]
    for k in range(3):
        meet[rest] |= _edge_meets(a[rest, k], a[rest, k - 1], b[rest])
        meet[rest] |= _edge_meets(b[rest, k], b[rest, k - 1], a[rest])
    return meet


def _planes_part(a: Array, b: Array, shared: int) -> Mask:
    """Return whether all corners of b that are not shared are surely on one side of a's plane."""
    normal = np.cross(a[:, 1] - a[:, 0], a[:, 2] - a[:, 0])
    offsets = b[:, shared:] - a[:, :1]
    heights = np.einsum("nij,nj->ni", offsets, normal)
    error = 1e-14 * _norms(normal)[:, None] * np.abs(offsets).max(axis=2)
    # the normal is rounded as well: relative to the edges, not to itself
    error += (
        1e-14
        * (np.abs(a[:, 1:] - a[:, :1]).max(axis=(1, 2)) ** 2)[:, None]
        * np.abs(offsets).max(axis=2)
    )
    return np.all(heights > error, axis=1) | np.all(heights < -error, axis=1)


def _fans_part(a: Array, b: Array) -> Mask:
    """Return whether a plane through the common corner is found to part all others of two fans."""
    mine, other = a[:, 1:] - a[:, :1], b[:, 1:] - a[:, :1]
    mine = mine / _norms(mine)[..., None]
    other = other / _norms(other)[..., None]
    apart = np.zeros(len(a), bool)
    normal = np.cross(mine[:, 0], mine[:, 1])
    ways = [mine.sum(axis=1) - other.sum(axis=1)]
    ways += [np.cross(normal, mine[:, i] + other[:, j]) for i in (0, 1) for j in (0, 1)]
    for way in ways:
        left, right = (np.einsum("nij,nj->ni", rows, way) for rows in (mine, other))
        for sign in (1, -1):
            apart |= ((sign * left).min(axis=1) > 1e-9) & ((sign * right).max(axis=1) < -1e-9)
    return apart


def _edges_part(a: Array, b: Array) -> Mask:
    """Return whether a plane is found that parts two triangles: along an edge, or along two."""
    middle = a[:, 0]
    size = np.abs(np.concatenate([a, b], axis=1) - middle[:, None]).max(axis=(1, 2))
    p, q = ((rows - middle[:, None]) / size[:, None, None] for rows in (a, b))
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    edges = [[rows[:, k] - rows[:, k - 1] for k in range(3)] for rows in (p, q)]
    ways = [np.cross(e, f) for e, f in itertools.product(*edges)]
    ways += [np.cross(normal, e) for e in (*edges[0], *edges[1])]
    apart = np.zeros(len(a), bool)
    for way in ways:
        left, right = (np.einsum("nij,nj->ni", rows, way) for rows in (p, q))
        gap = np.maximum(left.min(axis=1) - right.max(axis=1), right.min(axis=1) - left.max(axis=1))
        apart |= gap > 1e-12
    return apart


def _edge_meets(p: Array, q: Array, triangle: Array) -> Mask:
    """Return whether edges from p to q (n, 3) meet closed triangles (n, 3, 3)."""
    a, b, c = np.moveaxis(triangle, 1, 0)
    start, end = orientation_signs(a, b, c, p), orientation_signs(a, b, c, q)
    meet = np.zeros(len(p), bool)
    rest = np.flatnonzero((start * end <= 0) & ((start != 0) | (end != 0)))
    sides = np.stack(
        [orientation_signs(p[rest], q[rest], u[rest], v[rest]) for u, v in ((a, b), (b, c), (c, a))]
    )
    meet[rest] = np.all(sides >= 0, axis=0) | np.all(sides <= 0, axis=0)
    for k in np.flatnonzero((start == 0) & (end == 0)):
        meet[k] = _meets_in_plane(_exact(p[k]), _exact(q[k]), [_exact(row) for row in triangle[k]])
    return meet


def _meets_in_plane(p: Vector, q: Vector, triangle: list[Vector]) -> bool:
    """Return whether an edge meets a closed triangle, all in one plane."""
    a, b, c = triangle
    normal = _cross(_less(b, a), _less(c, a))
    drop = max(range(3), key=lambda k: abs(normal[k]))
    flat = [tuple(x for k, x in enumerate(row) if k != drop) for row in (p, q, a, b, c)]
    start, end, *ring = flat

    def side(u: Vector, v: Vector, w: Vector) -> int:
        return _sign((v[0] - u[0]) * (w[1] - u[1]) - (v[1] - u[1]) * (w[0] - u[0]))

    # two convex sets in the plane are apart if, and only if, the line of an edge parts them
    turn = side(*ring)
    for k in range(3):
        if all(side(ring[k - 1], ring[k], point) * turn < 0 for point in (start, end)):
            return False
    sides = [side(start, end, point) for point in ring]
    return not (all(sign > 0 for sign in sides) or all(sign < 0 for sign in sides))


def _norms(vectors: Array) -> Array:
    return np.maximum(np.linalg.norm(vectors, axis=-1), 1e-300)


def _exact(point: Array) -> Vector:
    return tuple(Fraction(float(x)) for x in point)


def _less(a: Vector, b: Vector) -> Vector:
    return tuple(x - y for x, y in zip(a, b, strict=True))


def _cross(a: Vector, b: Vector) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _dot(a: Vector, b: Vector) -> Fraction:
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))


def _determinant(a: Vector, b: Vector, c: Vector) -> Fraction:
    return _dot(a, _cross(b, c))


def _sign(value: Fraction) -> int:
    return (value > 0) - (value < 0)
