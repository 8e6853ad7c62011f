"""Tilings: a crystallographic group, and prototiles whose images are to cover the plane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arguments import instance
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import CrystallographicGroup
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings.aspects import Aspects
from orbiflow.tilings.prototile import Prototile
from orbiflow.tilings.stabiliser import Stabiliser, stabiliser


@dataclass(frozen=True, eq=False)
class Tiling:
    """Prototiles T_k and a group G in the same coordinates; the tiles are all g(T_k) (design point 16).

    The elements that take T_k onto itself, its stabiliser S_k, are found from the polygon: tiles that
    are mirror images of themselves, or turn about their middle, need not be announced. Being a
    `Tiling` proves nothing: `certify` does. Its tiles cover the plane once if
    sum_k area(T_k) |G| / |S_k| = |det B| and their boundaries pair off.

    Args:
        group: of the plane.
        prototiles: at least one, none an image of another; each a `Prototile` or its polygon
            (N, 2). All run the same way around.

    Raises:
        OrbiflowError: if the group is not planar, there is no prototile, a polygon is none, or
            polygons run different ways around.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> eighth = Tiling(wallpaper_group("p4m"), [[[0, 0], [0.5, 0], [0.5, 0.5]]])
    >>> cell = Tiling(eighth.group, [[[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]])
    >>> [tiling.stabilisers[0].order for tiling in (eighth, cell)]
    [1, 8]
    """

    group: CrystallographicGroup
    prototiles: tuple[Prototile, ...]

    def __init__(
        self, group: CrystallographicGroup, prototiles: Sequence[Prototile | ArrayLike]
    ) -> None:
        how = "isohedral_class(name).group() and wallpaper_group(name) make one"
        instance(group, CrystallographicGroup, "the tile's group", how)
        if group.dim != 2:
            raise OrbiflowError(f"a tile needs a group of the plane, got dimension {group.dim}")
        try:
            given = list(prototiles)
        except TypeError:
            given = []
        if given and not isinstance(given[0], Prototile | str) and np.ndim(given[0]) == 1:
            given = []  # a polygon by itself
        own = tuple(p if isinstance(p, Prototile) else Prototile(np.asarray(p)) for p in given)
        if not own:
            raise OrbiflowError(
                "a tiling needs a sequence of prototiles, one at least: Tiling(group, [polygon])"
            )
        for number, prototile in enumerate(own):
            if prototile.signed_area * own[0].signed_area < 0:
                raise OrbiflowError(
                    f"prototile {number} runs the other way around than prototile 0: reverse its "
                    "vertices"
                )
        object.__setattr__(self, "group", group)
        object.__setattr__(self, "prototiles", own)

    @cached_property
    def stabilisers(self) -> tuple[Stabiliser, ...]:
        """Of each prototile: which elements of the group take it onto itself."""
        return tuple(stabiliser(self.group, p.ring) for p in self.prototiles)

    @cached_property
    def aspects(self) -> Aspects:
        """The tiles of a lattice cell."""
        return Aspects.of(self.group, self.stabilisers)

    @cached_property
    def tile_area(self) -> float:
        """|det B| over the tiles of a cell: the area of a tile, the mean one of several prototiles."""
        return self.group.cell_volume / len(self.aspects)

    @cached_property
    def box(self) -> Array:
        """(2, 2) lower left and upper right corner of the prototiles' bounding box."""
        boxes = np.stack([p.box for p in self.prototiles])
        return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])

    @property
    def center(self) -> Array:
        """(2,) centre of `box`."""
        return (self.box[0] + self.box[1]) / 2

    @property
    def radius(self) -> float:
        """Radius of the largest prototile."""
        return max(p.radius for p in self.prototiles)

    def transformed(self, linear: Array, offset: Array) -> Tiling:
        """Prototiles and group under the affine map p -> linear p + offset (a similarity)."""
        by, to = np.asarray(linear), np.asarray(offset)
        moved = [Prototile(p.polygon @ by.T + to, p.corners) for p in self.prototiles]
        return Tiling(self.group.conjugate(by, to), moved)

    def __repr__(self) -> str:
        orders = ", ".join(str(own.order) for own in self.stabilisers)
        name = self.group.name or f"order {self.group.order}"
        return f"Tiling({name}, prototiles with stabilisers of order {orders})"
