"""The tiles around a prototile, in coordinates where a tile has area one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from orbiflow.errors import OrbiflowError
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings.aspects import Integers
from orbiflow.tilings.copies import Copies, copies_near
from orbiflow.tilings.placed import Placed
from orbiflow.tilings.tile import Tiles, as_tiling
from orbiflow.tilings.tiling import Tiling

MAX_SPAN = 12.0
"""Largest radius of a tile, in square roots of its group's area, whose images are listed."""


def expected_area(tile: Tiles) -> float:
    """|det B| over the number of tiles in a lattice cell: the area of a tile of this group."""
    return as_tiling(tile).tile_area


def span(tile: Tiles) -> float:
    """Radius of the tile over the square root of the expected area: about 0.6 for a hexagon."""
    tiling = as_tiling(tile)
    return tiling.radius / math.sqrt(tiling.tile_area)


@dataclass(frozen=True, eq=False)
class Surroundings:
    """A prototile and the tiles nearby, moved and scaled so that the expected area is one.

    - `prototile`: its number.
    - `ring`: (N, 2) the prototile without repeated vertices, centred at zero.
    - `copies`: the M tiles nearby, not the prototile itself, in the tiling's own coordinates.
    - `points`: (P, 2) their vertices, one tile after the other, each as its prototile has them.
    - `counts`: (M,) how many each has.
    - `mirrored`: (M,) whether the tile's element reverses orientation.
    """

    prototile: int
    ring: Array
    copies: Copies
    points: Array
    counts: Integers
    mirrored: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.copies)

    @cached_property
    def owner(self) -> Integers:
        """(P,) which tile each of the points is a vertex of."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    @cached_property
    def place(self) -> Integers:
        """(P,) which vertex of its prototile each of the points is."""
        first = np.cumsum(self.counts) - self.counts
        return np.arange(len(self.points)) - np.repeat(first, self.counts)

    @cached_property
    def ahead(self) -> Array:
        """(P, 2) the next vertex of the same tile."""
        following = np.arange(1, len(self.points) + 1)
        last = np.cumsum(self.counts) - 1
        following[last] = last + 1 - self.counts
        return self.points[following]

    @cached_property
    def rings(self) -> Any:
        """(M,) the tiles' boundaries, as shapely's rings."""
        return np.asarray(shapely.linearrings(self.points, indices=self.owner))

    def elements(self) -> tuple[Placed, ...]:
        """The tiles as elements of the group."""
        return tuple(self.copies.isometry(k) for k in range(len(self)))

    def select(self, keep: NDArray[np.bool_]) -> Surroundings:
        """The tiles where `keep`, (M,), is true."""
        return Surroundings(
            self.prototile,
            self.ring,
            self.copies.select(keep),
            self.points[keep[self.owner]],
            self.counts[keep],
            self.mirrored[keep],
        )


def surroundings(tiling: Tiling, prototile: int, margin: float) -> Surroundings:
    """The tiles whose bounding box comes within `margin` (unit: a tile's area is 1) of a prototile's.

    Nearest first.

    Raises:
        OrbiflowError: for a tile of span over `MAX_SPAN`, or with fewer than three vertices.
    """
    scale = math.sqrt(tiling.tile_area)
    if span(tiling) > MAX_SPAN:
        raise OrbiflowError(
            f"the tile reaches {span(tiling):.0f} times the size that its group allows for; "
            "polygon and group do not belong together (are their units the same?)"
        )
    own = tiling.prototiles[prototile]
    if any(len(p.ring) < 3 for p in tiling.prototiles):
        raise OrbiflowError("the tile's polygon has fewer than three distinct vertices")
    (left, bottom), (right, top) = own.box + margin * scale * np.array([[-1.0], [1.0]])
    near = copies_near(tiling, (left, bottom, right, top), whole=False)
    itself = (near.aspects == tiling.aspects.table[prototile, 0]) & ~near.cells.any(axis=1)
    away = np.linalg.norm(near.centers() - own.center, axis=1)
    away[itself] = np.inf
    order = np.argsort(away, kind="stable")[: len(near) - int(itself.sum())]
    near = near.select(order)
    rings = [p.ring for p in tiling.prototiles]
    counts = np.array([len(ring) for ring in rings])[near.prototiles]
    points = np.empty((int(counts.sum()), 2))
    first = np.cumsum(counts) - counts
    for k, ring in enumerate(rings):
        mine = np.flatnonzero(near.prototiles == k)
        rows = first[mine, None] + np.arange(len(ring))
        points[rows] = near.select(mine).images(ring)
    linear = tiling.group.linear_parts
    signs = linear[:, 0, 0] * linear[:, 1, 1] - linear[:, 0, 1] * linear[:, 1, 0]
    return Surroundings(
        prototile,
        _flushed((own.ring - own.center) / scale),
        near,
        _flushed((points - own.center) / scale),
        counts,
        (signs < 0)[near.cosets],
    )


def _flushed(points: Array) -> Array:
    # squares of coordinates such as 1e-200 underflow in GEOS and give areas that are plainly wrong
    return np.where(np.abs(points) < 1e-15, 0.0, points)
