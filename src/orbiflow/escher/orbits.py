"""Which vertices of a tile are images of each other, and by which elements of its group."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orbiflow.escher.own_frame import OwnFrame
from orbiflow.symmetry import Isometry, identity
from orbiflow.symmetry.isometry import Array


@dataclass(frozen=True, eq=False)
class Orbits:
    """Of each of N vertices: vertex i is linear[i] p + shift[i] of p, the vertex `source[i]`.

    - `source`: (N,) a vertex that is its own source.
    - `linear`, `shift`: (N, 2, 2) and (N, 2), isometries of the own frame's group.
    - `fixed`: (N,) whether the vertex lies on a centre of rotation and cannot move.
    """

    source: NDArray[np.int64]
    linear: Array
    shift: Array
    fixed: NDArray[np.bool_]

    @classmethod
    def of(cls, own: OwnFrame) -> Orbits:
        """Of the vertices of a polygon."""
        links = _links(own)
        count = len(own.points)
        elements: list[Isometry | None] = [None] * count
        source, fixed = np.arange(count), np.zeros(count, dtype=bool)
        for root in range(count):
            if elements[root] is not None:
                continue
            elements[root] = identity(2)
            orbit = [root]
            for i in orbit:  # grows while it is walked
                for j, link in links[i]:
                    reached = link @ (elements[i] or identity(2))
                    known = elements[j]
                    if known is None:
                        elements[j], source[j] = reached, root
                        orbit.append(j)
                    elif not known.is_close(reached, 1e-6):
                        fixed[root] = True  # two ways there: an element leaves it where it is
            fixed[orbit] = fixed[root]
        found = [element or identity(2) for element in elements]
        linear, shift = (np.stack(part) for part in zip(*map(_parts, found), strict=True))
        return cls(source, linear, shift, fixed)

    def with_inner(self, count: int) -> Orbits:
        """And `count` vertices more, each its own source."""
        n = len(self.source)
        return Orbits(
            np.concatenate([self.source, np.arange(n, n + count)]),
            np.concatenate([self.linear, np.broadcast_to(np.eye(2), (count, 2, 2))]),
            np.concatenate([self.shift, np.zeros((count, 2))]),
            np.concatenate([self.fixed, np.zeros(count, dtype=bool)]),
        )

    def spread(self, points: Array) -> Array:
        """(N, 2) vertices; those that are sources, or fixed, are taken from `points` (N, 2)."""
        images = np.einsum("nij,nj->ni", self.linear, points[self.source]) + self.shift
        return np.where(self.fixed[:, None], points, images)


def _parts(element: Isometry) -> tuple[Array, Array]:
    return element.linear, element.translation


def _links(own: OwnFrame) -> list[list[tuple[int, Isometry]]]:
    """For each vertex i the vertices j and elements g with p_j = g p_i, one for each edge it is on."""
    count = len(own.points)
    links: list[list[tuple[int, Isometry]]] = [[] for _ in range(count)]
    bounds = [*own.starts, count]
    for pair in own.kind.identified_edges:
        element = pair.isometry
        back = element.inverse()
        first = np.arange(bounds[pair.first], bounds[pair.first + 1] + 1) % count
        second = np.arange(bounds[pair.second], bounds[pair.second + 1] + 1) % count
        if pair.reversed:
            second = second[::-1]
        for i, j in zip(first.tolist(), second.tolist(), strict=True):
            links[i].append((j, element))
            links[j].append((i, back))
    return links
