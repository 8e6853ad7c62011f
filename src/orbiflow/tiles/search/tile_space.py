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

import threading
from collections.abc import Sequence
from functools import lru_cache
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

    def take(self, index: Integers) -> Placements:
        """Return those at `index`."""
        return self._make(part[index] for part in self)

    @classmethod
    def joined(cls, several: Sequence[Placements]) -> Placements:
        """Return all of them in one."""
        return cls(*map(np.concatenate, zip(*several, strict=True)))


def best_placements(kind: IsohedralClass, outline: Complex, keep: int) -> Placements:
    """Return the `keep` placements of largest gain; of those that differ by a relabelling, one.

    The outline has n points x + iy, counter-clockwise, evenly spaced; n is at least 4 times the
    number of the template's edges.
    """
    return _best_placements(kind, np.ascontiguousarray(outline).tobytes(), keep)


@lru_cache(maxsize=8)  # bodies of the same outline ask one after another
def _best_placements(kind: IsohedralClass, points: bytes, keep: int) -> Placements:
    outline = np.frombuffer(points, dtype=complex)
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
    return Placements(lengths[rows], starts[columns], turns.ravel()[best])


def _multiplicities(kind: IsohedralClass) -> list[int]:
    return [len(edge_class.edges) for edge_class in kind.edge_classes]


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
    for column, edge_class in enumerate(kind.edge_classes):
        lengths[:, edge_class.edges] = parts[:, [column]]
    return lengths


