"""The images of a tile around it, in coordinates where a tile has area one."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orbiflow.errors import OrbiflowError
from orbiflow.geometry import signed_area
from orbiflow.symmetry import Isometry
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings.tile import Tile

MAX_SPAN = 12.0
"""Largest radius of a tile, in square roots of its group's area, whose images are listed."""


def expected_area(tile: Tile) -> float:
    """|det B| / order: the area of a tile of this group."""
    return tile.group.cell_volume / tile.group.order


def span(tile: Tile) -> float:
    """Radius of the tile over the square root of the expected area: about 0.6 for a hexagon."""
    return tile.radius / math.sqrt(expected_area(tile))


@dataclass(frozen=True, eq=False)
class Surroundings:
    """A tile and its images nearby, moved and scaled so that the expected area is one.

    Args:
        ring: (N, 2) the tile, counter-clockwise, without repeated vertices, centred at zero.
        elements: the group elements of the images, in the tile's own coordinates; not the identity.
        images: (M, N, 2) images of `ring` vertex by vertex: clockwise where the element reverses
            orientation.
        mirrored: (M,) whether the element reverses orientation.
    """

    ring: Array
    elements: tuple[Isometry, ...]
    images: Array
    mirrored: NDArray[np.bool_]

    def select(self, keep: NDArray[np.bool_]) -> Surroundings:
        """The images where `keep`, (M,), is true."""
        elements = tuple(g for g, kept in zip(self.elements, keep, strict=True) if kept)
        return Surroundings(self.ring, elements, self.images[keep], self.mirrored[keep])


def surroundings(tile: Tile, margin: float) -> Surroundings:
    """The images whose bounding box comes within `margin` (unit: a tile's area is 1) of the tile's.

    Raises:
        OrbiflowError: for a tile of span over `MAX_SPAN`, or with fewer than three vertices.
    """
    scale = math.sqrt(expected_area(tile))
    if span(tile) > MAX_SPAN:
        raise OrbiflowError(
            f"the tile reaches {span(tile):.0f} times the size that its group allows for; "
            "polygon and group do not belong together (are their units the same?)"
        )
    polygon = _without_repeats(tile.polygon, 1e-12 * scale)
    if len(polygon) < 3:
        raise OrbiflowError("the tile's polygon has fewer than three distinct vertices")
    if signed_area(polygon) < 0:
        polygon = polygon[::-1]
    center = tile.center
    reach = 2 * tile.radius + math.sqrt(2.0) * margin * scale
    elements = tuple(
        g
        for g in tile.group.elements_near(center, reach, source=center)
        if not _is_identity(g, scale)
    )
    ring = _flushed((polygon - center) / scale)
    if not elements:
        return Surroundings(ring, (), np.empty((0, *ring.shape)), np.zeros(0, dtype=bool))
    images = _flushed(np.stack([(g(polygon) - center) / scale for g in elements]))
    mirrored = np.array([g.determinant < 0 for g in elements])
    around = Surroundings(ring, elements, images, mirrored)
    low, high = ring.min(axis=0) - margin, ring.max(axis=0) + margin
    near = (images.min(axis=1) <= high).all(axis=1) & (images.max(axis=1) >= low).all(axis=1)
    return around.select(near)


def _is_identity(element: Isometry, scale: float) -> bool:
    # rounding of a group far from the origin is well below this, its translations well above
    still = float(np.linalg.norm(element.translation)) < 1e-6 * scale
    return still and bool(np.abs(element.linear - np.eye(2)).max() < 1e-6)


def _flushed(points: Array) -> Array:
    # squares of coordinates such as 1e-200 underflow in GEOS and give areas that are plainly wrong
    return np.where(np.abs(points) < 1e-15, 0.0, points)


def _without_repeats(polygon: Array, shortest: float) -> Array:
    steps = np.linalg.norm(polygon - np.roll(polygon, -1, axis=0), axis=1)
    return polygon[steps > shortest]
