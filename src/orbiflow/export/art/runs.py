"""Which region of a partition each sample of a picture lies in: exactly one, without gaps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbiflow.symmetry.isometry import Array

Integers = NDArray[np.int64]

NOWHERE = -1
"""Label of samples that lie in no region."""

NUDGE = 3.1415926e-7
"""How far down rows of samples lie from where they should, in samples: vertices that a symmetric
placement puts exactly on a row would else be decided by rounding."""


class Runs(NamedTuple):
    """Samples of some rows in one region each, row by row, from left to right.

    - `label`: (R,) the region, or `NOWHERE`.
    - `row`: (R,) counted from 0.
    - `start`: (R,) first column.
    - `length`: (R,) samples; those of a row come to its width.
    """

    label: Integers
    row: Integers
    start: Integers
    length: Integers

    def spread(self, values: NDArray) -> NDArray:
        """One value a sample, (rows x width,), from one a run."""
        return np.repeat(values, self.length)


class Sides(NamedTuple):
    """Sides of regions, each with the region to its right, at larger x.

    - `start`, `end`: (S, 2) in samples, y down: sample (i, j) lies at (j + 1/2, i + 1/2).
    - `label`: (S,)
    """

    start: Array
    end: Array
    label: Integers


def ring_sides(rings: Array) -> Sides:
    """The sides of rings (M, N, 2) that have the inside to their right; ring m has label m."""
    ahead = np.roll(rings, -1, axis=1)
    area = (rings[..., 0] * ahead[..., 1] - rings[..., 1] * ahead[..., 0]).sum(axis=1)
    entering = (ahead[..., 1] - rings[..., 1]) * np.sign(area)[:, None] < 0
    return Sides(rings[entering], ahead[entering], np.nonzero(entering)[0])


def polygon_sides(ring: Array) -> Sides:
    """All sides of one ring (N, 2): 0 where they enter it, `NOWHERE` where they leave it."""
    ahead = np.roll(ring, -1, axis=0)
    area = (ring[:, 0] * ahead[:, 1] - ring[:, 1] * ahead[:, 0]).sum()
    entering = (ahead[:, 1] - ring[:, 1]) * np.sign(area) < 0
    return Sides(ring, ahead, np.where(entering, 0, NOWHERE))


def triangle_sides(points: Array, triangles: Integers) -> Sides:
    """The sides of triangles (M, 3) that none of them folds over, and of what lies around them."""
    corners = points[triangles]
    inner = ring_sides(corners)
    # a side of one triangle alone is the border: beyond it is nowhere
    pairs = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    keys = np.sort(pairs, axis=1) @ np.array([len(points), 1])
    _, first, count = np.unique(keys, return_index=True, return_counts=True)
    border = pairs[first[count == 1]]
    own = np.tile(np.arange(len(triangles)), 3)[first[count == 1]]
    start, end = points[border[:, 0]], points[border[:, 1]]
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    sense = np.sign(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    leaving = (end - start)[:, 1] * sense[own] > 0
    return Sides(
        np.concatenate([inner.start, start[leaving]]),
        np.concatenate([inner.end, end[leaving]]),
        np.concatenate([inner.label, np.full(int(leaving.sum()), NOWHERE)]),
    )


def runs(sides: Sides, top: int, rows: int, width: int) -> Runs:
    """The runs of `rows` rows of `width` samples from row `top`; rows are counted from there.

    Each side is crossed by the rows between its ends, and a sample belongs to the region entered at
    the last crossing to its left. A side that two regions share enters one of them: so every sample
    of a partition is in exactly one.

    >>> square = np.array([[[1.0, 0.0], [3.0, 0.0], [3.0, 2.0], [1.0, 2.0]]])
    >>> left = square - (2.0, 0.0)
    >>> found = runs(ring_sides(np.concatenate([left, square])), 0, 2, 3)
    >>> found.label[found.length > 0].tolist(), found.length[found.length > 0].tolist()
    ([0, 1, 0, 1], [1, 2, 1, 2])
    """
    low = np.minimum(sides.start[:, 1], sides.end[:, 1])
    high = np.maximum(sides.start[:, 1], sides.end[:, 1])
    middle = 0.5 + NUDGE
    first = np.clip(np.ceil(low - middle).astype(np.int64), top, top + rows)
    last = np.clip(np.ceil(high - middle).astype(np.int64), top, top + rows)
    count = last - first
    own = np.repeat(np.arange(len(count)), count)
    row = np.arange(len(own)) - np.repeat(np.cumsum(count) - count, count) + first[own]
    start, end = sides.start[own], sides.end[own]
    share = (row + middle - start[:, 1]) / (end[:, 1] - start[:, 1])
    x = start[:, 0] + share * (end[:, 0] - start[:, 0])
    row -= top
    # every row begins nowhere
    row = np.concatenate([np.arange(rows), row])
    x = np.concatenate([np.full(rows, -np.inf), x])
    label = np.concatenate([np.full(rows, NOWHERE), sides.label[own]])
    order = np.lexsort((x, row))
    row, x, label = row[order], x[order], label[order]
    begin = np.ceil(np.clip(x, 0, width + 1) - 0.5).clip(0, width).astype(np.int64)
    stop = np.append(begin[1:], width)
    stop[np.append(row[1:] != row[:-1], True)] = width
    return Runs(label, row, begin, stop - begin)
