"""Which points of an outline become a tile's corners: every choice scored, by sums looked up.

An outline of n points is laid out along the template's edges: edge e gets `lengths[e]` steps, the
first corner sits at point `start`. The differences of a tile's boundary agree, up to the isometry,
on identified edges; a placement's gain is how far those of the outline already do. This is the
adjacent-difference distance of Nagata and Imahori (An Efficient Exhaustive Search Algorithm for the
Escherization Problem, Algorithmica 2020) without its closing condition: all placements at once,
from tables of sums along the outline. It ranks; `nearest_tile` is exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Complex, Integers
from orbiflow.tiles.tilings import IsohedralClass

# Beyond this many, lengths and starts run in steps of more than one point
MOST_PLACEMENTS = 4_000_000


class Placements(NamedTuple):
    """Ways to lay an outline of n points along the edges of a template, best first.

    - `turns`: (C,) radians; turn of the glide axes, 0 in classes without glide reflections.
    """

    lengths: Integers  # (C, K) steps of each edge, sum n
    starts: Integers  # (C,) point of the outline at the template's first corner
    turns: NDArray[np.float64]
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
