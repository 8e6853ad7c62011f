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
    """Triangles that need not be joined: points (N, 3), and three points' numbers of each (M, 3)."""

    points: Array
    faces: Integers

    @classmethod
    def joined(cls, points: Sequence[Array], faces: Sequence[Integers]) -> Soup:
        """Return all triangles of several meshes."""
        starts = np.cumsum([0, *map(len, points)])[:-1]
        moved = [own + start for own, start in zip(faces, starts, strict=True)]
        return cls(
            np.concatenate([np.zeros((0, 3)), *points]),
            np.concatenate([np.zeros((0, 3), np.int64), *moved]),
        )


def check_counts(points: int, faces: int) -> None:
    """Raise `OrbiflowError` if a file announces more points or triangles than are read."""
    if faces > MAX_FACES_READ or points > 3 * MAX_FACES_READ:
        raise OrbiflowError(
            f"has {faces:,} triangles and {points:,} points; at most {MAX_FACES_READ:,} triangles "
            "are read: simplify the mesh"
        )
