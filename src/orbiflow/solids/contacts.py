"""Where a tile touches its neighbours, and in which directions it may leave them to begin with."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import scipy.sparse
import shapely
from scipy.optimize import linprog
from scipy.spatial import HalfspaceIntersection, cKDTree

from orbiflow.arrays import Array, Integers
from orbiflow.errors import OrbiflowError
from orbiflow.solids.mesh import Mesh
from orbiflow.symmetry import CrystallographicGroup, Isometry

SAME_PLACE = 1e-6
"""Distance, as a share of the tile's size, below which places are the same."""

ALONG = 1e-5
"""How far a direction may point into a face, as a sine, and still slide along it."""

LONG = 1e4
"""Length of a direction, by which it leaves a face at a distance of 1, and is not along it."""

SAME_NORMAL = 7
"""Decimals to which normals are compared."""


class Contact(NamedTuple):
    """A neighbour of a tile, and where the tile touches it.

    - `element`: The element of the group that takes the tile to the neighbour.
    - `faces`: The numbers of the tile's faces that touch it.
    - `area`: The area of the contact.
    """

    element: Isometry
    faces: Integers
    area: float


def contacts(group: CrystallographicGroup, tile: Mesh) -> list[Contact]:
    """Return the neighbours that a tile touches along a surface, the largest contact first.

    Faces of two copies touch where they lie in one plane, back to back, and overlap; they need not
    be the same triangles.
    """
    center = (tile.points.min(axis=0) + tile.points.max(axis=0)) / 2
    radius = float(np.linalg.norm(tile.points - center, axis=1).max())
    touching = list[Contact]()
    for element in group.elements_near(center, 2 * radius + SAME_PLACE, source=center):
        if np.allclose(element.linear, np.eye(3)) and np.abs(element.translation).max() < 1e-9:
            continue
        faces, area = _touching(tile, element, SAME_PLACE * radius)
        if len(faces):
            touching.append(Contact(element, faces, area))
    return sorted(touching, key=lambda contact: -contact.area)


def _touching(tile: Mesh, element: Isometry, near: float) -> tuple[Integers, float]:
    """Return the faces of a tile that touch its image, and the area of the contact."""
    other = tile.moved(element.linear, element.translation)
    mine, its = _in_box(tile, other.points, near), _in_box(other, tile.points, near)
    if not len(mine) or not len(its):
        return mine[:0], 0.0
    middles, its_middles = tile.corners[mine].mean(axis=1), other.corners[its].mean(axis=1)
    reach, its_reach = (
        float(np.linalg.norm(c - c.mean(axis=1, keepdims=True), axis=2).max())
        for c in (tile.corners[mine], other.corners[its])
    )
    # most contacts are of equal triangles
    nearest = cKDTree(its_middles).query(middles)
    distance, place = np.asarray(nearest[0]), np.asarray(nearest[1], np.int64)
    area = np.linalg.norm(tile.face_vectors[mine], axis=1) / 2
    same = (distance < near) & _back_to_back(tile, mine, other, its[place], near)
    rest, its_rest = mine[~same], np.setdiff1d(np.arange(len(its)), place[same])
    if not len(rest) or not len(its_rest):
        return mine[same], float(area[same].sum())
    tree, its_tree = cKDTree(middles[~same]), cKDTree(its_middles[its_rest])
    pairs = tree.query_ball_tree(its_tree, reach + its_reach)
    first = np.repeat(np.arange(len(rest)), [len(places) for places in pairs])
    second = np.array([k for places in pairs for k in places], np.int64)
    left, right = rest[first], its[its_rest[second]]
    plane = _back_to_back(tile, left, other, right, near)
    shared = _common_areas(tile, left[plane], other, right[plane])
    touching = shared > near**2
    faces = np.union1d(mine[same], left[plane][touching])
    return faces, float(area[same].sum() + shared[touching].sum())


def _in_box(mesh: Mesh, points: Array, near: float) -> Integers:
    """Return the numbers of the faces whose boxes meet the box around points."""
    first, second, third = (mesh.points[mesh.faces[:, k]] for k in range(3))
    most = np.maximum(np.maximum(first, second), third) >= points.min(axis=0) - near
    least = np.minimum(np.minimum(first, second), third) <= points.max(axis=0) + near
    both = most & least
    return np.flatnonzero(both[:, 0] & both[:, 1] & both[:, 2])


def _back_to_back(mesh: Mesh, first: Integers, other: Mesh, second: Integers, near: float) -> Array:
    """Return for pairs of faces whether they lie in one plane, with opposite normals."""
    normals, its = (
        v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-300)
        for v in (mesh.face_vectors[first], other.face_vectors[second])
    )
    steps = other.corners[second] - mesh.corners[first][:, :1]
    flat = np.abs(np.einsum("nkj,nj->nk", steps, normals)).max(axis=1) < near
    return flat & (np.einsum("ij,ij->i", normals, its) < -0.99)


