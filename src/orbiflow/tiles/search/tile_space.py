"""Placements of a tile's corners along an outline, and the tiles of a class for each, at once.

An outline of n points is laid out along the template's edges: edge e gets `lengths[e]` steps, the
first corner sits at point `start`. The differences of a tile's boundary agree, up to the isometry,
on identified edges; a placement's gain is how far those of the outline already do. This is the
adjacent-difference distance of Nagata and Imahori (An Efficient Exhaustive Search Algorithm for the
Escherization Problem, Algorithmica 2020) without its closing condition: all placements at once,
from tables of sums along the outline. It ranks; `nearest_tiles` is exact.

With the corners placed and the glide axes' turn given, a vertex of a tile is free, or the image of
a free one, or fixed by the group; images and fixed points depend linearly on the group's position
and lattice. So the tiles of a class with n vertices form a real linear space (the idea of EST:
Koizumi and Sugihara, Maximum Eigenvalue Problem for Escherization, 2011; Nagata and Imahori, 2020).
Points are complex numbers x + iy throughout.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array, Complex, Integers
from orbiflow.symmetry import Isometry
from orbiflow.tiles.tilings import IsohedralClass

# Beyond this many, lengths and starts run in steps of more than one point
MOST_PLACEMENTS = 4_000_000


class Placements(NamedTuple):
    """Ways to lay an outline of n points along the edges of a template, best first."""

    lengths: Integers  # (C, K) steps of each edge, sum n
    starts: Integers  # (C,) point of the outline at the template's first corner
    turns: NDArray[np.float64]  # (C,) radians; turn of the glide axes, 0 without these
    gains: NDArray[np.float64]  # (C,) at most 1, which is an outline that is a tile already

    def take(self, index: Integers) -> Placements:
        """Those at `index`."""
        return self._make(part[index] for part in self)


def best_placements(kind: IsohedralClass, outline: Complex, keep: int) -> Placements:
    """Return the `keep` placements of largest gain; of those that differ by a relabelling, one.

    The outline has n points x + iy, counter-clockwise, evenly spaced; n is at least 4 times the
    number of the template's edges.
    """
    n = len(outline)
    parts = _multiplicities(kind)
    units = (u for u in range(1, n + 1) if n % u == 0)
    most = MOST_PLACEMENTS
    unit = next(u for u in units if u == n or _count(parts, n // u) * (n // u) <= most)
    lengths = edge_lengths(kind, n // unit) * unit
    starts = np.arange(0, n, unit)
    gains, turns = _gains(kind, np.roll(outline, -1) - outline, lengths, starts)
    flat = gains.ravel()
    # relabelled twins have the same gain: ask for more, then drop them
    count = min(8 * keep, flat.size)
    best = np.argpartition(-flat, count - 1)[:count]
    best = best[np.lexsort((best, -flat[best]))]
    fresh = np.diff(np.round(flat[best], 10), prepend=np.inf) != 0
    best = best[fresh][:keep]
    rows, columns = np.unravel_index(best, gains.shape)
    return Placements(lengths[rows], starts[columns], turns.ravel()[best], flat[best])


def _multiplicities(kind: IsohedralClass) -> list[int]:
    return [1 if pair.folded else 2 for pair in kind.identified_edges]


def _count(multiplicities: Sequence[int], total: int) -> int:
    """Number of compositions: a coefficient of the product of x^m / (1 - x^m)."""
    ways = np.zeros(total + 1, dtype=np.int64)
    ways[0] = 1
    for m in multiplicities:
        fresh = np.zeros_like(ways)
        for k in range(m, total + 1):
            fresh[k] = ways[k - m] + fresh[k - m]
        ways = fresh
    return int(ways[total])


def _compositions(multiplicities: Sequence[int], total: int) -> Integers:
    """All (L_1, ..., L_g) >= 1 with sum of m_i L_i = total, as rows."""
    rows = np.zeros((1, 0), dtype=np.int64)
    left = np.array([total])
    for i, m in enumerate(multiplicities[:-1]):
        most = np.maximum((left - sum(multiplicities[i + 1 :])) // m, 0)
        origin = np.repeat(np.arange(len(rows)), most)
        value = np.arange(len(origin)) - np.repeat(np.cumsum(most) - most, most) + 1
        rows = np.column_stack([rows[origin], value])
        left = left[origin] - m * value
    last = multiplicities[-1]
    fits = (left > 0) & (left % last == 0)
    return np.column_stack([rows[fits], left[fits] // last])


def edge_lengths(kind: IsohedralClass, total: int) -> Integers:
    """All (C, K) lengths of the template's edges with sum `total`, equal on identified edges."""
    pairs = kind.identified_edges
    parts = _compositions(_multiplicities(kind), total)
    lengths = np.zeros((len(parts), len(kind.template())), dtype=np.int64)
    for column, pair in enumerate(pairs):
        lengths[:, pair.first] = lengths[:, pair.second] = parts[:, column]
    return lengths


