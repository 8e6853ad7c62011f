"""Which point of one outline is which point of another: in order, and as like as can be.

Dynamic programming along both outlines (dynamic time warping of closed curves; Sakoe and Chiba, 1978):
points should lie near each other, run the same way, and follow each other at the usual distance.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from orbiflow.geometry import arc_lengths, complex_points, resampled

Array = NDArray[np.float64]

FINER = 6
"""Places on the second outline for each point of the first."""

LONGEST = 6
"""Times its usual length that a step may have."""

FIRST = 6
"""Places that are tried for the first point."""


def corresponding(
    own: Array, other: Array, near: float = 0.4, stretch: float = 1.0, count: int = 96
) -> Array:
    """Where on another outline the points of one belong.

    Args:
        own: (n, 2) of area about 1, counter-clockwise.
        other: (M, 2) laid over it, counter-clockwise.
        near: distance, in square roots of the area, that costs as much as running at right angles.
        stretch: what stretching or shrinking a step by a factor of e costs.
        count: points of `own` that are matched; those between follow in proportion.

    Returns:
        (n,) arc lengths along `other` from its first vertex, increasing by less than its length from
        first to last; they may be beyond its length.

    >>> square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    >>> corresponding(square, np.roll(square, 1, axis=0)).round(9) % 4
    array([1., 2., 3., 0.])
    """
    along = arc_lengths(own)
    points = resampled(own, count)
    places = count * FINER
    cost = _differences(points, resampled(other, places), near)
    first = int(cost.min(axis=1).argmin())
    cost = np.roll(cost, -first, axis=0)
    steps = _best_of(cost, _begin(cost[0]), stretch)
    at = np.append(steps, steps[0] + places) / places * arc_lengths(other)[-1]
    # the k-th matched point lies at (first + k) / count of the own length
    known = (first + np.arange(count + 1)) / count * along[-1]
    knots = np.concatenate([known[:-1] - along[-1], known])
    values = np.concatenate([at[:-1] - arc_lengths(other)[-1], at])
    return np.interp(along[:-1], knots, values)


def _differences(points: Array, places: Array, near: float) -> Array:
    """(n, m) what it costs to take a point for a place."""
    x, y = complex_points(points), complex_points(places)
    own, other = (np.roll(z, -k) - np.roll(z, k) for z, k in ((x, 1), (y, FINER)))
    own, other = (step / np.maximum(abs(step), 1e-12) for step in (own, other))
    apart = abs(x[:, None] - y[None]) ** 2 / near**2
    return apart + 1 - (np.conj(own)[:, None] * other[None]).real


def _begin(cost: Array) -> list[int]:
    """Places for the first point, no two of them side by side."""
    chosen: list[int] = []
    for place in np.argsort(cost, kind="stable").tolist():
        gaps = [abs(place - other) for other in chosen]
        if all(min(gap, len(cost) - gap) > FINER for gap in gaps):
            chosen.append(place)
        if len(chosen) == FIRST:
            break
    return chosen


def _best_of(cost: Array, begin: list[int], stretch: float) -> Array:
    """(n,) the best places, increasing, for points whose first is at one of the given places."""
    n, m = cost.shape
    length = np.arange(1, LONGEST * FINER + 1)
    price = stretch * np.log(length / FINER) ** 2
    best, least = np.zeros(n), np.inf
    for start in begin:
        turned = np.roll(cost, -start, axis=1)
        total = np.full(m + 1, np.inf)
        total[0] = turned[0, 0]
        came = np.zeros((n + 1, m + 1), dtype=np.int64)
        for i in range(1, n + 1):
            last = i == n  # the first point again
            padded = np.concatenate([np.full(len(length), np.inf), total])
            windows = np.lib.stride_tricks.sliding_window_view(padded, len(length))[: m + 1]
            sums = windows[:, ::-1] + price
            came[i] = sums.argmin(axis=1)
            total = sums[np.arange(m + 1), came[i]]
            total = total + (0.0 if last else np.append(turned[i], turned[i, 0]))
        if total[m] < least:
            least, place, path = float(total[m]), m, np.zeros(n)
            for i in range(n, 0, -1):
                place -= int(length[came[i, place]])
                path[i - 1] = place
            best = path + start
    return best
