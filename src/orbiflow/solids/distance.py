"""How far points are from a closed surface, inside or outside, and which points are inside."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np
from scipy.spatial import cKDTree

from orbiflow.arrays import Array, Integers
from orbiflow.solids.mesh import Mesh

NEIGHBOURS = 8  # points of the surface that a distance is taken from
AT_ONCE = 50_000  # points that are asked for, so that memory stays small
FAR = 4.0  # spacings from the surface at which a distance is that to one point
SLANTED = 0.6  # cosine between normal and direction below which one point may mislead
EVEN = 1.3  # distance of points on a surface over the mean, to be even


@dataclass(frozen=True, eq=False)
class SignedDistance:
    """The signed distance to a surface, given by points on it and their outer normals; negative inside.

    Near the surface it is the mean of the distances to the tangent planes of the nearest points
    (implicit moving least squares: Kolluri, 2008), so that it is smooth; far away it is the distance to
    the nearest point with that mean's sign. Inside, a weight at each point multiplies it: that of the
    nearest points.

    - `points`, `normals`: (N, 3).
    - `spacing`: The mean distance of neighbouring points.
    - `weights`: (N,), or None for 1.

    >>> normals = np.random.default_rng(0).normal(size=(4000, 3))
    >>> normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    >>> sphere = SignedDistance(2 * normals, normals, 0.12)
    >>> sphere(np.array([[0.0, 0.0, 1.9], [0.0, 3.0, 0.0]])).round(2).tolist()
    [-0.1, 1.0]
    """

    points: Array
    normals: Array
    spacing: float
    weights: Array | None = None

    @cached_property
    def tree(self) -> cKDTree:
        """Finds the surface's points."""
        return cKDTree(self.points)

    @classmethod
    def of_mesh(cls, mesh: Mesh, spacing: float) -> SignedDistance:
        """Return the distance to a mesh, from points that lie on it about so far from each other."""
        points, normals = surface_points(mesh, spacing)
        return cls(points, normals, spacing)

    def __call__(self, points: Array) -> Array:
        """Return the distances (n,) of points (n, 3)."""
        distances = np.empty(len(points))
        for start in range(0, len(points), AT_ONCE):
            part = slice(start, start + AT_ONCE)
            distances[part] = self._quickly(points[part])
        return distances

    def _quickly(self, points: Array) -> Array:
        """Return distances, by one point of the surface where that is in no doubt: far away."""
        away: Array
        near: Integers
        away, near = cast(Any, self.tree.query(points, 1))
        plane = ((points - self.points[near]) * self.normals[near]).sum(axis=1)
        distances = np.copysign(away, plane)
        if self.weights is not None:
            distances *= np.where(distances < 0, self.weights[near], 1.0)
        some = np.flatnonzero((away < FAR * self.spacing) | (abs(plane) < SLANTED * away))
        distances[some], _ = self.with_nearest(points[some])
        return distances

    def with_nearest(self, points: Array) -> tuple[Array, Integers]:
        """Return the distances (n,) of points (n, 3), and the nearest of the surface's points (n,)."""
        away: Array
        near: Integers
        away, near = cast(Any, self.tree.query(points, NEIGHBOURS))
        least = away[:, :1]
        share = np.exp(-(away**2 - least**2) / (self.spacing**2 + (0.5 * least) ** 2))
        share /= share.sum(axis=1, keepdims=True)
        planes = np.einsum("nkj,nkj->nk", points[:, None] - self.points[near], self.normals[near])
        flat = (share * planes).sum(axis=1)
        far = np.clip(2 * least[:, 0] / (FAR * self.spacing) - 1, 0, 1)
        distances = (1 - far) * flat + far * np.copysign(least[:, 0], flat)
        if self.weights is not None:
            distances *= np.where(distances < 0, (share * self.weights[near]).sum(axis=1), 1.0)
        return distances, near[:, 0]


