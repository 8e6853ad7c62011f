"""Copies of a piece in a lattice, side by side without touching: as dense as is easily found."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from orbiflow.symmetry.isometry import Array


@dataclass(frozen=True, eq=False)
class Arrangement:
    """A pieces in each cell of a lattice.

    - `lattice`: (2, 2), basis vectors as columns, in mm.
    - `linear`: (A, 2, 2) how each piece of a cell is turned or mirrored.
    - `offsets`: (A, 2) where it is: a point p of the piece goes to linear p + offset.
    """

    lattice: Array
    linear: Array
    offsets: Array

    def scaled(self, stretch: Array, middle: Array) -> Arrangement:
        """The pieces' middles moved by the linear map `stretch` (2, 2), the pieces kept."""
        centers = self.linear @ middle + self.offsets
        return Arrangement(
            stretch @ self.lattice,
            self.linear,
            self.offsets + centers @ (stretch - np.eye(2)).T,
        )

    def turned(self, angle: float) -> Arrangement:
        """All of it turned about the origin by an angle in radians."""
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        return Arrangement(turn @ self.lattice, turn @ self.linear, self.offsets @ turn.T)

    @cached_property
    def cell_area(self) -> float:
        """Area of the sheet that one piece takes."""
        return float(abs(np.linalg.det(self.lattice))) / len(self.linear)

    def clear(self, ring: Array, gap: float) -> bool:
        """Whether no two pieces with the outline `ring` come closer than `gap`."""
        pieces = self._own(ring)
        reach = float(np.linalg.norm(ring - _middle(ring), axis=1).max())
        centers = self.linear @ _middle(ring) + self.offsets
        steps = self._steps(2 * reach + gap, centers)
        shifts = steps @ self.lattice.T
        for first, piece in enumerate(pieces):
            shapely.prepare(piece)
            for second in range(first, len(pieces)):
                moved = centers[second] + shifts - centers[first]
                near = np.hypot(*moved.T) <= 2 * reach + gap
                if second == first:  # one of each pair of opposite shifts, and not the piece itself
                    near &= (steps[:, 0] > 0) | ((steps[:, 0] == 0) & (steps[:, 1] > 0))
                if near.any() and self._touched(piece, pieces[second], shifts[near], gap):
                    return False
        return True

    def _own(self, ring: Array) -> list[shapely.Polygon]:
        return [
            shapely.Polygon(ring @ linear.T + offset)
            for linear, offset in zip(self.linear, self.offsets, strict=True)
        ]

    def _steps(self, reach: float, centers: Array) -> Array:
        """Integer coordinates of all lattice vectors that can bring two pieces together."""
        far = reach + float(np.ptp(centers, axis=0).max()) * 1.5
        bound = np.ceil(far * np.linalg.norm(np.linalg.inv(self.lattice), axis=1)).astype(int)
        bound = np.minimum(bound, 40)
        ranges = [np.arange(-b, b + 1) for b in bound]
        return np.stack(np.meshgrid(*ranges, indexing="ij"), axis=-1).reshape(-1, 2)

    @staticmethod
    def _touched(piece: shapely.Polygon, other: shapely.Polygon, shifts: Array, gap: float) -> bool:
        points = np.asarray(other.exterior.coords)
        moved = shapely.polygons(points + shifts[:, None, :])
        return bool(shapely.dwithin(piece, moved, gap).any())


def tightened(start: Arrangement, ring: Array, gap: float, *, most: float = 4.0) -> Arrangement:
    """The arrangement, its pieces' middles moved apart (or together) evenly until just clear."""
    middle = _middle(ring)
    low, high = 0.0, 1.0
    while not start.scaled(high * np.eye(2), middle).clear(ring, gap):
        low, high = high, 1 + 2 * (high - 1) + 0.02
        if high > most:
            return start.scaled(most * np.eye(2), middle)
    if low == 0.0:
        low = 0.9
        if start.scaled(low * np.eye(2), middle).clear(ring, gap):
            return start.scaled(low * np.eye(2), middle)
    while high - low > 5e-4:
        between = (low + high) / 2
        if start.scaled(between * np.eye(2), middle).clear(ring, gap):
            high = between
        else:
            low = between
    return start.scaled(high * np.eye(2), middle)


def _middle(ring: Array) -> Array:
    return (ring.min(axis=0) + ring.max(axis=0)) / 2
