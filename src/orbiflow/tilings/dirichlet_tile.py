"""Dirichlet cells: tiles of every group."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import Voronoi

from orbiflow.arguments import instance, numbers
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import CrystallographicGroup
from orbiflow.symmetry.isometry import Array
from orbiflow.symmetry.lattices import reduced_basis
from orbiflow.tilings.tile import Tile

_SAME = 1e-7
"""Points nearer than this, in square roots of |det B|, are one."""


def dirichlet_tile(group: CrystallographicGroup, point: ArrayLike) -> Tile:
    """The points nearer to `point` than to any other of its images, as a tile.

    Convex, and it tiles edge to edge. Its stabiliser is that of the point: about a rotation centre or
    on a mirror the cell has that symmetry.

    Args:
        group: of the plane.
        point: (2,), in the group's units.

    Raises:
        OrbiflowError: for what is no point, or a group that is not of the plane.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> hexagon = dirichlet_tile(wallpaper_group("p6m"), (0.0, 0.0))
    >>> len(hexagon.polygon), hexagon.tiling.stabilisers[0].order
    (6, 12)
    """
    instance(group, CrystallographicGroup, "the group", "wallpaper_group(name) makes one")
    if group.dim != 2:
        raise OrbiflowError(f"a tile needs a group of the plane, got dimension {group.dim}")
    site = numbers(point, "the point of a Dirichlet cell", (2,))
    same = _SAME * float(np.sqrt(group.cell_volume))
    # no point is further from the site's images than half the two shortest lattice vectors together
    reach = float(np.linalg.norm(reduced_basis(group.lattice), axis=0).sum())
    images = np.stack([g(site) for g in group.elements_near(site, 2.01 * reach, source=site)])
    sites = _distinct(images - site, same)
    cell = Voronoi(np.concatenate([np.zeros((1, 2)), sites[np.linalg.norm(sites, axis=1) > same]]))
    region = cell.regions[cell.point_region[0]]
    corners = cell.vertices[region]
    corners = corners[np.argsort(np.arctan2(corners[:, 1], corners[:, 0]))]
    steps = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
    return Tile(corners[steps > 1e-2 * same] + site, group)


def _distinct(points: Array, apart: float) -> Array:
    """One of each set of points that lie together."""
    kept: list[Array] = []
    for point in points:
        if all(np.abs(point - other).max() > apart for other in kept):
            kept.append(point)
    return np.array(kept)
