"""A tile: one polygon and the group whose images of it are to tile the plane."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from orbiflow.arguments import described, instance, is_a
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import CrystallographicGroup
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings.prototile import Prototile
from orbiflow.tilings.tiling import Tiling


@dataclass(frozen=True, eq=False)
class Tile:
    """A closed polygon with a crystallographic group acting in the same coordinates.

    A `Tiling` by one prototile, `tiling`, with what is known of where it comes from. Being a `Tile`
    proves nothing: `certify` does.

    Args:
        polygon: (N, 2) vertices in order, without repeating the first, either orientation.
        group: whose images of the polygon are the tiles.
        isohedral_class: such as "IH4", or "" when unknown.
        corners: indices into `polygon` of the tiling vertices of the class, in order.

    Raises:
        OrbiflowError: if the polygon is not (N >= 3, 2) finite numbers or the group not planar.
    """

    polygon: Array
    group: CrystallographicGroup
    isohedral_class: str = ""
    corners: tuple[int, ...] = field(default=())
    tiling: Tiling = field(init=False)

    def __post_init__(self) -> None:
        prototile = Prototile(self.polygon, self.corners)
        object.__setattr__(self, "tiling", Tiling(self.group, (prototile,)))
        instance(self.isohedral_class, str, "the tile's isohedral class", 'give its name, "IH4"')
        object.__setattr__(self, "polygon", prototile.polygon)
        object.__setattr__(self, "corners", prototile.corners)

    @property
    def signed_area(self) -> float:
        """Area, positive for counter-clockwise order (with y up)."""
        return self.tiling.prototiles[0].signed_area

    @property
    def center(self) -> Array:
        """(2,) centre of the bounding box."""
        return self.tiling.prototiles[0].center

    @property
    def radius(self) -> float:
        """Largest distance of a vertex from `center`."""
        return self.tiling.prototiles[0].radius

    def transformed(self, linear: Array, offset: Array) -> Tile:
        """The tile and its group under the affine map p -> linear p + offset (a similarity)."""
        moved = self.polygon @ np.asarray(linear).T + np.asarray(offset)
        group = self.group.conjugate(linear, offset)
        return Tile(moved, group, self.isohedral_class, self.corners)


Tiles: TypeAlias = Tile | Tiling
"""What the functions of this room take."""


def as_tiling(tiles: Tiles) -> Tiling:
    """The tiling that is meant.

    Raises:
        OrbiflowError: for what is neither a `Tile` nor a `Tiling`.
    """
    if isinstance(tiles, Tiling):
        return tiles
    if is_a(tiles, Tile):
        return tiles.tiling
    raise OrbiflowError(
        f"the tile must be a Tile or a Tiling, got {described(tiles)}; Tile(polygon, group) makes one"
    )