def _gains(
    kind: IsohedralClass, steps: Complex, lengths: Integers, starts: Integers
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return gains and turns (C, len(starts)) of all placements."""
    n = len(steps)
    first = np.cumsum(lengths, axis=1) - lengths
    relations = relations_of(kind)
    tables = {key: _sums_along(steps, *key) for key in {relation[3:5] for relation in relations}}
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


class TileSpace:
    """The tiles of C placements of one class, all of n steps."""

    def __init__(self, kind: IsohedralClass, placements: Placements) -> None:
        self.kind, self.placements = kind, placements
        self.count, self.size = len(placements.starts), int(placements.lengths[0].sum())
        self._rows = table_of(kind, self.size).rows(placements.lengths)
        # (C, K) vertices at the template's corners
        self.corners = np.cumsum(placements.lengths, axis=1) - placements.lengths
        # (C, n) the outline's point at each vertex
        self.order = (np.arange(self.size) + placements.starts[:, None]) % self.size
        self.turn(placements.turns)

    @property
    def glides(self) -> bool:
        """Whether the class has mirrors or glide reflections, whose axes can be turned."""
        return any(relation.flips for relation in relations_of(self.kind))

    def turn(self, turns: Array) -> None:
        """Set the directions (C,) of the glide axes, in radians; no effect without glides."""
        self.turns = np.asarray(turns, dtype=np.float64)
        # outlines are turned back instead of the group, so that tables serve all directions
        self._unit: Complex = np.exp(1j * self.turns * self.glides)

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
            length = lengths[:, [edge]]
            j = np.arange(int(length.max()))
            a, b = first[:, [edge]] + j, first[:, [mate]] + (length - 1 - j if back else j)
            both = np.take_along_axis(steps, a % self.size, axis=1)
            both = both * np.take_along_axis(steps, b % self.size, axis=1)
            share = -weight if back else weight
            total += share * np.conj(factor) * np.where(j < length, both, 0).sum(axis=1)
        return np.angle(total) / 2

    def nearest(self, outlines: Complex) -> NearestTiles:
        """Return the tile of each placement that is nearest to its own outline (C, n)."""
        rows = self._rows
        at_source, rest, along = self._fitted(outlines)
        left = rest - (rows.along.swapaxes(1, 2) @ along[..., None])[..., 0]
        solution = (rows.root @ along[..., None])[..., 0]
        moved = (rows.moved @ solution[..., None])[..., 0].view(complex)
        vertices = np.where(rows.fixed, 0, _turn(rows.factor, rows.flips, at_source)) + moved
        return NearestTiles(
            vertices * self._unit[:, None],
            *self._groups(solution, self._unit),
            self.corners,
            (left**2).sum(axis=1),
        )

    def distances(self, outlines: Complex) -> Array:
        """Return `distance` (C,) of the nearest tiles, as a difference: less exact if it is small."""
        _, rest, along = self._fitted(outlines)
        return (rest**2).sum(axis=1) - (along**2).sum(axis=1)

    def _fitted(self, outlines: Complex) -> tuple[Complex, Array, Array]:
        """Return orbits' means (C, n), what these leave of outlines (C, 2n), and its shares (C, m)."""
        rows = self._rows
        goal = np.take_along_axis(outlines, self.order, axis=1) * np.conj(self._unit)[:, None]
        pulled = _unturn(rows.factor, rows.flips, goal)
        at_source = _means(rows, pulled)
        rest = np.where(rows.fixed, pulled, pulled - at_source)
        flat = rest.view(np.float64)
        return at_source, flat, (rows.along @ flat[..., None])[..., 0]

    def in_order(self, vertices: Complex) -> Complex:
        """Return vertices (C, n), as of tiles, in the order of the outline's points."""
        back = (np.arange(self.size) - self.placements.starts[:, None]) % self.size
        return np.take_along_axis(vertices, back, axis=1)

    def matrices(self, index: int) -> tuple[Array, Array]:
        """Return real and imaginary part, (n, d) each, of the map from parameters (d,) to one tile.

        Rows are in the order of the outline; `group` reads the last columns, offset and lattice.
        """
        rows, n = self._rows, self.size
        source, fixed, mirror = rows.source[index], rows.fixed[index], rows.mirror[index]
        free = np.flatnonzero((source == np.arange(n)) & ~fixed)
        position = np.zeros(n, dtype=np.int64)
        width = np.where(mirror[free] == 0, 2, 1)
        position[free] = np.cumsum(width) - width
        columns, count = rows.columns[index], int(width.sum())
        whole: Complex = np.zeros((n, count + columns.shape[1]), dtype=complex)
        v = np.flatnonzero(~fixed)
        factor, flips, on_line = rows.factor[index, v], rows.flips[index, v], mirror[v] != 0
        along = np.where(on_line, np.sqrt(mirror[v]), 1.0)
        whole[v, position[source[v]]] = _turn(factor, flips, along)
        across = _turn(factor, flips, np.full(len(v), 1j))
        whole[v[~on_line], position[source[v]][~on_line] + 1] = across[~on_line]
        whole[:, count:] = columns
        whole = np.roll(whole * self._unit[index], int(self.placements.starts[index]), axis=0)
        return whole.real, whole.imag

    def group(self, index: int, parameters: Array) -> tuple[Array, Array]:
        """Return linear part (2, 2) and offset (2,) of the map from the group's frame."""
        solution = parameters[-self._rows.columns.shape[2] :]
        linear, offset = self._groups(solution[None], self._unit[[index]])
        return linear[0], offset[0]

    def _groups(self, solution: Array, unit: Complex) -> tuple[Array, Array]:
        """Return linear parts (M, 2, 2) and offsets (M, 2) of maps from the group's frame, turned."""
        cos, sin = unit.real, unit.imag
        turn = np.stack([cos, -sin, sin, cos], axis=-1).reshape(-1, 2, 2)
        offset = (turn @ solution[:, :2, None])[..., 0]
        return turn @ _linear(self.kind, solution[:, 2:]), offset


class EdgeRows(NamedTuple):
    """What the nearest tiles of R lengths of edges are found by, with the glide axes along x.

    A point x + iy is two numbers in `along` and `moved`.
    """

    source: Integers  # with the next four: (R, n), as of `Orbits`
    factor: Complex
    flips: NDArray[np.bool_]
    fixed: NDArray[np.bool_]
    mirror: Complex
    total: Array  # (R, n) how many vertices each vertex is the source of, at least 1
    columns: Complex  # (R, n, m) how offset and linear part move vertices whose free ones are held
    moved: Array  # (R, 2n, m) the same with free vertices where they are nearest
    along: Array  # (R, m, 2n) orthonormal: what an outline's residual is projected by
    root: Array  # (R, m, m) takes what is projected to offset and linear part


def _rows_of(kind: IsohedralClass, lengths: Integers) -> EdgeRows:
    """Work out those of lengths (R, K)."""
    orbits = Orbits(kind, lengths)
    count, n = len(lengths), int(lengths[0].sum())
    flat: Integers = orbits.source + np.arange(count)[:, None] * n
    total = np.maximum(np.bincount(flat.ravel(), minlength=count * n), 1).reshape(count, n)
    columns = _columns(kind, orbits)
    m = int(columns.shape[2])
    none = np.zeros((count, 0))
    orbit_rows = orbits.source, orbits.factor, orbits.flips, orbits.fixed, orbits.mirror
    rows = EdgeRows(*orbit_rows, total.astype(float), columns, none, none, none)
    moved, basis = columns.copy(), columns.copy()
    for k in range(m):
        pulled = _unturn(orbits.factor, orbits.flips, columns[..., k])
        at_source = np.where(orbits.fixed, 0, _means(rows, pulled))
        basis[..., k] = pulled - at_source
        moved[..., k] -= _turn(orbits.factor, orbits.flips, at_source)
    moved = moved.view(np.float64).reshape(count, n, m, 2).swapaxes(2, 3)
    basis = basis.view(np.float64).reshape(count, n, m, 2).transpose(0, 2, 1, 3)
    basis = basis.reshape(count, m, 2 * n)
    matrix: Array = basis @ basis.swapaxes(1, 2)
    # IH1 does not care about the offset: the least solution
    ridge: Array = 1e-10 * np.trace(matrix, axis1=1, axis2=2)[:, None, None] * np.eye(m)
    root: Array = np.linalg.inv(np.linalg.cholesky(matrix + ridge))
    return rows._replace(
        moved=np.ascontiguousarray(moved.reshape(count, 2 * n, m)),
        along=root @ basis,
        root=np.ascontiguousarray(root.swapaxes(1, 2)),
    )


def _means(rows: EdgeRows, values: Complex) -> Complex:
    """Return at each vertex the mean of values (R, n) over its orbit, pulled to its source."""
    count, n = len(values), int(values.shape[1])
    flat: Integers = rows.source + np.arange(count)[:, None] * n
    means: Complex = np.empty(count * n, dtype=complex)
    for part, sums in ((values.real, means.real), (values.imag, means.imag)):
        sums[:] = np.bincount(flat.ravel(), part.ravel(), minlength=count * n)
    middles: Complex = means.reshape(count, n) / rows.total
    if rows.mirror.any():
        middles = np.where(
            rows.mirror == 0, middles, (middles + rows.mirror * np.conj(middles)) / 2
        )
    return np.take_along_axis(middles, rows.source, axis=1)


MAX_TABLE_BYTES = 64 * 2**20  # of the rows that are kept of a class and a number of vertices
MOST_BYTES_PER_VERTEX = 340  # of a row, whose offset and linear part have six parameters at most


class TileTable:
    """The rows of a class's tiles with n vertices, each worked out once: most are asked for often."""

    def __init__(self, kind: IsohedralClass, size: int) -> None:
        self._kind, self._lock = kind, threading.Lock()
        self._most = max(1, MAX_TABLE_BYTES // (MOST_BYTES_PER_VERTEX * size))
        self._places: dict[bytes, int] = {}
        self._kept: EdgeRows | None = None

    def rows(self, lengths: Integers) -> EdgeRows:
        """Return the rows of lengths (C, K); more than are kept are worked out for this call alone."""
        if len(lengths) > self._most:
            return _rows_of(self._kind, lengths)
        lengths = np.ascontiguousarray(lengths, dtype=np.int64)
        keys = [row.tobytes() for row in lengths]
        with self._lock:
            fresh = {key: k for k, key in enumerate(keys) if key not in self._places}
            if fresh:
                if len(self._places) + len(fresh) > self._most:
                    self._places.clear()
                    fresh = {key: k for k, key in enumerate(keys)}
                self._keep(list(fresh), _rows_of(self._kind, lengths[list(fresh.values())]))
            assert self._kept is not None
            at = [self._places[key] for key in keys]
            return EdgeRows._make(part[at] for part in self._kept)

    def _keep(self, keys: list[bytes], made: EdgeRows) -> None:
        """Add rows, in arrays that have twice the room when they are full."""
        first, count = len(self._places), len(self._places) + len(keys)
        if self._kept is None or not first or count > len(self._kept.total):
            room = [
                np.empty((min(2 * count, self._most), *part.shape[1:]), part.dtype) for part in made
            ]
            for old, new in zip(self._kept or (), room, strict=False):
                new[:first] = old[:first]
            self._kept = EdgeRows._make(room)
        for kept, part in zip(self._kept, made, strict=True):
            kept[first:count] = part
        self._places.update(zip(keys, range(first, count), strict=True))


@lru_cache(maxsize=4)  # of the class that is searched: few points, more and all
def table_of(kind: IsohedralClass, size: int) -> TileTable:
    """Return the rows that are known of a class's tiles with so many vertices."""
    return TileTable(kind, size)


def _columns(kind: IsohedralClass, orbits: Orbits) -> Complex:
    """Return (C, n, 2 + m): how offset and linear part move each vertex, its free vertex held."""
    factor, mirror, unit = orbits.factor, orbits.mirror, np.ones_like(orbits.factor)
    offsets = [z * unit for z in (1, 1j)]
    columns = [
        np.where(orbits.fixed, z, z - _turn(factor, orbits.flips, z)) for z in offsets
    ] + _along_lattice(kind, orbits.shift)
    if orbits.has_lines:  # a mirror takes its vertices along
        held = offsets + _along_lattice(kind, orbits.foot)
        for column, z in zip(columns, held, strict=True):
            across = np.where(mirror == 0, 0, (z - mirror * np.conj(z)) / 2)
            column += _turn(factor, orbits.flips, across)
    return np.stack(columns, axis=-1)


def _along_lattice(kind: IsohedralClass, z: Complex) -> list[Complex]:
    """Return how the coefficients of the linear part move points (C, n) of the group's own frame."""
    match kind.stretch_dim, kind.has_reflections:
        case 2, _:
            return [z, 1j * z, np.conj(z), 1j * np.conj(z)]
        case 1, _:  # along the glides, which are the axes of the group's own frame
            return [z.real.astype(np.complex128), (1j * z.imag).astype(np.complex128)]
        case _, True:
            return [z.copy()]
        case _:
            return [z, 1j * z]


def _linear(kind: IsohedralClass, solution: Array) -> Array:
    """Return (C, 2, 2) from the coefficients of `_along_lattice`."""
    zero = np.zeros(len(solution))
    match kind.stretch_dim, kind.has_reflections:
        case 2, _:
            a, b, c, d = solution.T
            rows = [a + c, d - b, b + d, a - c]
        case 1, _:  # along the glides, which are the axes of the group's own frame
            p, q = solution.T
            rows = [p, zero, zero, q]
        case _, True:
            (p,) = solution.T
            rows = [p, zero, zero, p]
        case _:
            a, b = solution.T
            rows = [a, -b, b, a]
    return np.stack(rows, axis=-1).reshape(-1, 2, 2)


def _turn(factor: Complex, flips: NDArray[np.bool_], z: Complex) -> Complex:
    return factor * np.where(flips, np.conj(z), z)


def _unturn(factor: Complex, flips: NDArray[np.bool_], z: Complex) -> Complex:
    """Return the inverse of `_turn`."""
    return np.where(flips, factor * np.conj(z), np.conj(factor) * z)
