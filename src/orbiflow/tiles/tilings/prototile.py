"""Prototiles, the polygons whose images make up a tiling, and their symmetries."""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np
import shapely

from orbiflow.arrays import Array, Integers
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_array, as_whole
from orbiflow.symmetry import CrystallographicGroup, Isometry
from orbiflow.tiles.geometry import signed_area

# the distance, in radii of the tile, below which consecutive vertices count as one
_REPEATED_DISTANCE = 1e-12


@dataclass(frozen=True, eq=False)
class Prototile:
    """A closed polygon whose images are tiles.

    Args:
        polygon: The vertices (N, 2) in order, in either orientation, without repeating the first.
        corners: The indices of vertices that matter to the caller, in order, such as the tiling
            vertices of an isohedral class.

    Raises:
        OrbiflowError: if the polygon is not (N >= 3, 2) finite numbers, or a corner is not a vertex.
    """

    polygon: Array
    corners: tuple[int, ...] = field(default=())

    def __post_init__(self) -> None:
        polygon = as_array(self.polygon, "the tile's polygon", ("N", 2))
        if len(polygon) < 3:
            raise OrbiflowError(f"the tile's polygon needs at least 3 vertices, got {len(polygon)}")
        corners = tuple(
            as_whole(k, "a tile's corner, an index of its vertices,", 0, len(polygon) - 1)
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
        """The lower left and upper right corner (2, 2) of the bounding box."""
        return np.stack([self.polygon.min(axis=0), self.polygon.max(axis=0)])

    @cached_property
    def center(self) -> Array:
        """The centre (2,) of the bounding box."""
        return (self.box[0] + self.box[1]) / 2

    @cached_property
    def radius(self) -> float:
        """Largest distance of a vertex from `center`."""
        return float(np.linalg.norm(self.polygon - self.center, axis=1).max())

    @cached_property
    def kept(self) -> Integers:
        """The indices of the vertices that differ from the next one."""
        steps = np.linalg.norm(self.polygon - np.roll(self.polygon, -1, axis=0), axis=1)
        return np.flatnonzero(steps > _REPEATED_DISTANCE * self.radius)

    @cached_property
    def ring(self) -> Array:
        """The polygon (M, 2) without repeated vertices."""
        return self.polygon[self.kept]


SYMMETRY_TOLERANCE = 1e-5
"""The largest deviation of a symmetric polygon from symmetry, in square roots of |det B| / |G|.

`certify` measures the actual error. The tolerance cannot be too generous for a tile: an element that
takes it only nearly onto itself would make two tiles overlap.
"""


class Stabiliser(NamedTuple):
    """The finite group of a polygon's symmetries within a crystallographic group.

    - `elements`: The elements, the identity first.
    - `orders`: For each element the indices (N,) of the images: vertex `orders[i]` is the image of
      vertex i. None where the curve is symmetric, but not vertex by vertex.
    - `error`: The largest distance of an image from the polygon, in its units.
    """

    elements: tuple[Isometry, ...]
    orders: tuple[Integers | None, ...]
    error: float

    @property
    def order(self) -> int:
        """The number of elements."""
        return len(self.elements)


def stabiliser(group: CrystallographicGroup, ring: Array) -> Stabiliser:
    """Return all elements of `group` that take the polygon `ring` (N, 2) onto itself.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> cell = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    >>> stabiliser(wallpaper_group("p4m"), cell).order
    8
    """
    size = math.sqrt(group.cell_volume / group.order)
    candidates = _near_center(group, ring, SYMMETRY_TOLERANCE * size) if len(ring) > 2 else []
    still = np.arange(len(ring))
    symmetries: list[tuple[Isometry, Integers | None, float]] = []
    for element in candidates:
        order, error = _image_order(element, ring)
        if error <= SYMMETRY_TOLERANCE * size:
            symmetries.append((element, order, error))
    # a polygon may be symmetric only within the tolerance: drop the worst until they form a group
    while not _closed([element for element, _, _ in symmetries]):
        worst = max(error for _, _, error in symmetries)
        symmetries = [item for item in symmetries if item[2] < worst]
    elements = (Isometry(np.eye(2), np.zeros(2)), *(element for element, _, _ in symmetries))
    orders = (still, *(order for _, order, _ in symmetries))
    return Stabiliser(elements, orders, max((error for _, _, error in symmetries), default=0.0))


def free_subgroup(
    group: CrystallographicGroup, symmetries: Sequence[Isometry]
) -> CrystallographicGroup | None:
    """Return a subgroup that takes a tile with these symmetries to each other one in one way only.

    It has the lattice of the group. None if there is no such subgroup.

    >>> from orbiflow.symmetry import Line, identity, reflection, wallpaper_group
    >>> mirror = reflection(Line([0.0, 0.0], [0.0, 1.0]))
    >>> free_subgroup(wallpaper_group("p4m"), [identity(2), mirror]).order
    4
    """
    order = group.order // len(symmetries)
    held = [g @ s @ g.inverse() for g in group.cosets for s in symmetries[1:]]
    for generators in combinations_with_replacement(group.cosets, 2):
        subgroup = CrystallographicGroup.generate(group.lattice, generators)
        if subgroup.order == order and not any(subgroup.contains(element) for element in held):
            return subgroup
    return None


def _near_center(group: CrystallographicGroup, ring: Array, reach: float) -> list[Isometry]:
    """Return the elements, but for the identity, that move the boundary's centre at most so far."""
    if group.order == 1:
        return []
    ahead = np.roll(ring, -1, axis=0)
    lengths = np.linalg.norm(ahead - ring, axis=1)
    center = lengths @ (ring + ahead) / (2 * lengths.sum())
    away: Array = group.images(center) - center
    steps = np.round(away @ group.inverse_lattice.T)
    rest = np.linalg.norm(away - steps @ group.lattice.T, axis=1)
    return [
        Isometry(group.linear_parts[i], group.translations[i] - group.lattice @ steps[i])
        for i in np.flatnonzero(rest <= reach)
        if np.abs(group.linear_parts[i] - np.eye(2)).max() > 1e-6
    ]


def _image_order(element: Isometry, ring: Array) -> tuple[Integers | None, float]:
    """Return the vertex that each vertex is taken to, and the largest error."""
    image, count = element(ring), len(ring)
    step = 1 if element.determinant > 0 else -1
    first = int(np.linalg.norm(ring - image[0], axis=1).argmin())
    order = (first + step * np.arange(count)) % count
    error = float(np.linalg.norm(image - ring[order], axis=1).max())
    curve = shapely.linearrings(ring)
    both = shapely.points(np.concatenate([image, element.inverse()(ring)]))
    as_curve = float(shapely.distance(curve, both).max())
    # vertices correspond if they are about as near to vertices as to the curve
    near = error <= 4 * as_curve + 1e-9 * float(np.ptp(ring))
    return (order, error) if near else (None, as_curve)


def _closed(elements: list[Isometry]) -> bool:
    # elements that fix one point are determined by their linear parts
    parts = [np.eye(2), *(element.linear for element in elements)]
    products = (g @ h for g in parts for h in parts)
    return all(any(np.abs(gh - k).max() < 1e-6 for k in parts) for gh in products)
