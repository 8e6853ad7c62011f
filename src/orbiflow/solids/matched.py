"""Surfaces whose faces come in pairs under a group, divided so that pairs stay pairs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse
from scipy.spatial import cKDTree

from orbiflow.arrays import Array, Integers
from orbiflow.solids.mesh import Mesh
from orbiflow.solids.surfaces import TileSurface
from orbiflow.symmetry import CrystallographicGroup

SAME_PLACE = 1e-8
"""How near points are that are one."""

LONGER = 1.3
"""How much longer than one that is divided another edge of its face may be, and stay whole."""


@dataclass(frozen=True, eq=False)
class MatchedSurface:
    """A closed surface, and for each of its faces the one that an element takes to it, turned over.

    - `mesh`: The surface.
    - `linear`, `shift`: The element (M, 3, 3), (M, 3) whose copy is behind each face.
    - `partners`: The face (M,) that this element takes to it.
    """

    mesh: Mesh
    linear: Array
    shift: Array
    partners: Integers

    @classmethod
    def of(cls, group: CrystallographicGroup, surface: TileSurface) -> MatchedSurface:
        """Return the surface of a tile of cells of a group on its conventional lattice."""
        shift = group.translations[surface.cosets] + surface.shifts @ group.lattice.T
        return cls(surface.mesh, group.linear_parts[surface.cosets], shift, surface.partners)

    @cached_property
    def edge_lengths(self) -> Array:
        """(E,) of `mesh.edges`."""
        a, b = np.moveaxis(self.mesh.points[self.mesh.edges], 1, 0)
        return np.linalg.norm(a - b, axis=1)

    @cached_property
    def edge_of(self) -> Integers:
        """(M, 3) the number in `mesh.edges` of the edge from each corner to the next."""
        n = len(self.mesh.points)
        keys = self.mesh.edges @ (n, 1)
        half = np.sort(self.mesh.half_edges, axis=1) @ (n, 1)
        return np.searchsorted(keys, half).reshape(-1, 3)

    @cached_property
    def orbit_of_edges(self) -> Integers:
        """(E,) which edges elements of the group take to one another, over faces and their partners."""
        corners = self.mesh.corners
        middles = (corners + np.roll(corners, -1, axis=1)) / 2
        back = self._back(middles, np.arange(len(corners)))
        away = np.linalg.norm(back[:, :, None] - middles[self.partners][:, None], axis=3)
        other = np.take_along_axis(self.edge_of[self.partners], away.argmin(axis=2), axis=1)
        n = len(self.mesh.edges)
        links = (np.ones(other.size), (self.edge_of.ravel(), other.ravel()))
        graph = scipy.sparse.coo_matrix(links, (n, n))
        return scipy.sparse.csgraph.connected_components(graph, directed=False)[1].astype(np.int64)

    def orbit_means(self, group: CrystallographicGroup) -> scipy.sparse.csr_array:
        """Return the matrix (3 N, 3 N) that takes moves of points to their means over orbits.

        If points move by such means, faces still match, wherever the points are by then.
        """
        points, n = self.mesh.points, len(self.mesh.points)
        center = (points.min(axis=0) + points.max(axis=0)) / 2
        reach = 2 * float(np.linalg.norm(points - center, axis=1).max())
        tree = cKDTree(points)
        images, sources, turns = list[Integers](), list[Integers](), list[Array]()
        for element in group.elements_near(center, reach):
            away, nearest = tree.query(element(points), distance_upper_bound=SAME_PLACE)
            matched = np.flatnonzero(np.isfinite(away))
            images.append(np.asarray(nearest)[matched])
            sources.append(matched)
            turns.append(np.tile(element.linear, (len(matched), 1, 1)))
        rows, columns, parts = (np.concatenate(k) for k in (images, sources, turns))
        parts = parts / np.bincount(rows, minlength=n)[rows, None, None]
        order = np.argsort(rows, kind="stable")
        pointers = np.searchsorted(rows[order], np.arange(n + 1))
        data = (parts[order], columns[order], pointers)
        return scipy.sparse.bsr_array(data, shape=(3 * n, 3 * n)).tocsr()

    def with_points(self, points: Array) -> MatchedSurface:
        """Return the surface with its points elsewhere; pairs must still be pairs."""
        return replace(self, mesh=Mesh(points, self.mesh.faces))

    def divided(self, wanted: Array) -> MatchedSurface:
        """Return the surface with edges divided in their middles.

        Others are divided, too: all edges of their orbits, and those of faces that would be left thin.

        Args:
            wanted: A mask (E,) of `mesh.edges`.
        """
        orbit, of_faces = self.orbit_of_edges, self.edge_of
        sides, orbits = self.edge_lengths[of_faces], orbit[of_faces]
        while True:
            marked = np.zeros(orbit.max() + 1, bool)
            marked[orbit[wanted]] = True
            grown = marked[orbit]
            hit = grown[of_faces]
            least = np.where(hit, sides, np.inf).min(axis=1)
            # of two equivalent edges neither is first: the third is divided, too
            whole = np.flatnonzero((hit.sum(axis=1) == 2) & _two_alike(orbits, hit))
            grown[of_faces[whole]] = True
            grown[of_faces[sides > LONGER * least[:, None]]] = True
            if np.array_equal(grown, wanted):
                break
            wanted = grown
        cut = np.flatnonzero(wanted)
        number = np.full(len(wanted), -1)
        number[cut] = len(self.mesh.points) + np.arange(len(cut))
        middles = self.mesh.points[self.mesh.edges[cut]].mean(axis=1)
        points = np.concatenate([self.mesh.points, middles])
        faces, parents = _divided_faces(self.mesh.faces, number[of_faces], orbits)
        divided = replace(
            self,
            mesh=Mesh(points, faces),
            linear=self.linear[parents],
            shift=self.shift[parents],
            partners=np.zeros(len(faces), np.int64),
        )
        return replace(divided, partners=divided._partners_of(self.partners, parents))

    def _back(self, points: Array, faces: Integers) -> Array:
        """Return points (n, k, 3) moved by the inverse of the element behind a face (n,) each."""
        rest = points - self.shift[faces][:, None]
        return np.einsum("nji,nkj->nki", self.linear[faces], rest)

    def _partners_of(self, before: Integers, parents: Integers) -> Integers:
        """Return the partners (M,) of parts of faces, whose parents' partners are known."""
        centers = self.mesh.corners.mean(axis=1)
        back = self._back(centers[:, None], np.arange(len(centers)))[:, 0]
        order = np.argsort(parents, kind="stable")
        first = np.searchsorted(parents[order], before[parents])
        last = np.searchsorted(parents[order], before[parents], side="right") - 1
        among = order[np.minimum(first[:, None] + np.arange(4), last[:, None])]
        nearest = np.linalg.norm(centers[among] - back[:, None], axis=2).argmin(axis=1)
        return among[np.arange(len(among)), nearest]


