"""Dirichlet cells: tiles of every group, and tilings by several of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import KDTree, Voronoi

from orbiflow.arguments import instance, numbers
from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import CrystallographicGroup, reduced_basis
from orbiflow.tiles.tilings.tiling import Tile, Tiling

_SAME_DISTANCE = 1e-7  # the distance, in square roots of |det B|, below which points count as one


def dirichlet_tile(group: CrystallographicGroup, point: ArrayLike) -> Tile:
    """Return the points nearer to `point` than to any other of its images, as a tile.

    The tile is convex and tiles edge to edge. Its stabiliser is that of the point: about a rotation
    centre or on a mirror the cell has that symmetry.

    Args:
        group: A group of the plane.
        point: A point (2,), in the group's units.

    Raises:
        OrbiflowError: if `point` is not a point, or the group is not of the plane.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> hexagon = dirichlet_tile(wallpaper_group("p6m"), (0.0, 0.0))
    >>> len(hexagon.polygon), hexagon.tiling.stabilisers[0].order
    (6, 12)
    """
    site = numbers(point, "the point of a Dirichlet cell", (2,))
    return Tile(dirichlet_tiling(group, [site]).prototiles[0].polygon, group)


def dirichlet_tiling(group: CrystallographicGroup, points: Sequence[ArrayLike]) -> Tiling:
    """Return the Dirichlet cells of several points among all their images: a prototile for each.

    Args:
        group: A group of the plane.
        points: Points (K, 2), none an image of another.

    Raises:
        OrbiflowError: if `points` are not points or are images of each other, or if the group is not
            of the plane.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> squares = dirichlet_tiling(wallpaper_group("p4m"), [(0, 0), (0.5, 0.5)])
    >>> [len(prototile.polygon) for prototile in squares.prototiles]
    [4, 4]
    """
    instance(group, CrystallographicGroup, "the group", "wallpaper_group(name) makes one")
    if group.dim != 2:
        raise OrbiflowError(f"a tile needs a group of the plane, got dimension {group.dim}")
    given = numbers(points, "the points of Dirichlet cells", ("K", 2))
    if not len(given):
        raise OrbiflowError("a Dirichlet tiling needs at least one point")
    same = _SAME_DISTANCE * float(np.sqrt(group.cell_volume))
    return Tiling(group, [_cell(group, given, k, same) for k in range(len(given))])


def _cell(group: CrystallographicGroup, points: Array, k: int, same: float) -> Array:
    """Return (N, 2) the cell of point k, counter-clockwise."""
    site = points[k]
    # no point of the cell is further from the site than half the two shortest lattice vectors
    # together, and what bounds the cell no further than twice that
    reach = 1.01 * float(np.linalg.norm(reduced_basis(group.lattice), axis=0).sum())
    images: list[Array] = []
    for number, point in enumerate(points):
        found = [g(point) - site for g in group.elements_near(site, reach, source=point)]
        if number != k and found and float(np.linalg.norm(found[0])) < same:
            raise OrbiflowError(
                f"points {k} and {number} of a Dirichlet tiling have the same images"
            )
        images += found
    others = np.array(images)
    others = others[np.linalg.norm(others, axis=1) > same]
    pairs = KDTree(others).query_pairs(same, output_type="ndarray")
    sites = np.concatenate([np.zeros((1, 2)), np.delete(others, pairs[:, 1], axis=0)])
    cell = Voronoi(sites)
    region = cell.regions[int(cell.point_region[0])]
    corners = cell.vertices[region]
    corners = corners[np.argsort(np.arctan2(corners[:, 1], corners[:, 0]))]
    # Qhull divides a vertex of four and more cells into several, rounding apart
    steps = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
    return corners[steps > same / 100] + site
