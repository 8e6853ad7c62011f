"""Where along the outline a tile's corners best lie: placements improved one step at a time.

A search with few points knows the corners to within a sixtieth of the outline, and how well the
outline's own corners meet those of the edges they are identified with shows only with more points.
So each placement moves to the best of its neighbours until none is better: the lengths of two pairs
of edges change by a step, or all corners move along. Of the neighbours, those whose nearest tile is
near the present outline are worked out, by springs: one factorization serves them all.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import permutations
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from orbiflow.arrays import Array, Complex, Integers
from orbiflow.runtime import Cancel
from orbiflow.tiles.geometry import plane_points, signed_area
from orbiflow.tiles.likeness import Elastic
from orbiflow.tiles.search.placements import Placements
from orbiflow.tiles.search.tile_space import TileSpace
from orbiflow.tiles.tilings import IsohedralClass

SPRINGS = 1500.0
"""Strength of the springs by which neighbours are compared: nearly tiles, yet one matrix for all."""

ROUNDS = 3
"""Steps of choosing rotations and solving, a neighbour."""

CROSSED = 100.0
"""Added to the cost of what crosses itself: more than anything sound costs."""

BETTER = 0.998
"""A neighbour is taken if it costs less than this much of what there is."""

MOST_MOVES = 8
"""Of each placement with each step."""


class Drawn(NamedTuple):
    """C shapes drawn to tiles of their placements by springs.

    - `placements`: C of them.
    - `points`: (N, C).
    - `costs`: (C,) energy, springs and displacement together; `CROSSED` more of what crosses itself.
    """

    placements: Placements
    points: Complex
    costs: Array

    def take(self, index: Integers) -> Drawn:
        """Those at `index`."""
        return Drawn(self.placements.take(index), self.points[:, index], self.costs[index])


class Stage(NamedTuple):
    """One stage of moving corners.

    - `step`: points of the outline by which corners move.
    - `keep`: placements that go on, the best and no two the same.
    """

    step: int
    keep: int


def shifted(
    body: Elastic,
    kind: IsohedralClass,
    placements: Placements,
    points: Complex,
    stages: Sequence[Stage],
    *,
    share: float,
    cancel: Cancel | None = None,
) -> Drawn:
    """Move the corners of each placement until no neighbour is better.

    Args:
        body: the silhouette.
        kind: the class.
        placements: C of them, of the body's outline.
        points: (N, C) shapes to start from.
        stages: one after the other.
        share: of all neighbours that are worked out, those of the nearest tiles.
        cancel: looked at before each move.

    Returns:
        The placements that are left, best first, no two the same.
    """
    cancel = cancel or Cancel()
    drawn = _drawn(body, kind, placements, points)
    for stage in stages:
        drawn = _distinct(drawn, stage.keep)
        live = np.arange(len(drawn.costs))
        for _ in range(MOST_MOVES):
            cancel.check()
            owners, options = _neighbours(body, kind, drawn, live, stage.step, share)
            if not len(owners):
                break
            tried = _drawn(body, kind, options, drawn.points[:, owners])
            live = _take_better(drawn, owners, tried)
    return _distinct(drawn, len(drawn.costs))


def _drawn(body: Elastic, kind: IsohedralClass, placements: Placements, points: Complex) -> Drawn:
    space, n = TileSpace(kind, placements), body.size
    if space.glides:
        space.turn(space.best_turns(points[:n].T))

    def tiles() -> Complex:
        return space.in_order(space.nearest(points[:n].T).vertices).T

    for _ in range(ROUNDS):
        points = body.pulled(points, tiles(), SPRINGS, 1)
    apart = (abs(points[:n] - tiles()) ** 2).mean(axis=0)
    rings = plane_points(points[:n].T)
    area = np.maximum(signed_area(rings), 0.1)
    costs = (body.lenient_energy(points) + SPRINGS * apart) / area
    costs += body.stiffness.pose * body.displacement(points)
    costs[~shapely.is_valid(shapely.polygons(rings))] += CROSSED
    return Drawn(placements._replace(turns=space.turns), points, costs)


def _distinct(drawn: Drawn, count: int) -> Drawn:
    """The best `count` at most, best first, no placement twice."""
    seen: set[tuple[int, ...]] = set()
    kept: list[int] = []
    for k in np.argsort(drawn.costs, kind="stable"):
        corners = (int(drawn.placements.starts[k]), *drawn.placements.lengths[k].tolist())
        if corners not in seen:
            seen.add(corners)
            kept.append(int(k))
    return drawn.take(np.array(kept[:count], dtype=np.int64))


def _neighbours(
    body: Elastic, kind: IsohedralClass, drawn: Drawn, live: Integers, step: int, share: float
) -> tuple[Integers, Placements]:
    """Whose neighbours (M,), and these, of those at `live`: the share whose tiles are nearest."""
    longer, later = _moves(kind, step)
    own = drawn.placements
    owners = np.repeat(live, len(later))
    lengths = (own.lengths[live][:, None] + longer).reshape(len(owners), longer.shape[1])
    starts = (own.starts[live][:, None] + later).ravel() % body.size
    fits = (lengths >= 2).all(axis=1)
    owners, lengths, starts = owners[fits], lengths[fits], starts[fits]
    options = Placements(lengths, starts, own.turns[owners], own.gains[owners])
    if share >= 1 or not len(owners):
        return owners, options
    apart = TileSpace(kind, options).nearest(drawn.points[: body.size, owners].T).distance
    order = np.lexsort((apart, owners))
    rank = np.arange(len(order)) - np.searchsorted(owners[order], owners[order])
    count = np.bincount(owners, minlength=len(drawn.costs))[owners[order]]
    near = np.sort(order[rank < np.maximum(4, share * count)])
    return owners[near], options.take(near)


def _take_better(drawn: Drawn, owners: Integers, tried: Drawn) -> Integers:
    """Let each take the best that it has tried, in place; who has moved."""
    moved: list[int] = []
    for k in np.unique(owners):
        mine = np.flatnonzero(owners == k)
        best = mine[np.argmin(tried.costs[mine])]
        if tried.costs[best] < BETTER * drawn.costs[k]:
            for old, new in zip(drawn.placements, tried.placements, strict=True):
                old[k] = new[best]
            drawn.points[:, k], drawn.costs[k] = tried.points[:, best], tried.costs[best]
            moved.append(int(k))
    return np.array(moved, dtype=np.int64)


@lru_cache(maxsize=64)
def _moves(kind: IsohedralClass, step: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Neighbours of a placement: what is added to lengths (M, K) and starts (M,).

    One pair of edges becomes longer and another shorter, with the first corner where it is, or moved
    so that one of the other corners stays; or all corners move.
    """
    pairs = kind.identified_edges
    still = np.zeros(len(kind.template()), dtype=np.int64)
    lengths, starts = [still, still], [step, -step]
    for one, other in permutations(pairs, 2):
        change = still.copy()
        same = one.folded == other.folded
        for pair, sign, mate in ((one, 1, other), (other, -1, one)):
            amount = sign * step * (1 if same or mate.folded else 2)
            change[list({pair.first, pair.second})] += amount
        corners = np.cumsum(change) - change
        low, high = int(corners.min()), int(corners.max())
        for start in sorted({0, -low, -high, -(low + high) // 2}):
            lengths.append(change)
            starts.append(start)
    return np.array(lengths), np.array(starts)
