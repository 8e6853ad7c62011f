"""A short list from two searches: tiles that no other beats in deformation and overlap together.

The front of Pareto: a tile is on it if no other has at most its deformation and at least its IoU, and
one of them better.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from orbiflow.escher.result import TileResult
from orbiflow.likeness.mutual import mutual_iou
from orbiflow.symmetry.isometry import Array

MOST = 12
"""Tiles in the list."""

ALIKE = 0.9
"""Mutual IoU from which two tiles are one to the eye."""

NEAR = 0.1
"""How far behind the front a tile may be that fills up the list."""

WORTH = 0.2
"""IoU that is worth as much as all of the deformation, behind the front."""

TIE = 1e-9
"""How far behind a point is that another only equals in one."""


def front_list(results: Sequence[TileResult]) -> list[TileResult]:
    """At most twelve tiles: those on the front, no two of them alike, then some behind it.

    The tile of least deformation and that of largest IoU are chosen first, then the others on the
    front, from each search in turn in the order of `results`; what has a mutual IoU of 0.9 with an
    earlier one is left out. While there is room, the first of each search follows, which it would
    show alone, and tiles that are behind the front by at most a tenth of their deformation or .02 of
    IoU, nearest first. Tiles without a deformation (forced ones that cross themselves) come last.

    Args:
        results: with their deformation measured, best first.

    Returns:
        The list in the order of `results`, with `front` set.
    """
    measured = [k for k, result in enumerate(results) if result.deformation is not None]
    odd = [k for k, result in enumerate(results) if result.deformation is None]
    cost = np.array([results[k].deformation for k in measured], dtype=np.float64)
    overlap = np.array([results[k].metrics.iou for k in measured])
    objectives = [results[k].objective for k in measured]
    late = behind(cost, overlap)
    ends = [] if not measured else [int(np.lexsort((-overlap, cost))[0]), int(overlap.argmax())]
    order = [k for k in ends if late[k] == 0]
    # in turn from each search: one must not crowd the other out
    own = [objectives[:k].count(objectives[k]) for k in range(len(objectives))]
    order += [int(k) for k in np.argsort(own, kind="stable") if late[k] == 0]
    order += [objectives.index(objective) for objective in dict.fromkeys(objectives)]
    order += [int(k) for k in np.argsort(late, kind="stable") if 0 < late[k] <= NEAR]
    alike = mutual_iou([results[k].normal_tile.polygon for k in measured], ALIKE)
    chosen: list[int] = []
    for k in dict.fromkeys(order):
        if len(chosen) < MOST and all(alike(k, other) < ALIKE for other in chosen):
            chosen.append(k)
    kept = sorted([measured[k] for k in chosen] + odd[: MOST - len(chosen)])
    on_front = {measured[k] for k in chosen if late[k] == 0}
    return [replace(results[k], front=k in on_front) for k in kept]


def behind(cost: Array, overlap: Array) -> Array:
    """(n,) how far each point is behind the front: 0 on it, 1 for all of its cost or `WORTH`.

    The least share e by which the cost falls, or e times `WORTH` by which the overlap rises, so that
    no point is better in both; of a point that only ties, next to nothing.

    >>> behind(np.array([1.0, 2.0, 2.0]), np.array([0.7, 0.6, 0.9])).round(3)
    array([0. , 0.5, 0. ])
    """
    late = np.zeros(len(cost))
    for k in range(len(cost)):
        better = (cost <= cost[k]) & (overlap >= overlap[k])
        better &= (cost < cost[k]) | (overlap > overlap[k])
        cheaper = (cost[k] - cost[better]) / max(cost[k], 1e-12)
        wider = (overlap[better] - overlap[k]) / WORTH
        late[k] = np.maximum(np.minimum(cheaper, wider), TIE).max(initial=0.0)
    return late
