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
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array, Complex, Integers
from orbiflow.tiles.search.tile_orbits import Orbits, relations_of
from orbiflow.tiles.tilings import IsohedralClass

# Beyond this many, lengths and starts run in steps of more than one point
MAX_PLACEMENTS = 4_000_000


class Placements(NamedTuple):
    """Ways to lay an outline of n points along the edges of a template, best first."""

    lengths: Integers  # (C, K) steps of each edge, sum n
    starts: Integers  # (C,) point of the outline at the template's first corner
    turns: NDArray[np.float64]  # (C,) radians; turn of the glide axes, 0 without these
    gains: NDArray[np.float64]  # (C,) at most 1, which is an outline that is a tile already

    def take(self, index: Integers) -> Placements:
        """Return those at `index`."""
        return self._make(part[index] for part in self)


def best_placements(kind: IsohedralClass, outline: Complex, keep: int) -> Placements:
    """Return the `keep` placements of largest gain; of those that differ by a relabelling, one.

    The outline has n points x + iy, counter-clockwise, evenly spaced; n is at least 4 times the
    number of the template's edges.
    """
    n = len(outline)
    parts = _multiplicities(kind)
    units = (u for u in range(1, n + 1) if n % u == 0)
    most = MAX_PLACEMENTS
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
    return [len(own.edges) for own in kind.edge_classes]


def _count(multiplicities: Sequence[int], total: int) -> int:
    """Return the number of compositions: a coefficient of the product of x^m / (1 - x^m)."""
    ways = np.zeros(total + 1, dtype=np.int64)
    ways[0] = 1
    for m in multiplicities:
        fresh = np.zeros_like(ways)
        for k in range(m, total + 1):
            fresh[k] = ways[k - m] + fresh[k - m]
        ways = fresh
    return int(ways[total])


def _compositions(multiplicities: Sequence[int], total: int) -> Integers:
    """Return all (L_1, ..., L_g) >= 1 with sum of m_i L_i = total, as rows."""
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
    """Return all (C, K) lengths of the template's edges with sum `total`, equal on identified edges."""
    parts = _compositions(_multiplicities(kind), total)
    lengths = np.zeros((len(parts), len(kind.template())), dtype=np.int64)
    for column, own in enumerate(kind.edge_classes):
        lengths[:, own.edges] = parts[:, [column]]
    return lengths


