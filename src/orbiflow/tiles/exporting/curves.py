"""Curves of cubic Bézier pieces and straight ones: what a scene is made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbiflow.arrays import Array

Booleans = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Curve:
    """Pieces end to end.

    - `pieces`: (n, 4, 2) control points of each: start, two handles, end; units are the caller's.
    - `straight`: (n,) which pieces are straight: their handles are on the line.
    - `closed`: whether the last piece ends where the first starts.

    >>> square = Curve.polyline([[0, 0], [1, 0], [1, 1], [0, 1]], closed=True)
    >>> len(square.pieces), square.length
    (4, 4.0)
    """

    pieces: Array
    straight: Booleans
    closed: bool = False

    @classmethod
    def polyline(cls, points: ArrayLike, *, closed: bool = False) -> Curve:
        """Straight pieces through points (n, 2); a closed one does not repeat the first."""
        array = np.asarray(points, dtype=np.float64)
        ends = np.roll(array, -1, axis=0) if closed else array[1:]
        starts = array if closed else array[:-1]
        steps = (ends - starts) / 3
        pieces = np.stack([starts, starts + steps, ends - steps, ends], axis=1)
        return cls(pieces, np.ones(len(pieces), dtype=bool), closed)

    @classmethod
    def joined(cls, curves: Sequence[Curve], *, closed: bool = False) -> Curve:
        """One curve out of some that continue each other."""
        pieces = np.concatenate([curve.pieces for curve in curves])
        return cls(pieces, np.concatenate([curve.straight for curve in curves]), closed)

    @property
    def start(self) -> Array:
        """(2,)"""
        return self.pieces[0, 0]

    @property
    def end(self) -> Array:
        """(2,)"""
        return self.pieces[-1, 3]

    @property
    def length(self) -> float:
        """Of the polygon through some points of each piece: exact for straight ones."""
        points = self.flattened(1e-3)
        if self.closed:
            points = np.concatenate([points, points[:1]])
        return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())

    def moved(self, linear: Array, offset: ArrayLike) -> Curve:
        """Under the affine map p -> linear p + offset."""
        return Curve(self.pieces @ linear.T + np.asarray(offset), self.straight, self.closed)

    def reversed(self) -> Curve:
        """Run through the other way."""
        return Curve(self.pieces[::-1, ::-1], self.straight[::-1], self.closed)

    def flattened(self, tolerance: float) -> Array:
        """(m, 2) points on the curve whose polygon stays within `tolerance` of it.

        The ends of the pieces are among them; a closed curve's first point is not repeated.
        """
        second = np.diff(self.pieces, n=2, axis=1)
        bend = 6 * np.linalg.norm(second, axis=2).max(axis=1)
        count = np.maximum(1, np.ceil(np.sqrt(bend / 8 / tolerance)).astype(int))
        count[self.straight] = 1
        own = np.repeat(np.arange(len(count)), count)
        first = np.cumsum(count) - count
        share = (np.arange(count.sum()) - first[own]) / count[own]
        points = _at(self.pieces[own], share)
        return points if self.closed else np.concatenate([points, self.end[None]])

    def bounds(self) -> Array:
        """(2, 2) lower and upper corner of the box around all control points: it holds the curve."""
        points = self.pieces.reshape(-1, 2)
        return np.stack([points.min(axis=0), points.max(axis=0)])


def _at(pieces: Array, share: Array) -> Array:
    """(n, 2) the point of each piece (n, 4, 2) at parameter `share` (n,)."""
    t = share[:, None]
    u = 1 - t
    weights = np.stack([u**3, 3 * u**2 * t, 3 * u * t**2, t**3], axis=1)
    return (weights * pieces).sum(axis=1)
