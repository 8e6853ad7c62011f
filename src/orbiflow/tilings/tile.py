"""A prototile: a polygon and the group whose images of it are to tile the plane."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from orbiflow.arguments import instance, numbers, whole
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
        polygon = numbers(self.polygon, "the tile's polygon", ("N", 2))
        if len(polygon) < 3:
            raise OrbiflowError(f"the tile's polygon needs 3 vertices at least, got {len(polygon)}")
        how = "isohedral_class(name).group() and wallpaper_group(name) make one"
        instance(self.group, CrystallographicGroup, "the tile's group", how)
        instance(self.isohedral_class, str, "the tile's isohedral class", 'give its name, "IH4"')
        corners = tuple(
            whole(k, "a tile's corner, an index of its vertices,", 0, len(polygon) - 1)
            for k in self.corners
        )
        if self.group.dim != 2:
            raise OrbiflowError(
                f"a tile needs a group of the plane, got dimension {self.group.dim}"
            )
        polygon.setflags(write=False)
        object.__setattr__(self, "polygon", polygon)
        object.__setattr__(self, "corners", corners)

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