def _gains(
    kind: IsohedralClass, steps: Complex, lengths: Integers, starts: Integers
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Gains and turns (C, len(starts)) of all placements."""
    n = len(steps)
    first = np.cumsum(lengths, axis=1) - lengths
    turned, glided = _sums_along(steps)
    gains = np.zeros((len(lengths), len(starts)))
    glides = np.zeros_like(gains, dtype=complex)
    for pair in kind.identified_edges:
        linear = pair.isometry.linear
        factor = complex(linear[0, 0], linear[1, 0])
        length = lengths[:, pair.first][:, None]
        a = (first[:, pair.first][:, None] + starts) % n
        b = (first[:, pair.second][:, None] + starts) % n
        if pair.reversed:  # the mate runs backwards, turned by `factor`
            share = 0.5 if pair.folded else 1.0
            table = -share * (np.conj(factor) * turned).real
            gains += table[length, a, (b + length - 1) % n]
        else:
            glides += np.conj(factor) * glided[length, a, b]
    turns = np.angle(glides) / 2  # the best common turn of all axes
    return (gains + abs(glides)) / (0.5 * (abs(steps) ** 2).sum()), turns


def _sums_along(steps: Complex) -> tuple[Complex, Complex]:
    """[k, a, b]: sum over j < k of conj(s[a+j]) s[b-j], and of s[a+j] s[b+j]."""
    n = len(steps)
    points = np.arange(n)
    crossed, straight = np.conj(steps)[:, None] * steps, steps[:, None] * steps
    turned = np.zeros((n + 1, n, n), dtype=complex)
    glided = np.zeros_like(turned)
    for k in range(n):
        ahead, back = (points + k) % n, (points - k) % n
        turned[k + 1] = turned[k] + crossed[np.ix_(ahead, back)]
        glided[k + 1] = glided[k] + straight[np.ix_(ahead, ahead)]
    return turned, glided


class NearestTiles(NamedTuple):
    """C tiles, each the nearest to an outline under its placement.

    A tile that crosses itself, or whose `linear` reverses orientation, is of no use.
    """

    vertices: Complex  # (C, n) x + iy, vertex i near point `start + i` of the outline
    linear: Array  # with `offset`: (C, 2, 2) and (C, 2), the map from the group's own frame
    offset: Array
    corners: Integers  # (C, K) vertices at the template's corners
    distance: Array  # (C,) sum of squared distances

    def take(self, index: Integers) -> NearestTiles:
        """Those at `index`."""
        return self._make(part[index] for part in self)


class TileSpace:
    """The tiles of C placements of one class, all of n steps."""

    def __init__(self, kind: IsohedralClass, placements: Placements) -> None:
        self.kind, self.placements = kind, placements
        self.count, self.size = len(placements.starts), int(placements.lengths[0].sum())
        self._orbits = _Orbits(kind, placements.lengths)
        self.corners = self._orbits.corners  # (C, K) vertices at the template's corners
        # (C, n) the outline's point at each vertex
        self.order = (np.arange(self.size) + placements.starts[:, None]) % self.size
        self._place = np.argsort(self.order, axis=1)
        flat = self._orbits.source + np.arange(self.count)[:, None] * self.size
        self._flat = flat.ravel()
        self._total = np.maximum(np.bincount(self._flat, minlength=flat.size), 1).astype(float)
        self.turn(placements.turns)

    @property
    def glides(self) -> bool:
        """Whether the class has glide reflections, whose axes can be turned."""
        return any(not pair.reversed for pair in self.kind.identified_edges)

    def turn(self, turns: Array) -> None:
        """Set the directions (C,) of the glide axes, in radians; no effect without glides."""
        self.turns = np.asarray(turns, dtype=np.float64)
        unit, orbits = np.exp(1j * self.turns)[:, None], self._orbits
        # the group's linear parts in the placed frame
        self._factor: Complex = np.where(orbits.flips, orbits.factor * unit**2, orbits.factor)
        self._columns = _columns(self.kind, orbits, self._factor, unit)
        pulled = _unturn(self._factor, orbits.flips, self._columns)
        self._means = self._orbit_means(pulled)
        self._basis = self._residual(pulled, self._means)
        adjoint = np.swapaxes(np.conj(self._basis), 1, 2)
        matrix = np.real(adjoint @ self._basis)
        # IH1 does not care about the offset: the least solution
        size = matrix.shape[-1]
        ridge = 1e-10 * np.trace(matrix, axis1=1, axis2=2)[:, None, None] * np.eye(size)
        self._solve: Complex = np.linalg.inv(matrix + ridge) @ adjoint

    def best_turns(self, outlines: Complex) -> Array:
        """(C,) directions of the glide axes that suit the outlines (C, n) best; 0 without glides."""
        if not self.glides:
            return self.turns
        glides = [pair for pair in self.kind.identified_edges if not pair.reversed]
        total = np.zeros(self.count, dtype=complex)
        goal = np.take_along_axis(outlines, self.order, axis=1)
        steps = np.roll(goal, -1, axis=1) - goal
        lengths, first = self.placements.lengths, self.corners
        for pair in glides:
            linear = pair.isometry.linear
            own = lengths[:, [pair.first]]
            j = np.arange(int(own.max()))
            a, b = ((first[:, [edge]] + j) % self.size for edge in (pair.first, pair.second))
            both = np.take_along_axis(steps, a, axis=1) * np.take_along_axis(steps, b, axis=1)
            total += complex(linear[0, 0], -linear[1, 0]) * np.where(j < own, both, 0).sum(axis=1)
        return np.angle(total) / 2

    def nearest(self, outlines: Complex) -> NearestTiles:
        """The tile of each placement that is nearest to its own outline (C, n)."""
        orbits = self._orbits
        goal = np.take_along_axis(outlines, self.order, axis=1)[..., None]
        pulled = _unturn(self._factor, orbits.flips, goal)
        means = self._orbit_means(pulled)
        rest = self._residual(pulled, means)
        solution: Array = np.real(self._solve @ rest)[..., 0]
        left = rest[..., 0] - (self._basis @ solution[..., None])[..., 0]
        free = means[..., 0] - (self._means @ solution[..., None])[..., 0]
        image = _turn(self._factor, orbits.flips, np.take_along_axis(free, orbits.source, axis=1))
        moved = (self._columns @ solution[..., None])[..., 0]
        vertices = np.where(orbits.fixed, 0, image) + moved
        return NearestTiles(
            vertices,
            _linear(self.kind, solution[:, 2:], self.turns),
            solution[:, :2],
            self.corners,
            (abs(left) ** 2).sum(axis=1),
        )

    def in_order(self, vertices: Complex) -> Complex:
        """Vertices (C, n), as of tiles, in the order of the outline's points."""
        return np.take_along_axis(vertices, self._place, axis=1)

    def matrices(self, index: int) -> tuple[Array, Array]:
        """Real and imaginary part, (n, d) each, of the map from parameters (d,) to one tile.

        Rows are in the order of the outline; `group` reads the last columns, offset and lattice.
        """
        orbits, n = self._orbits, self.size
        source, fixed = orbits.source[index], orbits.fixed[index]
        free = np.flatnonzero((source == np.arange(n)) & ~fixed)
        position = np.zeros(n, dtype=np.int64)
        position[free] = np.arange(len(free))
        columns = self._columns[index]
        real = np.zeros((n, 2 * len(free) + columns.shape[1]))
        imaginary = np.zeros_like(real)
        v = np.flatnonzero(~fixed)
        at, factor = 2 * position[source[v]], self._factor[index, v]
        sign = np.where(orbits.flips[index, v], -1.0, 1.0)
        real[v, at], real[v, at + 1] = factor.real, -factor.imag * sign
        imaginary[v, at], imaginary[v, at + 1] = factor.imag, factor.real * sign
        real[:, 2 * len(free) :], imaginary[:, 2 * len(free) :] = columns.real, columns.imag
        return real[self._place[index]], imaginary[self._place[index]]

    def group(self, index: int, parameters: Array) -> tuple[Array, Array]:
        """Linear part (2, 2) and offset (2,) of the map from the group's frame, from `matrices`."""
        own = parameters[-self._columns.shape[2] :][None]
        return _linear(self.kind, own[:, 2:], self.turns[[index]])[0], own[0, :2]

    def _residual(self, pulled: Complex, means: Complex) -> Complex:
        """Take out what the free vertices can do."""
        at_source = np.take_along_axis(means, self._orbits.source[..., None], axis=1)
        return np.where(self._orbits.fixed[..., None], pulled, pulled - at_source)

    def _orbit_means(self, values: Complex) -> Complex:
        """Means of values (C, n, m) over each orbit, at its free vertex."""
        count, n, m = values.shape
        means: Complex = np.empty((count * n, m), dtype=complex)
        for column in range(m):
            part = values[..., column].ravel()
            for own, sums in ((part.real, means.real), (part.imag, means.imag)):
                sums[:, column] = np.bincount(self._flat, own, minlength=count * n) / self._total
        return means.reshape(count, n, m)


class _Element(NamedTuple):
    """z -> factor z + shift, or factor conj(z) + shift."""

    factor: complex
    flips: bool
    shift: complex

    @classmethod
    def of(cls, isometry: Isometry) -> _Element:
        linear = isometry.linear
        return cls(
            complex(linear[0, 0], linear[1, 0]),
            bool(np.linalg.det(linear) < 0),
            complex(*isometry.translation),
        )


@lru_cache(maxsize=16)
def _layout(kind: IsohedralClass) -> tuple[tuple[_Element, ...], tuple[tuple[int, _Element], ...]]:
    """The elements of edge pairs; of each corner its orbit's first corner (-1: fixed), and how."""
    group, vertices = kind.group(), kind.template()
    corners: list[tuple[int, _Element]] = []
    for k, vertex in enumerate(vertices):
        if len(list(group.elements_near(vertex, 1e-6, source=vertex))) > 1:
            corners.append((-1, _Element(1, False, complex(*vertex))))
            continue
        for first in range(k + 1):
            images = list(group.elements_near(vertex, 1e-6, source=vertices[first]))
            if images:
                corners.append((first, _Element.of(images[0])))
                break
    edges = tuple(_Element.of(pair.isometry) for pair in kind.identified_edges)
    return edges, tuple(corners)


class _Orbits:
    """For each vertex: the free vertex that it is an image of, and by which element; or fixed."""

    def __init__(self, kind: IsohedralClass, lengths: Integers) -> None:
        count, n = len(lengths), int(lengths[0].sum())
        edges, corners = _layout(kind)
        self.corners = np.cumsum(lengths, axis=1) - lengths
        self.source = np.tile(np.arange(n), (count, 1))
        self.factor = np.ones((count, n), dtype=complex)
        self.flips = np.zeros((count, n), dtype=bool)
        self.shift = np.zeros((count, n), dtype=complex)
        self.fixed = np.zeros((count, n), dtype=bool)
        vertices = kind.template() @ [1, 1j]
        for pair, element in zip(kind.identified_edges, edges, strict=True):
            middle = (vertices[pair.first] + vertices[(pair.first + 1) % len(vertices)]) / 2
            own = self.corners[:, [pair.first]]
            other = self.corners[:, [pair.second]]
            length = lengths[:, [pair.first]]
            j = np.arange(1, int(length.max(initial=1)))
            if pair.folded:
                self._map((j < length) & (2 * j > length), own + j, own + length - j, element)
                rows = np.flatnonzero(length[:, 0] % 2 == 0)
                self._fix(rows, (own + length // 2)[rows, 0], middle)
            else:
                mate = other + (length - j if pair.reversed else j)
                self._map(j < length, mate, own + j, element)
        rows = np.arange(count)
        for k, (first, element) in enumerate(corners):
            if first < 0:
                self._fix(rows, self.corners[:, k], element.shift)
            else:
                live = np.ones((count, 1), dtype=bool)
                self._map(live, self.corners[:, [k]], self.corners[:, [first]], element)

    def _map(self, live: NDArray[np.bool_], vertex: Array, source: Array, by: _Element) -> None:
        rows, columns = np.nonzero(live)
        at = rows, np.broadcast_to(vertex, live.shape)[rows, columns]
        self.source[at] = np.broadcast_to(source, live.shape)[rows, columns]
        self.factor[at], self.flips[at], self.shift[at] = by

    def _fix(self, rows: Integers, vertex: Integers, where: complex) -> None:
        self.fixed[rows, vertex] = True
        self.shift[rows, vertex] = where


def _columns(kind: IsohedralClass, orbits: _Orbits, factor: Complex, turn: Complex) -> Complex:
    """(C, n, 2 + m): how offset and linear part move each vertex, its free vertex held."""
    shift, one = orbits.shift, np.ones_like(factor)
    columns = [
        np.where(orbits.fixed, z * one, z * one - _turn(factor, orbits.flips, z * one))
        for z in (1, 1j)
    ]
    match kind.stretch_dim:
        case 2:
            columns += [shift, 1j * shift, np.conj(shift), 1j * np.conj(shift)]
        case 1:  # along the glides, which are the axes of the group's own frame
            columns += [turn * np.real(shift), 1j * turn * np.imag(shift)]
        case _:
            columns += [shift, 1j * shift]
    return np.stack(columns, axis=-1)


def _linear(kind: IsohedralClass, solution: Array, turns: Array) -> Array:
    """(C, 2, 2) from the coefficients of `_columns`."""
    cos, sin = np.cos(turns), np.sin(turns)
    match kind.stretch_dim:
        case 2:
            a, b, c, d = solution.T
            rows = [a + c, d - b, b + d, a - c]
        case 1:  # along the glides, which are the axes of the group's own frame
            p, q = solution.T
            rows = [cos * p, -sin * q, sin * p, cos * q]
        case _:
            a, b = solution.T
            rows = [a, -b, b, a]
    return np.stack(rows, axis=-1).reshape(-1, 2, 2)


def _turn(factor: Complex, flips: NDArray[np.bool_], z: Complex) -> Complex:
    return factor * np.where(flips, np.conj(z), z)


def _unturn(factor: Complex, flips: NDArray[np.bool_], z: Complex) -> Complex:
    """The inverse of `_turn` on (C, n, m)."""
    return np.where(
        flips[..., None], factor[..., None] * np.conj(z), np.conj(factor)[..., None] * z
    )


CHUNK = 4000  # placements worked on at a time: bounds the memory at some hundred MB


def nearest_tiles(kind: IsohedralClass, outline: Complex, placements: Placements) -> NearestTiles:
    """Project an outline (n,), counter-clockwise, onto the tiles of a class for every placement."""
    found: list[NearestTiles] = []
    pieces = max(1, -(-len(placements.starts) // CHUNK))
    for index in np.array_split(np.arange(len(placements.starts)), pieces):
        space = TileSpace(kind, placements.take(index))
        found.append(space.nearest(np.broadcast_to(outline, (space.count, len(outline)))))
    return NearestTiles(*(np.concatenate(parts) for parts in zip(*found, strict=True)))