def _two_alike(orbits: Integers, hit: Array) -> Array:
    """Return for faces of which two edges are hit (M, 3) whether these are of one orbit."""
    a, b, c = np.where(hit, orbits, -1 - np.arange(3)).T
    return (a == b) | (b == c) | (c == a)


def _divided_faces(
    faces: Integers, middles: Integers, orbits: Integers
) -> tuple[Integers, Integers]:
    """Return the parts (m, 3) of faces (M, 3), and which face (m,) each is of.

    Args:
        faces: The corners.
        middles: The points (M, 3) in the middles of their edges, -1 where there is none.
        orbits: The orbits (M, 3) of their edges.
    """
    count = (middles >= 0).sum(axis=1)
    # the first edge is the one that is divided alone, or stays whole alone
    first = np.where((count == 2)[:, None], middles < 0, middles >= 0).argmax(axis=1)
    turned = (first[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(faces, turned, axis=1).T
    ab, bc, ca = np.take_along_axis(middles, turned, axis=1).T
    _, second, third = np.take_along_axis(orbits, turned, axis=1).T
    parts = [
        (count == 0, (a, b, c)),
        *((count == 1, points) for points in ((a, ab, c), (ab, b, c))),
        (count == 2, (ca, bc, c)),
        *(((count == 2) & (second < third), points) for points in ((a, b, bc), (a, bc, ca))),
        *(((count == 2) & (second > third), points) for points in ((a, b, ca), (b, bc, ca))),
        *((count == 3, points) for points in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))),
    ]
    parents = [np.flatnonzero(chosen) for chosen, _ in parts]
    cut = [np.stack(points, axis=1)[chosen] for chosen, points in parts]
    return np.concatenate(cut), np.concatenate(parents).astype(np.int64)
