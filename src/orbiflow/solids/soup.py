"""Triangles as a file has them, before they are known to be a surface, and the bounds of files."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from orbiflow.arrays import Array, Integers
from orbiflow.errors import OrbiflowError

MAX_BYTES = 400 * 2**20
"""Bytes of a file at most, and of what a 3MF file unpacks."""

MAX_FACES_READ = 4_000_000
"""Triangles of a file at most."""


class Soup(NamedTuple):
    """Triangles that need not be joined.

    - `points`: (N, 3).
    - `faces`: Three points' numbers of each triangle (M, 3).
    - `colours`: Red, green and blue of each point (N, 3), from 0 to 1, NaN where it has none; or None.
    """

    points: Array
    faces: Integers
    colours: Array | None = None

    @classmethod
    def joined(cls, parts: Sequence[Soup]) -> Soup:
        """Return all triangles of several meshes."""
        starts = np.cumsum([0, *(len(part.points) for part in parts)])[:-1]
        moved = [part.faces + start for part, start in zip(parts, starts, strict=True)]
        colours = [
            np.full(part.points.shape, np.nan) if part.colours is None else part.colours
            for part in parts
        ]
        coloured = any(part.colours is not None for part in parts)
        return cls(
            np.concatenate([np.zeros((0, 3)), *(part.points for part in parts)]),
            np.concatenate([np.zeros((0, 3), np.int64), *moved]),
            np.concatenate(colours) if coloured else None,
        )

    def with_corner_colours(self, colours: Array) -> Soup:
        """Return the triangles apart, each with colours of its own at its corners (M, 3, 3)."""
        points = self.points[self.faces].reshape(-1, 3)
        return Soup(points, np.arange(len(points)).reshape(-1, 3), colours.reshape(-1, 3))


def check_counts(points: int, faces: int) -> None:
    """Raise `OrbiflowError` if a file announces more points or triangles than are read."""
    if faces > MAX_FACES_READ or points > 3 * MAX_FACES_READ:
        raise OrbiflowError(
            f"has {faces:,} triangles and {points:,} points; at most {MAX_FACES_READ:,} triangles "
            "are read: simplify the mesh"
        )
