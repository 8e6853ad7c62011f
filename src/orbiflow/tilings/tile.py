"""A prototile: a polygon and the group whose images of it are to tile the plane."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from orbiflow.errors import OrbiflowError
from orbiflow.geometry import signed_area
from orbiflow.symmetry import CrystallographicGroup
from orbiflow.symmetry.isometry import Array


@dataclass(frozen=True, eq=False)
class Tile:
    """A closed polygon with a crystallographic group acting in the same coordinates.

    Being a `Tile` proves nothing: `certify` does.

    Args:
        polygon: (N, 2) vertices in order, without repeating the first, either orientation.
        group: one tile per group element.
        isohedral_class: such as "IH4", or "" when unknown.
        corners: indices into `polygon` of the tiling vertices of the class, in order.

    Raises:
        OrbiflowError: if the polygon is not (N >= 3, 2) finite numbers or the group not planar.
    """

    polygon: Array
    group: CrystallographicGroup
    isohedral_class: str = ""
    corners: tuple[int, ...] = field(default=())

    def __post_init__(self) -> None:
        polygon = np.array(self.polygon, dtype=np.float64)
        if polygon.ndim != 2 or polygon.shape[1] != 2 or len(polygon) < 3:
            raise OrbiflowError(f"a tile's polygon is (N >= 3, 2) numbers, got {polygon.shape}")
        if not np.isfinite(polygon).all():
            raise OrbiflowError("the tile's polygon has NaN or infinite coordinates")
        if self.group.dim != 2:
            raise OrbiflowError(
                f"a tile needs a group of the plane, got dimension {self.group.dim}"
            )
        polygon.setflags(write=False)
        object.__setattr__(self, "polygon", polygon)

    @property
    def signed_area(self) -> float:
        """Area, positive for counter-clockwise order (with y up)."""
        return float(signed_area(self.polygon))

    @property
    def center(self) -> Array:
        """(2,) centre of the bounding box."""
        return (self.polygon.min(axis=0) + self.polygon.max(axis=0)) / 2

    @property
    def radius(self) -> float:
        """Largest distance of a vertex from `center`."""
        return float(np.linalg.norm(self.polygon - self.center, axis=1).max())

    def transformed(self, linear: Array, offset: Array) -> Tile:
        """The tile and its group under the affine map p -> linear p + offset (a similarity)."""
        moved = self.polygon @ np.asarray(linear).T + np.asarray(offset)
        group = self.group.conjugate(linear, offset)
        return Tile(moved, group, self.isohedral_class, self.corners)
