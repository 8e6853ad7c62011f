"""A prototile: a polygon whose images make up a tiling, alone or together with others."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from orbiflow.arguments import numbers, whole
from orbiflow.errors import OrbiflowError
from orbiflow.geometry import signed_area
from orbiflow.symmetry.isometry import Array

_REPEATED = 1e-12
"""Vertices nearer than this to the next, in radii of the tile, are one with it."""


@dataclass(frozen=True, eq=False)
class Prototile:
    """A closed polygon.

    Args:
        polygon: (N, 2) vertices in order, without repeating the first, either orientation.
        corners: indices into `polygon` of vertices that matter to the caller, such as the tiling
            vertices of an isohedral class, in order.

    Raises:
        OrbiflowError: if the polygon is not (N >= 3, 2) finite numbers, or a corner no vertex.
    """

    polygon: Array
    corners: tuple[int, ...] = field(default=())

    def __post_init__(self) -> None:
        polygon = numbers(self.polygon, "the tile's polygon", ("N", 2))
        if len(polygon) < 3:
            raise OrbiflowError(f"the tile's polygon needs 3 vertices at least, got {len(polygon)}")
        corners = tuple(
            whole(k, "a tile's corner, an index of its vertices,", 0, len(polygon) - 1)
            for k in self.corners
        )
        polygon.setflags(write=False)
        object.__setattr__(self, "polygon", polygon)
        object.__setattr__(self, "corners", corners)

    @cached_property
    def signed_area(self) -> float:
        """Area, positive for counter-clockwise order (with y up)."""
        return float(signed_area(self.polygon))

    @cached_property
    def box(self) -> Array:
        """(2, 2) lower left and upper right corner of the bounding box."""
        return np.stack([self.polygon.min(axis=0), self.polygon.max(axis=0)])

    @cached_property
    def center(self) -> Array:
        """(2,) centre of the bounding box."""
        return (self.box[0] + self.box[1]) / 2

    @cached_property
    def radius(self) -> float:
        """Largest distance of a vertex from `center`."""
        return float(np.linalg.norm(self.polygon - self.center, axis=1).max())

    @cached_property
    def kept(self) -> NDArray[np.int64]:
        """Indices of the vertices that are not the same as the next."""
        steps = np.linalg.norm(self.polygon - np.roll(self.polygon, -1, axis=0), axis=1)
        return np.flatnonzero(steps > _REPEATED * self.radius)

    @cached_property
    def ring(self) -> Array:
        """(M, 2) the polygon without repeated vertices."""
        return self.polygon[self.kept]