def surface_points(mesh: Mesh, spacing: float) -> tuple[Array, Array]:
    """Return points (n, 3) on a mesh, about `spacing` from each other, and outer normals (n, 3).

    Vertices are among them; larger triangles are divided evenly.
    """
    corners, normals = mesh.corners, mesh.normals[mesh.faces]
    flat = mesh.face_vectors / np.maximum(
        np.linalg.norm(mesh.face_vectors, axis=1, keepdims=True), 1e-300
    )
    sides = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).max(axis=1)
    counts = np.minimum(np.ceil(sides / (EVEN * spacing)).astype(int), 64)
    points, directions = [mesh.points], [mesh.normals]
    for count in np.unique(counts[counts > 1]):
        faces = counts == count
        i, j = (k.ravel() for k in np.meshgrid(np.arange(count + 1), np.arange(count + 1)))
        shares = np.stack([i, j, count - i - j], axis=1)[i + j <= count] / count
        shares = shares[shares.max(axis=1) < 1]
        points.append(np.einsum("sk,fkj->fsj", shares, corners[faces]).reshape(-1, 3))
        # half of the face's own normal, or creases would be rounded off over large faces
        mixed = 0.5 * np.einsum("sk,fkj->fsj", shares, normals[faces]) + 0.5 * flat[faces][:, None]
        directions.append(mixed.reshape(-1, 3))
    spots, ways = np.concatenate(points), np.concatenate(directions)
    _, first = np.unique(
        np.round(spots / (0.3 * spacing)).astype(np.int64), axis=0, return_index=True
    )
    ways = ways[first]
    return spots[first], ways / np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-12)


def points_inside(mesh: Mesh, spacing: float) -> Array:
    """Return the points (n, 3) of a cubic grid, one for all meshes, that are inside a closed mesh."""
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    # a little off, so that no column of the grid runs along an edge
    off = np.array([1.3e-5, 2.7e-5, 0.0])
    low = spacing * (np.floor(low / spacing) + off)
    counts = np.maximum(np.ceil((high - low) / spacing).astype(int), 1)
    wound = np.zeros(counts, dtype=np.int32)
    column, height, sign = _crossings(mesh, low, spacing, counts)
    level = np.clip(np.ceil(height).astype(int), 0, counts[2])
    kept = level < counts[2]
    np.add.at(wound, (*column[kept].T, level[kept]), sign[kept])
    return low + spacing * np.argwhere(np.cumsum(wound, axis=2) > 0)


def _crossings(
    mesh: Mesh, low: Array, spacing: float, counts: Integers
) -> tuple[Integers, Array, Integers]:
    """Return where a grid's columns cross faces: (n, 2), at which step, and +1 where they enter."""
    corners = (mesh.corners - low) / spacing
    flat = corners[..., :2]
    first = np.maximum(np.ceil(flat.min(axis=1)).astype(int), 0)
    last = np.minimum(np.floor(flat.max(axis=1)).astype(int), counts[:2] - 1)
    sizes = np.maximum(last - first + 1, 0)
    number = sizes.prod(axis=1)
    face = np.repeat(np.arange(len(corners)), number)
    k = np.arange(len(face)) - np.repeat(np.cumsum(number) - number, number)
    column = first[face] + np.stack([k // sizes[face, 1], k % sizes[face, 1]], axis=1)
    a, b, c = np.moveaxis(corners[face], 1, 0)
    left, right, at = b - a, c - a, column - a[:, :2]
    twice = left[:, 0] * right[:, 1] - left[:, 1] * right[:, 0]
    twice = np.where(twice == 0, 1e-300, twice)
    u = (at[:, 0] * right[:, 1] - at[:, 1] * right[:, 0]) / twice
    v = (left[:, 0] * at[:, 1] - left[:, 1] * at[:, 0]) / twice
    met = (u >= 0) & (v >= 0) & (u + v <= 1)
    height = a[:, 2] + u * left[:, 2] + v * right[:, 2]
    return column[met], height[met], -np.sign(twice[met]).astype(int)
