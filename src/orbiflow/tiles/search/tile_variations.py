"""The linear space of the polygons that tile as one does, vertex by vertex.

The images of a tile's vertices under its group meet its vertices. So a vertex is free, or the image
of a free one; what elements of the group hold lies at their centre or on their mirror. If the group is
moved by p -> M p + b, where M commutes with the point group (design point 7), all this is linear in
the free vertices, M and b. Every simple polygon of that space tiles: sides match by construction, and
the number of tiles over a point (`certify`) cannot jump on the way from the first one.
"""

from typing import Any

import numpy as np
from scipy.spatial import KDTree

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.geometry import arc_lengths, signed_area
from orbiflow.tiles.tilings import Tile, commutant, edge_to_edge

MAX_POINTS = 2000  # vertices, since matrices are dense
SAME_POINT_DISTANCE = 1e-6  # in the lattice's basis: images this near to vertices are vertices


def divided_tile(tile: Tile, points: int) -> Tile:
    """Return the tile with a vertex where a neighbour has one, and its longer sides divided."""
    prototile = edge_to_edge(tile).prototiles[0]
    ring, along = prototile.ring, arc_lengths(prototile.ring)
    if len(ring) > MAX_POINTS:
        raise OrbiflowError(
            f"the tile has {len(ring)} vertices, more than {MAX_POINTS}: simplify it"
        )
    # matching sides have lengths that differ by rounding, and are divided alike
    pieces = np.ceil(np.diff(along) * (points / along[-1]) * (1 - 1e-6)).astype(np.int64)
    first, side = np.cumsum(pieces) - pieces, np.repeat(np.arange(len(pieces)), pieces)
    share = (np.arange(len(side)) - first[side]) / pieces[side]
    polygon = ring[side] + share[:, None] * (np.roll(ring, -1, axis=0) - ring)[side]
    corners = first[np.searchsorted(prototile.kept, prototile.corners)] if prototile.corners else ()
    return Tile(polygon, tile.group, tile.isohedral_class, tuple(int(c) for c in corners))


class TileVariations:
    """The linear space of the polygons that tile as a given tile does, vertex by vertex.

    Parameters are the free vertices, M over a basis of what commutes with the point group, and b;
    `matrix` (2 N, P) takes them to the vertices.
    """

    def __init__(self, tile: Tile) -> None:
        self.first, ring, group = tile, tile.polygon, tile.group
        maps = [np.eye(2), *(np.array([[a, b], [b, -a]]) for a, b in commutant(group.linear_parts))]
        if all(g.determinant > 0 for g in group.cosets):
            maps.append(np.array([[0.0, -1.0], [1.0, 0.0]]))
        self.maps = np.stack(maps)
        vertex, source, linear, shift = self._images()
        kept, place = np.unique(source, return_inverse=True)
        # the mean over all elements that take a free vertex to a vertex
        weight = 1 / np.bincount(vertex)[vertex, None, None]
        matrix = np.zeros((len(ring), 2, 2 * len(kept) + len(maps) + 2))
        free, lattice = np.split(matrix[..., :-2], [2 * len(kept)], axis=2)
        pairs = free.reshape(len(ring), 2, -1, 2)
        np.add.at(pairs.swapaxes(1, 2), (vertex, place), weight * linear)
        np.add.at(lattice, vertex, weight * np.einsum("mij,kj->kim", self.maps, shift))
        np.add.at(matrix[..., -2:], vertex, weight * (np.eye(2) - linear))
        self.matrix = matrix.reshape(2 * len(ring), -1)
        self.start = np.concatenate([ring[kept].ravel(), [1.0], np.zeros(len(maps) + 1)])

    def _images(self) -> tuple[Array, Array, Array, Array]:
        """Return (K,) vertices, the first vertices of their orbits, and R and t of p -> R p + t.

        All elements of the group that take the latter to the former.
        """
        ring, group = self.first.polygon, self.first.group

        def within_cell(points: Array) -> Array:
            share = points @ group.inverse_lattice.T
            return (share - np.floor(share)) % 1.0  # what is just below 0 ends up at 1

        moved = np.stack([g(ring) for g in group.cosets])
        around: dict[str, Any] = {"boxsize": 1.0}  # which the stubs believe to be a matrix
        tree = KDTree(within_cell(ring), **around)
        nearby: Any = tree.query_ball_point(within_cell(moved.reshape(-1, 2)), SAME_POINT_DISTANCE)
        pairs = np.array([(i, k) for k, near in enumerate(nearby) for i in near], dtype=np.int64)
        vertex, coset, source = pairs[:, 0], *np.divmod(pairs[:, 1], len(ring))
        first = np.full(len(ring), len(ring))
        np.minimum.at(first, vertex, source)
        vertex, coset, source = (part[source == first[vertex]] for part in (vertex, coset, source))
        steps = np.round((ring[vertex] - moved[coset, source]) @ group.inverse_lattice.T)
        shift = group.translations[coset] + steps @ group.lattice.T
        return vertex, source, group.linear_parts[coset], shift

    def polygon(self, parameters: Array) -> Array:
        """Return the vertices (N, 2) for parameters (P,)."""
        return (self.matrix @ parameters).reshape(-1, 2)

    def tile(self, parameters: Array, *, same_area: bool = True) -> Tile:
        """Return the tile for parameters (P,), by default scaled to the first tile's area."""
        first, polygon = self.first, self.polygon(parameters)
        linear = np.tensordot(parameters[-2 - len(self.maps) : -2], self.maps, 1)
        group = first.group.conjugate(linear, parameters[-2:])
        tile = Tile(polygon, group, first.isohedral_class, first.corners)
        if not same_area:
            return tile
        scale = np.sqrt(first.signed_area / signed_area(polygon))
        return tile.transformed(scale * np.eye(2), (1 - scale) * first.center)