def _gains(
    kind: IsohedralClass, steps: Complex, lengths: Integers, starts: Integers
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return gains and turns (C, len(starts)) of all placements."""
    n = len(steps)
    first = np.cumsum(lengths, axis=1) - lengths
    relations = relations_of(kind)
    tables = {key: _sums_along(steps, *key) for key in {own[3:5] for own in relations}}
    gains = np.zeros((len(lengths), len(starts)))
    glides = np.zeros_like(gains, dtype=complex)
    for edge, mate, factor, flips, back, weight in relations:
        length = lengths[:, edge][:, None]
        a = (first[:, edge][:, None] + starts) % n
        b = (first[:, mate][:, None] + starts) % n
        # a mate that runs backwards has the opposite steps
        share, b = (-weight, (b + length - 1) % n) if back else (weight, b)
        table = share * (np.conj(factor) * tables[flips, back])
        if flips:
            glides += table[length, a, b]
        else:
            gains += table.real[length, a, b]
    turns = np.angle(glides) / 2  # the best common turn of all axes
    return (gains + abs(glides)) / (0.5 * (abs(steps) ** 2).sum()), turns


def _sums_along(steps: Complex, flips: bool, back: bool) -> Complex:
    """Return sums [k, a, b] over j < k of conj(s[a+j]) s[b+j]; s[a+j] if it flips, s[b-j] if back."""
    n = len(steps)
    points = np.arange(n)
    products = (steps if flips else np.conj(steps))[:, None] * steps
    sums = np.zeros((n + 1, n, n), dtype=complex)
    for k in range(n):
        sums[k + 1] = (
            sums[k] + products[np.ix_((points + k) % n, (points + (-k if back else k)) % n)]
        )
    return sums


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
        """Return those at `index`."""
        return self._make(part[index] for part in self)


class _Fit(NamedTuple):
    """How offset and linear part move vertices, orbits' means and residuals; the solution's matrix."""

    columns: Complex
    means: Complex
    basis: Complex
    solve: Complex


class TileSpace:
    """The tiles of C placements of one class, all of n steps."""

    def __init__(self, kind: IsohedralClass, placements: Placements) -> None:
        self.kind, self.placements = kind, placements
        self.count, self.size = len(placements.starts), int(placements.lengths[0].sum())
        self._orbits = Orbits(kind, placements.lengths)
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
        """Whether the class has mirrors or glide reflections, whose axes can be turned."""
        return any(relation.flips for relation in relations_of(self.kind))

    def turn(self, turns: Array) -> None:
        """Set the directions (C,) of the glide axes, in radians; no effect without glides."""
        self.turns = np.asarray(turns, dtype=np.float64)
        unit, orbits = np.exp(1j * self.turns)[:, None], self._orbits
        # the group's linear parts in the placed frame
        self._factor: Complex = np.where(orbits.flips, orbits.factor * unit**2, orbits.factor)
        self._mirror: Complex = orbits.mirror * unit**2
        self.__dict__.pop("_fit", None)

    @cached_property
    def _fit(self) -> _Fit:
        """What a least squares fit needs: made when it is first asked for, as turns may change."""
        unit, orbits = np.exp(1j * self.turns)[:, None], self._orbits
        columns = _columns(self.kind, orbits, self._factor, self._mirror, unit)
        pulled = _unturn(self._factor, orbits.flips, columns)
        means = self._orbit_means(pulled)
        basis = self._residual(pulled, means)
        adjoint = np.swapaxes(np.conj(basis), 1, 2)
        matrix = np.real(adjoint @ basis)
        # IH1 does not care about the offset: the least solution
        size = matrix.shape[-1]
        ridge = 1e-10 * np.trace(matrix, axis1=1, axis2=2)[:, None, None] * np.eye(size)
        return _Fit(columns, means, basis, np.linalg.inv(matrix + ridge) @ adjoint)

    def best_turns(self, outlines: Complex) -> Array:
        """Return directions (C,) of the glide axes that suit outlines (C, n) best; 0 without glides."""
        if not self.glides:
            return self.turns
        total = np.zeros(self.count, dtype=complex)
        goal = np.take_along_axis(outlines, self.order, axis=1)
        steps = np.roll(goal, -1, axis=1) - goal
        lengths, first = self.placements.lengths, self.corners
        for edge, mate, factor, flips, back, weight in relations_of(self.kind):
            if not flips:
                continue
            own = lengths[:, [edge]]
            j = np.arange(int(own.max()))
            a, b = first[:, [edge]] + j, first[:, [mate]] + (own - 1 - j if back else j)
            both = np.take_along_axis(steps, a % self.size, axis=1)
            both = both * np.take_along_axis(steps, b % self.size, axis=1)
            share = -weight if back else weight
            total += share * np.conj(factor) * np.where(j < own, both, 0).sum(axis=1)
        return np.angle(total) / 2

    def nearest(self, outlines: Complex) -> NearestTiles:
        """Return the tile of each placement that is nearest to its own outline (C, n)."""
        orbits, (columns, images, *_) = self._orbits, self._fit
        means, solution, left = self._fitted(outlines)
        free = means[..., 0] - (images @ solution[..., None])[..., 0]
        image = _turn(self._factor, orbits.flips, np.take_along_axis(free, orbits.source, axis=1))
        moved = (columns @ solution[..., None])[..., 0]
        vertices = np.where(orbits.fixed, 0, image) + moved
        return NearestTiles(
            vertices,
            _linear(self.kind, solution[:, 2:], self.turns),
            solution[:, :2],
            self.corners,
            (abs(left) ** 2).sum(axis=1),
        )

    def distances(self, outlines: Complex) -> Array:
        """Return `distance` (C,) of the nearest tiles."""
        return (abs(self._fitted(outlines)[2]) ** 2).sum(axis=1)

    def _fitted(self, outlines: Complex) -> tuple[Complex, Array, Complex]:
        """Return orbits' means, parameters (C, m) of the nearest tile, and the outline's residual."""
        goal = np.take_along_axis(outlines, self.order, axis=1)[..., None]
        pulled = _unturn(self._factor, self._orbits.flips, goal)
        means = self._orbit_means(pulled)
        rest = self._residual(pulled, means)
        solution: Array = np.real(self._fit.solve @ rest)[..., 0]
        return means, solution, rest[..., 0] - (self._fit.basis @ solution[..., None])[..., 0]

    def in_order(self, vertices: Complex) -> Complex:
        """Return vertices (C, n), as of tiles, in the order of the outline's points."""
        return np.take_along_axis(vertices, self._place, axis=1)

    def matrices(self, index: int) -> tuple[Array, Array]:
        """Return real and imaginary part, (n, d) each, of the map from parameters (d,) to one tile.

        Rows are in the order of the outline; `group` reads the last columns, offset and lattice.
        """
        orbits, n = self._orbits, self.size
        source, fixed = orbits.source[index], orbits.fixed[index]
        mirror = self._mirror[index]
        free = np.flatnonzero((source == np.arange(n)) & ~fixed)
        position = np.zeros(n, dtype=np.int64)
        width = np.where(mirror[free] == 0, 2, 1)
        position[free] = np.cumsum(width) - width
        columns, count = self._fit.columns[index], int(width.sum())
        whole: Complex = np.zeros((n, count + columns.shape[1]), dtype=complex)
        v = np.flatnonzero(~fixed)
        factor, flips, on_line = self._factor[index, v], orbits.flips[index, v], mirror[v] != 0
        along = np.where(on_line, np.sqrt(mirror[v]), 1.0)
        whole[v, position[source[v]]] = _turn(factor, flips, along)
        across = _turn(factor, flips, np.full(len(v), 1j))
        whole[v[~on_line], position[source[v]][~on_line] + 1] = across[~on_line]
        whole[:, count:] = columns
        real: Array = whole.real
        imaginary: Array = whole.imag
        return real[self._place[index]], imaginary[self._place[index]]

    def group(self, index: int, parameters: Array) -> tuple[Array, Array]:
        """Return linear part (2, 2) and offset (2,) of the map from the group's frame."""
        own = parameters[-self._fit.columns.shape[2] :][None]
        return _linear(self.kind, own[:, 2:], self.turns[[index]])[0], own[0, :2]

    def _residual(self, pulled: Complex, means: Complex) -> Complex:
        """Take out what the free vertices can do."""
        at_source = np.take_along_axis(means, self._orbits.source[..., None], axis=1)
        return np.where(self._orbits.fixed[..., None], pulled, pulled - at_source)

    def _orbit_means(self, values: Complex) -> Complex:
        """Return means of values (C, n, m) over each orbit, at its free vertex."""
        count, n, m = values.shape
        means: Complex = np.empty((count * n, m), dtype=complex)
        for column in range(m):
            part = values[..., column].ravel()
            for own, sums in ((part.real, means.real), (part.imag, means.imag)):
                sums[:, column] = np.bincount(self._flat, own, minlength=count * n) / self._total
        means = means.reshape(count, n, m)
        if self._orbits.has_lines:
            mirror = self._mirror[..., None]
            means = np.where(mirror == 0, means, (means + mirror * np.conj(means)) / 2)
        return means


def _columns(
    kind: IsohedralClass, orbits: Orbits, factor: Complex, mirror: Complex, turn: Complex
) -> Complex:
    """Return (C, n, 2 + m): how offset and linear part move each vertex, its free vertex held."""
    one = np.ones_like(factor)
    offsets = [z * one for z in (1, 1j)]
    columns = [
        np.where(orbits.fixed, z, z - _turn(factor, orbits.flips, z)) for z in offsets
    ] + _along_lattice(kind, orbits.shift, turn)
    if orbits.has_lines:  # a mirror takes its vertices along
        held = offsets + _along_lattice(kind, orbits.foot, turn)
        for column, z in zip(columns, held, strict=True):
            across = np.where(mirror == 0, 0, (z - mirror * np.conj(z)) / 2)
            column += _turn(factor, orbits.flips, across)
    return np.stack(columns, axis=-1)


def _along_lattice(kind: IsohedralClass, z: Complex, turn: Complex) -> list[Complex]:
    """Return how the coefficients of the linear part move points (C, n) of the group's own frame."""
    match kind.stretch_dim, kind.has_reflections:
        case 2, _:
            return [z, 1j * z, np.conj(z), 1j * np.conj(z)]
        case 1, _:  # along the glides, which are the axes of the group's own frame
            return [turn * np.real(z), 1j * turn * np.imag(z)]
        case _, True:
            return [turn * z]
        case _:
            return [z, 1j * z]


def _linear(kind: IsohedralClass, solution: Array, turns: Array) -> Array:
    """Return (C, 2, 2) from the coefficients of `_along_lattice`."""
    cos, sin = np.cos(turns), np.sin(turns)
    match kind.stretch_dim, kind.has_reflections:
        case 2, _:
            a, b, c, d = solution.T
            rows = [a + c, d - b, b + d, a - c]
        case 1, _:  # along the glides, which are the axes of the group's own frame
            p, q = solution.T
            rows = [cos * p, -sin * q, sin * p, cos * q]
        case _, True:
            (p,) = solution.T
            rows = [cos * p, -sin * p, sin * p, cos * p]
        case _:
            a, b = solution.T
            rows = [a, -b, b, a]
    return np.stack(rows, axis=-1).reshape(-1, 2, 2)


def _turn(factor: Complex, flips: NDArray[np.bool_], z: Complex) -> Complex:
    return factor * np.where(flips, np.conj(z), z)


def _unturn(factor: Complex, flips: NDArray[np.bool_], z: Complex) -> Complex:
    """Return the inverse of `_turn` on (C, n, m)."""
    return np.where(
        flips[..., None], factor[..., None] * np.conj(z), np.conj(factor)[..., None] * z
    )
