"""Glues of two outlines, and placements of the union's corners, ranked by sums that are looked up.

A path that two outlines share is a run of the first and a run of the second, read backwards. What they
disagree by, after the best rotation, is a sum over steps, from a table of sums along the diagonals of
one product. Placements of the union are scored as those of one outline (`tile_space`), of all lengths
of edges at once, but for two neighbouring edges with half-turns, which count as one whose best
division is looked up: they are most of the freedom. A residual says little about the tile that comes of
it (design point 21), so many go on.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from orbiflow.arrays import Complex, Integers
from orbiflow.tiles.geometry import plane_points
from orbiflow.tiles.search.bending import unlike
from orbiflow.tiles.search.glued_body import Glue
from orbiflow.tiles.search.tile_orbits import relations_of
from orbiflow.tiles.search.tile_space import Placements, edge_lengths
from orbiflow.tiles.tilings import IsohedralClass

# What a pair of steps is taken to lose on the rest of the outline, in mean squared steps: longer paths
# leave less of it
LOST_STEP = 0.4
OVERLAP_COST = 40.0  # mean squared steps for each unit of area in which the figures overlap
MOST_OVERLAP = 0.3  # in areas of a figure
SHORTEST_PATH, LONGEST_PATH = 1 / 12, 5 / 8  # in lengths of an outline
NEAR = 2  # steps between the ends of paths that count as one
LOOKED_AT = 400  # glues of each length of the path whose overlap is computed
PER_KIND = 6  # placements of a class that go on, of each glue
SHORTEST_EDGE = 2  # steps
LOOKED_UP = 40  # the best of a class, among which twins are


class Glued(NamedTuple):
    """A glue and how far the outlines are from it."""

    residual: float  # of the path and, by guess, of the rest, in mean squared steps
    glue: Glue
    missed: float  # of the path, and what overlaps costs


class Placement(NamedTuple):
    """A glue with a placement of the union's corners."""

    residual: float  # in mean squared steps
    glue: Glue
    kind: IsohedralClass
    corners: Placements  # one


def _steps(outline: Complex) -> Complex:
    return np.roll(outline, -1) - outline


def sums_along(one: Complex, two: Complex, *, flips: bool, back: bool) -> Complex:
    """Return sums [k, a, b] over m < k of conj(one[a + m]) two[b + m]; two[b - m] if `back`.

    If it `flips`, those of one[a + m] two[...]. `k` is at most the shorter length.
    """
    n, other = len(one), len(two)
    most = min(n, other)
    t, a = np.arange(n + most), np.arange(n)[:, None]
    b, k = np.arange(other), np.arange(most + 1)[:, None, None]
    first = (one if flips else np.conj(one))[t % n][:, None]
    # along each diagonal, by where it crosses the first row
    products = first * two[(b - t[:, None] if back else b + t[:, None]) % other]
    total = np.concatenate([np.zeros((1, other), dtype=complex), np.cumsum(products, axis=0)])
    diagonal = (b + a if back else b - a) % other
    return total[a + k, diagonal] - total[a, diagonal]


