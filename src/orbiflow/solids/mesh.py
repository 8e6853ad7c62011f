"""Closed surfaces of triangles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike

from orbiflow.arrays import Array, Integers
from orbiflow.errors import OrbiflowError


@dataclass(frozen=True, eq=False)
class Mesh:
    """A surface of triangles, counter-clockwise as seen from outside.

    - `points`: Its vertices (N, 3).
    - `faces`: The three vertices of each triangle (M, 3).

    Raises `OrbiflowError` for arrays of another shape, for points that are not finite, and for faces
    of points that are not there.

    >>> corner = Mesh(np.vstack([np.zeros(3), np.eye(3)]), [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> corner.is_closed, round(6 * corner.volume, 12), corner.euler_number
    (True, 1.0, 2)
    """

    points: Array
    faces: Integers

    def __post_init__(self) -> None:
        points, faces = np.asarray(self.points, float), np.asarray(self.faces, np.int64)
        if points.ndim != 2 or points.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
            raise OrbiflowError(
                f"a mesh has points (N, 3) and faces (M, 3), got {points.shape} and {faces.shape}"
            )
        if not np.isfinite(points).all():
            raise OrbiflowError("a mesh has points that are not finite")
        if faces.size and not 0 <= faces.min() <= faces.max() < len(points):
            raise OrbiflowError("a mesh has faces of points that are not there")
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "faces", faces)

    @property
    def bounds(self) -> Array:
        """The least and greatest coordinates (2, 3)."""
        return np.stack([self.points.min(axis=0), self.points.max(axis=0)])

    @property
    def corners(self) -> Array:
        """The corners of all triangles (M, 3, 3)."""
        return self.points[self.faces]

    @cached_property
    def volume(self) -> float:
        """The enclosed volume; negative if the faces are seen clockwise from outside."""
        a, b, c = np.moveaxis(self.corners - self.points.mean(axis=0), 1, 0)
        return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6

    @property
    def centroid(self) -> Array:
        """The centre of mass (3,) of what is enclosed."""
        middle = self.points.mean(axis=0)
        corners = self.corners - middle
        parts = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
        return middle + parts @ corners.sum(axis=1) / (4 * parts.sum())

    @cached_property
    def face_vectors(self) -> Array:
        """For each face its outer normal, as long as twice its area (M, 3)."""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        return np.cross(b - a, c - a)

    def thin_faces(self, sine: float) -> Integers:
        """Return the triangles whose height is at most `sine` times their longest edge."""
        edges = self.corners - np.roll(self.corners, 1, axis=1)
        longest = np.einsum("nij,nij->ni", edges, edges).max(axis=1)
        return np.flatnonzero(np.linalg.norm(self.face_vectors, axis=1) <= sine * longest)

    @cached_property
    def normals(self) -> Array:
        """The outer unit normals at the points (N, 3), means of the faces' by their areas."""
        sums = self.sums_at_points(np.repeat(self.face_vectors, 3, axis=0))
        return sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-300)

    @property
    def area(self) -> float:
        """The area of the surface."""
        return float(np.linalg.norm(self.face_vectors, axis=1).sum()) / 2

    @cached_property
    def edges(self) -> Integers:
        """The pairs of points (E, 2) that share an edge, the smaller number first."""
        return np.unique(np.sort(self.half_edges, axis=1), axis=0)

    @property
    def half_edges(self) -> Integers:
        """The directed edges (3 M, 2) of all faces, face by face."""
        return np.stack([self.faces, np.roll(self.faces, -1, axis=1)], axis=2).reshape(-1, 2)

    @cached_property
    def is_closed(self) -> bool:
        """Whether each edge is of two faces that run along it in opposite directions."""
        there, back = (np.unique(e, axis=0) for e in (self.half_edges, self.half_edges[:, ::-1]))
        return len(there) == 3 * len(self.faces) > 0 and np.array_equal(there, back)

    @property
    def euler_number(self) -> int:
        """Vertices less edges plus faces: 2 for each piece without handles."""
        return len(np.unique(self.faces)) - len(self.edges) + len(self.faces)

    @cached_property
    def piece_of_faces(self) -> Integers:
        """(M,) which connected piece each face is of, from 0."""
        n = len(self.points)
        graph = scipy.sparse.coo_matrix((np.ones(len(self.edges)), self.edges.T), (n, n))
        labels = scipy.sparse.csgraph.connected_components(graph, directed=False)[1]
        return np.unique(labels[self.faces[:, 0]], return_inverse=True)[1]

    def pieces(self) -> list[Mesh]:
        """Return the connected pieces, the largest volume first."""
        numbers = self.piece_of_faces
        parts = [self.of_faces(numbers == k) for k in range(numbers.max(initial=-1) + 1)]
        return sorted(parts, key=lambda piece: -abs(piece.volume))

    def of_faces(self, kept: ArrayLike) -> Mesh:
        """Return the mesh of some faces, by a mask or numbers, with the points that they use."""
        faces = self.faces[np.asarray(kept)]
        used, numbers = np.unique(faces, return_inverse=True)
        return Mesh(self.points[used], numbers.reshape(-1, 3))

    def moved(self, linear: ArrayLike, shift: ArrayLike = (0.0, 0.0, 0.0)) -> Mesh:
        """Return the mesh under x -> linear x + shift; its faces turn if that is a reflection."""
        matrix = np.asarray(linear, float)
        faces = self.faces if np.linalg.det(matrix) > 0 else self.faces[:, ::-1]
        return Mesh(self.points @ matrix.T + np.asarray(shift, float), faces)

    def sums_at_points(self, values: Array) -> Array:
        """Return for each point the sum (N, 3) of values (3 M, 3) at the faces' corners."""
        where = self.faces.ravel()
        return np.stack([np.bincount(where, v, len(self.points)) for v in values.T], axis=1)


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Return one mesh of several, which keep their points apart."""
    starts = np.cumsum([0, *(len(mesh.points) for mesh in meshes[:-1])])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]
    return Mesh(np.concatenate([mesh.points for mesh in meshes]), np.concatenate(faces))