def _common_areas(mesh: Mesh, first: Integers, other: Mesh, second: Integers) -> Array:
    """Return the areas that pairs of faces in one plane have in common."""
    if not len(first):
        return np.zeros(0)
    corners, its = mesh.corners[first], other.corners[second]
    along = corners[:, 1] - corners[:, 0]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    normals = mesh.face_vectors[first]
    across = np.cross(normals / np.linalg.norm(normals, axis=1, keepdims=True), along)
    axes = np.stack([along, across], axis=2)
    flat, its_flat = ((c - corners[:, :1]) @ axes for c in (corners, its))
    common = shapely.intersection(shapely.polygons(flat), shapely.polygons(its_flat))
    return np.asarray(shapely.area(common))


class FreeCone(NamedTuple):
    """The directions in which a tile may leave its neighbours, to begin with.

    - `rays`: Unit vectors (r, 3) whose sums with positive shares are all of them.
    - `middle`: The direction (3,) that leaves all faces fastest; None if there is none.
    - `dimension`: 0 if the tile is locked; 1 on a line; 2 in a plane; 3 in space.
    """

    rays: Array
    middle: Array | None
    dimension: int


def free_cone(normals: Array) -> FreeCone:
    """Return the directions that point into none of the faces with these outer normals (n, 3).

    A direction d is free where d . n <= 0 for each normal n: an intersection of half-spaces, found by
    linear programmes; directions along faces, as a drawer has them, are found too.
    """
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    units = np.unique(
        (normals / np.maximum(lengths, 1e-300))[lengths[:, 0] > 0].round(SAME_NORMAL), axis=0
    )
    if not len(units):
        return FreeCone(np.concatenate([np.eye(3), -np.eye(3)]), np.array([0.0, 0.0, 1.0]), 3)
    # the deepest direction: d . n <= -t for all normals
    rows = np.column_stack([units, np.ones(len(units))])
    bounds = [(-1.0, 1.0)] * 3 + [(0.0, 1.0)]
    best = linprog([0, 0, 0, -1], rows, np.zeros(len(units)), bounds=bounds, method="highs")
    if best.x is None:
        raise OrbiflowError(f"the free directions could not be found: {best.message}")
    if best.x[3] > 10 * ALONG:
        middle = best.x[:3] / np.linalg.norm(best.x[:3])
        return FreeCone(_rays(units, best.x[:3]), middle, 3)
    return _thin_cone(units)


def _rays(units: Array, inside: Array) -> Array:
    """Return the directions to the corners of a cone that is cut off by a box, given a place within."""
    box = np.concatenate([np.eye(3), -np.eye(3)])
    planes = np.column_stack([np.concatenate([units, box]), [0.0] * len(units) + [-1.0] * 6])
    # the place is on the box, and half of it is well inside of all planes
    corners = HalfspaceIntersection(planes, 0.5 * inside).intersections
    corners = corners[np.linalg.norm(corners, axis=1) > 1e-6]
    corners /= np.linalg.norm(corners, axis=1, keepdims=True)
    return np.unique(corners.round(9), axis=0)


def _thin_cone(units: Array) -> FreeCone:
    """Return a cone that has no inside: a plane's sector, a ray, a line, or nothing."""
    count = len(units)
    # each normal that some free direction leaves gets a slack of 1
    cost = np.concatenate([np.zeros(3), -np.ones(count)])
    rows: Any = scipy.sparse.hstack([scipy.sparse.csr_matrix(units), scipy.sparse.eye(count)])
    bounds = [(-LONG, LONG)] * 3 + [(0.0, 1.0)] * count
    best = linprog(cost, rows, np.full(count, ALONG / 10), bounds=bounds, method="highs")
    tight = units if best.x is None else units[best.x[3:] < 0.5]
    squares, vectors = np.linalg.eigh(tight.T @ tight)
    axes: Array = vectors.T[::-1]
    rank = int((squares > (10 * ALONG) ** 2).sum())
    plane = axes[rank:]
    if rank == 3:
        return FreeCone(np.zeros((0, 3)), None, 0)
    if rank == 2:
        rays = np.array([sign * plane[0] for sign in (1, -1) if _is_free(units, sign * plane[0])])
        return FreeCone(rays.reshape(-1, 3), rays[0] if len(rays) else None, min(len(rays), 1))
    angles = np.linspace(0, 2 * np.pi, 7200, endpoint=False)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1) @ plane[:2]
    loose = units[np.abs(units @ plane[:2].T).max(axis=1) > 10 * ALONG]
    edges = np.cross(loose, np.cross(*plane[:2]))
    edges /= np.maximum(np.linalg.norm(edges, axis=1, keepdims=True), 1e-300)
    tried = np.concatenate([edges, -edges, circle[::1800]])
    rays = tried[(tried @ units.T <= ALONG).all(axis=1)]
    free = circle[(circle @ units.T <= ALONG).all(axis=1)]
    if not len(rays):
        return FreeCone(np.zeros((0, 3)), None, 0)
    deepest = free if len(free) else rays
    middle = deepest[(deepest @ units.T).clip(None, 0).mean(axis=1).argmin()]
    return FreeCone(np.unique(rays.round(9), axis=0), middle, 2)


def _is_free(units: Array, direction: Array) -> bool:
    return bool((units @ direction <= ALONG).all())