def glues(one: Complex, two: Complex, count: int) -> list[Glued]:
    """Return the best glues of outlines (n,) and (m,), of all lengths of the path alike, best first."""
    first, second = _steps(one), _steps(two)
    n, m = len(one), len(two)
    squares = [np.append(0.0, np.cumsum(np.tile(abs(steps) ** 2, 2))) for steps in (first, second)]
    unit = (squares[0][n] + squares[1][m]) / (n + m)
    agreed = abs(sums_along(first, -second, flips=False, back=True))
    a, b = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
    lengths = range(max(3, round(SHORTEST_PATH * n)), int(LONGEST_PATH * min(n, m)))
    glued_runs: list[Glued] = []

    def near(best: Glued, other: Glued) -> bool:
        ends = zip(best.glue, other.glue, (n, m), strict=False)
        return max(abs((x - y + size / 2) % size - size / 2) for x, y, size in ends) < NEAR

    for length in lengths:
        apart = squares[0][a + length] - squares[0][a] + squares[1][b + length] - squares[1][b]
        missed = ((apart - 2 * agreed[length][a, (b + length - 1) % m]) / unit).ravel()
        best = np.argsort(missed)[:LOOKED_AT]
        ends = zip(*np.unravel_index(best, a.shape), strict=True)
        glued = (
            (Glue(int(i), int(j), length), float(missed[k]))
            for (i, j), k in zip(ends, best, strict=True)
        )
        glued_runs += unlike(_overlapping(one, two, glued), -(-3 * count // len(lengths)), near)
    return sorted(glued_runs)[:count]


def _overlapping(
    one: Complex, two: Complex, glued: Iterator[tuple[Glue, float]]
) -> Iterator[Glued]:
    """Yield glues whose figures overlap by little, with what that costs."""
    region = shapely.Polygon(plane_points(one)).buffer(0)
    for glue, missed in glued:
        along = np.arange(glue.length + 1)
        path = one[(glue.first + along) % len(one)]
        other = two[(glue.second + glue.length - along) % len(two)]
        turn = np.vdot(np.diff(other), np.diff(path))
        moved = turn / abs(turn) * (two - other.mean()) + path.mean()
        over = float(region.intersection(shapely.Polygon(plane_points(moved)).buffer(0)).area)
        if over < MOST_OVERLAP:
            cost = float(missed + OVERLAP_COST * over)
            yield Glued(cost - 2 * LOST_STEP * glue.length, glue, cost)


class _Layout(NamedTuple):
    """Where the sums of placements of n steps are in tables."""

    lengths: Integers  # (C, K); of merged edges, the first has all but one step
    parts: list[tuple[bool, bool, complex, Integers]]  # tables, factors, and places (C, n) in them
    merged: list[tuple[int, complex, Integers]]  # first edges, factors, and places (C, n)


@lru_cache(maxsize=128)
def _layout(kind: IsohedralClass, n: int) -> _Layout:
    alone = [edge_class.edge for edge_class in kind.edge_classes if len(edge_class.edges) == 1]
    first: list[int] = []
    for edge in alone:
        if edge + 1 in alone and edge - 1 not in first:
            first.append(edge)
    lengths = edge_lengths(kind, n)
    for edge in first:
        lengths = lengths[lengths[:, edge + 1] == 1]
    inside = {edge + k for edge in first for k in (0, 1)}
    long = [k for k in range(lengths.shape[1]) if k not in inside]
    lengths = lengths[(lengths[:, long] >= SHORTEST_EDGE).all(axis=1)]
    corners = np.cumsum(lengths, axis=1) - lengths
    starts = np.arange(n)
    parts: list[tuple[bool, bool, complex, Integers]] = []
    halves: dict[int, complex] = {}
    for edge, mate, factor, flips, back, weight in relations_of(kind):
        if edge in inside:
            halves[edge] = -weight * np.conj(factor)
            continue
        length = lengths[:, edge][:, None]
        a = (corners[:, edge][:, None] + starts) % n
        b = (corners[:, mate][:, None] + starts) % n
        share, b = (-weight, (b + length - 1) % n) if back else (weight, b)
        parts.append((flips, back, complex(share * np.conj(factor)), (length * n + a) * n + b))
    merged = [
        (
            edge,
            complex(halves[edge]),
            lengths[:, [edge, edge + 1]].sum(axis=1)[:, None] * n
            + (corners[:, edge][:, None] + starts) % n,
        )
        for edge in first
    ]
    return _Layout(lengths, parts, merged)


class _Tables:
    """Sums along a union's steps (n,), each made when it is first asked for."""

    def __init__(self, steps: Complex) -> None:
        self.steps = steps
        self.size = len(steps)
        self.of = cache(self._of)
        self.gains = cache(self._gains)
        self.glides = cache(self._glides)
        self.divisions = cache(self._divisions)

    def _of(self, *, flips: bool, back: bool) -> Complex:
        return sums_along(self.steps, self.steps, flips=flips, back=back)

    def _gains(self, back: bool, factor: complex) -> NDArray[np.float32]:
        sums = self.of(flips=False, back=back)
        return (factor.real * sums.real - factor.imag * sums.imag).astype(np.float32).ravel()

    def _glides(self, back: bool, factor: complex) -> NDArray[np.complex64]:
        return (factor * self.of(flips=True, back=back)).astype(np.complex64).ravel()

    def _divisions(self, factor: complex) -> tuple[NDArray[np.float32], Integers]:
        """Return the best gains of runs that two half-turns share, and the first's lengths.

        Both are (n + 1, n), flat: by the number of steps and the first point.
        """
        n = self.size
        a, length = np.arange(n), np.arange(1, n)[:, None]
        turned = (factor * self.of(flips=False, back=True)[length, a, (a + length - 1) % n]).real
        best = np.full((n + 1, n), -np.inf, dtype=np.float32)
        first = np.zeros((n + 1, n), dtype=np.int64)
        for count in range(1, n):
            both = turned[count - 1] + turned[: n - count][:, (a + count) % n]
            better = both > best[count + 1 :]
            best[count + 1 :][better], first[count + 1 :][better] = both[better], count
        return best.ravel(), first.ravel()


def _gains(
    kind: IsohedralClass, tables: _Tables
) -> tuple[NDArray[np.float32], NDArray[np.complex64] | None]:
    """Return gains (C, n) of all placements of a class, and the sums of glides if it has any."""
    layout = _layout(kind, tables.size)
    gains: NDArray[np.float32] = np.zeros((len(layout.lengths), tables.size), dtype=np.float32)
    glides: NDArray[np.complex64] | None = None
    for flips, back, factor, at in layout.parts:
        if flips:
            sums = tables.glides(back, factor).take(at)
            glides = sums if glides is None else glides + sums
        else:
            gains += tables.gains(back, factor).take(at)
    for _, factor, at in layout.merged:
        gains += tables.divisions(factor)[0].take(at)
    return (gains, None) if glides is None else (gains + abs(glides), glides)


def _complete(kind: IsohedralClass, tables: _Tables, row: int, start: int) -> Integers:
    """Return the lengths of a placement, with merged edges divided at best."""
    layout = _layout(kind, tables.size)
    lengths = layout.lengths[row].astype(np.int64)
    for edge, factor, at in layout.merged:
        both = lengths[edge] + lengths[edge + 1]
        lengths[edge] = tables.divisions(factor)[1][at[row, start]]
        lengths[edge + 1] = both - lengths[edge]
    return lengths


def placements(
    union: Complex, glued: Glued, kinds: Sequence[IsohedralClass], unit: float, count: int
) -> list[Placement]:
    """Return the best placements of a union (n,) of two glued outlines, best first.

    `unit` is the mean squared step, and residuals are in such.
    """
    steps = _steps(union)
    whole = float((abs(steps) ** 2).sum())
    tables = _Tables(steps)
    options: list[Placement] = []
    for kind in kinds:
        gains, glides = _gains(kind, tables)
        flat = gains.ravel()
        if not len(flat):
            continue
        best = np.argpartition(-flat, min(LOOKED_UP, flat.size - 1))[:LOOKED_UP]
        best = best[np.argsort(-flat[best], kind="stable")]
        # relabelled twins have the same gain
        fresh = best[np.unique(np.round(flat[best] / whole, 6), return_index=True)[1]][::-1]
        for at in fresh[:PER_KIND].tolist():
            row, start = divmod(at, len(steps))
            turn = 0.0 if glides is None else float(np.angle(glides[row, start]) / 2)
            residual = float(glued.missed + (whole - 2 * float(flat[at])) / unit)
            lengths = _complete(kind, tables, row, start)[None]
            corners = Placements(lengths, np.array([start]), np.array([turn]))
            options.append(Placement(residual, glued.glue, kind, corners))
    return sorted(options, key=lambda placed: placed.residual)[:count]
