"""Points of a closed ring by arc length: evenly spaced, or evenly between corners that are kept.

A ring is an array (N, 2), float64, without a repeated last vertex.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.errors import OrbiflowError
from orbiflow.geometry.rings import Ring


def ring_length(ring: Ring) -> float:
    """Length of the closed `ring` (N, 2), the side from its last vertex to its first included.

    >>> ring_length(np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]]))
    12.0
    """
    return float(arc_lengths(ring)[-1])


def points_along(ring: Ring, at: ArrayLike) -> Ring:
    """Points (P, 2) of the closed `ring` (N, 2) at the arc lengths `at` (P,) from its first vertex.

    Lengths beyond the ring's own, and negative ones, go round.

    >>> points_along(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]), [0.5, 4.5]).tolist()
    [[0.5, 0.0], [0.5, 0.0]]
    """
    knots = arc_lengths(ring)
    return _interpolated(ring, knots, np.asarray(at, dtype=np.float64) % knots[-1])


def resampled(ring: Ring, count: int, phase: float = 0.0) -> Ring:
    """`count` points (count, 2) evenly spaced along the closed `ring` (N, 2).

    `phase`, from 0 to 1, moves them along by that share of their spacing.

    >>> square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    >>> resampled(square, 4, phase=0.5).tolist()
    [[0.5, 0.0], [1.0, 0.5], [0.5, 1.0], [0.0, 0.5]]
    """
    knots = arc_lengths(ring)
    return _interpolated(ring, knots, (np.arange(count) + phase) / count * knots[-1])


def resampled_with_corners(
    ring: Ring, corners: Sequence[int], count: int
) -> tuple[Ring, list[int]]:
    """As `resampled`, with some vertices of the ring kept as they are.

    Between one corner and the next the points are evenly spaced; how many there are follows the
    length between them (largest remainders), at least the corner itself.

    Args:
        ring: (N, 2).
        corners: indices of the vertices to keep, increasing; the first point is the first of them.
        count: points in all, at least as many as there are corners.

    Returns:
        The points (count, 2), and the index of each corner among them.

    Raises:
        OrbiflowError: for corners that do not increase or are not vertices, and for too few points.

    >>> square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
    >>> points, at = resampled_with_corners(square, [1, 3], 4)
    >>> points.tolist(), at
    ([[2.0, 0.0], [1.5, 1.0], [0.0, 1.0], [0.5, 0.0]], [0, 2])
    """
    kept = [int(k) for k in corners]
    if not kept or kept[0] < 0 or kept[-1] >= len(ring) or (np.diff(kept) < 1).any():
        raise OrbiflowError(
            f"corners must be increasing indices of the {len(ring)} vertices, got {kept}"
        )
    if count < len(kept):
        raise OrbiflowError(f"{len(kept)} corners need at least as many points, got {count}")
    knots = arc_lengths(ring)
    starts = knots[kept]
    lengths = np.diff(starts, append=starts[0] + knots[-1])
    shares = _shared_out(lengths, count)
    at: list[Ring] = [
        start + length * np.arange(share) / share
        for start, length, share in zip(starts, lengths, shares, strict=True)
    ]
    points = _interpolated(ring, knots, np.concatenate(at) % knots[-1])
    indices = (np.cumsum(shares) - shares).tolist()
    points[indices] = ring[kept]  # bit for bit
    return points, indices


def arc_lengths(ring: Ring) -> Ring:
    """Arc lengths (N + 1,) at each vertex of the closed `ring` (N, 2), and at the first again.

    >>> arc_lengths(np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]])).tolist()
    [0.0, 3.0, 7.0, 12.0]
    """
    sides = np.roll(ring, -1, axis=0) - ring
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(sides, axis=1))])


def _interpolated(ring: Ring, knots: Ring, at: Ring) -> Ring:
    closed = np.concatenate([ring, ring[:1]])
    return np.stack([np.interp(at, knots, closed[:, k]) for k in (0, 1)], axis=-1)


def _shared_out(lengths: Ring, count: int) -> np.ndarray:
    """Whole numbers of at least 1 with sum `count`, in proportion to `lengths`."""
    spare = count - len(lengths)
    exact = spare * lengths / lengths.sum()
    whole = np.floor(exact).astype(int)
    largest = np.argsort(whole - exact, kind="stable")[: spare - whole.sum()]
    whole[largest] += 1
    return whole + 1
