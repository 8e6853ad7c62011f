"""Maps of a triangulated silhouette without folds, for a given outline."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.optimize
import scipy.sparse
import scipy.sparse.linalg
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.silhouette.mesh import Mesh

MAX_SHARPENINGS = 30
"""The largest number of times that the penalty on folds is sharpened."""


def folded(mesh: Mesh, points: Array) -> NDArray[np.bool_]:
    """Return which triangles (M,) are flat or turned over with corners at `points` (N, 2)."""
    return _determinants(mesh, points) <= 0


def unfolded(mesh: Mesh, points: Array) -> Array:
    """Move the inner points of a map until no triangle is turned over.

    Foldover-free maps in few steps (Garanzha, Kaporin, Kudryavtseva, Protais, Ray and Sokolov,
    SIGGRAPH 2021): L-BFGS minimises the distortion |J|^2 / det J of each triangle, with det J
    bounded away from 0 by a shrinking parameter; if that fails, again from points each in the
    middle of its neighbours. Points on the outline stay in place.

    Args:
        mesh: The triangles at rest.
        points: The images (N, 2) of its points; those of the outline bound a simple polygon.

    Returns:
        The images (N, 2), unchanged if nothing was turned over.

    Raises:
        OrbiflowError: if triangles stay turned over.
    """
    if not folded(mesh, points).any():
        return points
    for start in (points, _spread(mesh, points)):  # the second is a start for tangled points
        found = _untangled(_Distortion(mesh, start))
        if found is not None:
            return found
    raise OrbiflowError(
        "the silhouette cannot be carried to this tile without folds: parts of it are too thin"
    )


def _untangled(work: _Distortion) -> Array | None:
    x = work.start
    for _ in range(MAX_SHARPENINGS):
        found = scipy.optimize.minimize(
            work.value, x, jac=True, method="L-BFGS-B", options={"maxiter": 60, "maxcor": 20}
        )
        x = found.x
        smallest = work.smallest(x)
        if smallest > 0:
            return work.points(x)
        work.sharpen(smallest)
    return None


def _spread(mesh: Mesh, points: Array) -> Array:
    """Return inner points in the middle of their neighbours (Tutte, 1963)."""
    fixed, count = mesh.size + len(mesh.sides), len(points)
    i, j = (np.concatenate([mesh.triangles[:, k] for k in turn]) for turn in ((0, 1, 2), (1, 2, 0)))
    ones = np.ones(2 * len(i))
    pairs = (np.concatenate([i, j]), np.concatenate([j, i]))
    touching: Any = scipy.sparse.csr_matrix((ones, pairs), shape=(count, count))
    degree: Any = scipy.sparse.diags(np.asarray(touching.sum(axis=1)).ravel())
    laplacian: Any = (degree - touching).tocsc()[fixed:]
    spread = points.copy()
    right = -(laplacian[:, :fixed] @ points[:fixed])
    inner: Any = scipy.sparse.linalg.spsolve(laplacian[:, fixed:].tocsc(), right)
    spread[fixed:] = inner
    return spread


class _Distortion:
    """The distortion as a function of the inner points, with its gradient."""

    def __init__(self, mesh: Mesh, points: Array) -> None:
        self.mesh, self.images = mesh, points.copy()
        self.fixed = mesh.size + len(mesh.sides)
        rest = mesh.points[mesh.triangles]
        edges = np.stack([rest[:, 1] - rest[:, 0], rest[:, 2] - rest[:, 0]], axis=2)
        self.inverse = np.linalg.inv(edges)
        self.area = np.linalg.det(edges) / 2
        self.area /= self.area.sum()
        self.start = points[self.fixed :].ravel()
        self.epsilon = 1.0
        self.sharpen(self.smallest(self.start))

    def points(self, x: Array) -> Array:
        images = self.images.copy()
        images[self.fixed :] = x.reshape(-1, 2)
        return images

    def smallest(self, x: Array) -> float:
        return float(np.linalg.det(self._jacobians(x)).min())

    def sharpen(self, smallest: float) -> None:
        """Bound the determinants less far from 0, so that the smallest still has an effect."""
        self.epsilon = min(0.5 * self.epsilon, 0.1 * abs(min(smallest, 0.0)) + 1e-6)

    def _jacobians(self, x: Array) -> Array:
        corners = self.points(x)[self.mesh.triangles]
        edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)
        return edges @ self.inverse

    def value(self, x: Array) -> tuple[float, Array]:
        j = self._jacobians(x)
        det: Array = np.linalg.det(j)
        root = np.sqrt(det**2 + self.epsilon**2)
        # (det + root) / 2 without cancellation
        bounded = np.where(det > 0, det + root, self.epsilon**2 / (root + abs(det))) / 2
        norm = (j**2).sum(axis=(1, 2))
        cofactor = np.stack(
            [np.stack([j[:, 1, 1], -j[:, 1, 0]], -1), np.stack([-j[:, 0, 1], j[:, 0, 0]], -1)], 1
        )
        energy = self.area * norm / bounded
        slope = -norm / (bounded * root)
        by_j = self.area[:, None, None] * (
            2 * j / bounded[:, None, None] + slope[:, None, None] * cofactor
        )
        by_edge = by_j @ np.swapaxes(self.inverse, 1, 2)
        gradient = np.zeros_like(self.images)
        for corner, part in ((1, by_edge[:, :, 0]), (2, by_edge[:, :, 1])):
            np.add.at(gradient, self.mesh.triangles[:, corner], part)
            np.add.at(gradient, self.mesh.triangles[:, 0], -part)
        return float(energy.sum()), gradient[self.fixed :].ravel()


def _determinants(mesh: Mesh, points: Array) -> Array:
    corners = points[mesh.triangles]
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
