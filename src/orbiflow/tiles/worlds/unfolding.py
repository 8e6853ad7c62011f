"""A tile carried into another world, with its copies: the pattern of a group of rotations, bent.

The tile has no centre of rotation inside, so that the map of its group's pattern (`developing`) is a
map of the tile, followed from one triangle of a mesh to the next. Where an element of the plane's group
takes one piece of the tile's edge to another, the solutions there differ by a matrix, which is the
motion of the world that does the same: what the plane's group identifies, the world's does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations
from typing import Any

import numpy as np
import scipy.sparse
import shapely
from scipy.sparse.csgraph import breadth_first_order

from orbiflow.arrays import Array, Complex, Integers
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import CrystallographicGroup, symmetry_elements
from orbiflow.tiles.geometry import complex_points, doubled_areas
from orbiflow.tiles.silhouette import SilhouetteMesh, triangulate
from orbiflow.tiles.tilings import Tiling
from orbiflow.tiles.worlds.curved import curvature, motions_of_spinors, norms, vectors_of
from orbiflow.tiles.worlds.developing import Development
from orbiflow.tiles.worlds.outlines import NEAR, cone_points, contacts, ring_of, with_centres
from orbiflow.tiles.worlds.pattern import Around, Pattern
from orbiflow.tiles.worlds.potential import ROUND, Series

USUAL: dict[tuple[str, int], tuple[int, ...]] = {
    ("p3", 1): (2, 3, 3),
    ("p4", 1): (2, 3, 4),
    ("p6", 1): (2, 3, 5),
    ("p3", -1): (3, 3, 4),
    ("p4", -1): (2, 4, 5),
    ("p6", -1): (2, 3, 7),
    ("p2", -1): (2, 2, 2, 3),
    ("pgg", -1): (2, 3),
    ("p1", -1): (2,),
    ("pg", -1): (2,),
}
"""The orders of the sphere, 1, and of the disc, -1, that bend the tiles of a group least: one for each
of its kinds of centres, or one for a point of the edge."""

SPACING = 0.04  # of triangles inside, in sizes of the tile
FINEST = 0.002  # where centres are near to each other
REACHED = 0.6  # of the way to the next centre, within which a triangle's corners are to be
INSIDE = 1e-6  # of the tile's size: a centre so far from its edge is inside


@dataclass(frozen=True, eq=False)
class TileMesh:
    """A tile divided into triangles, among its group's centres.

    - `ring`: The tile's outline (N, 2), counter-clockwise; of several figures, their union.
    - `mesh`: What fills the outline.
    - `around`: What lies around the triangles' middles.
    - `parents`, `order`, `halves`: Each triangle's parent (M,); all but the root, parents before others
      (M - 1,); and the middles of the sides that they share with their parents. A straight line from
      the middle of the pattern's polygon reaches the root far from any centre.
    """

    ring: Array
    mesh: SilhouetteMesh
    around: Around
    parents: Integers
    order: Integers
    halves: Complex

    @classmethod
    def of(cls, tiling: Tiling, ring: Array, pattern: Pattern) -> TileMesh:
        """Return that of a tile with such an outline, fine enough for series about its triangles."""
        size = float(np.sqrt(tiling.tile_area))
        spacing = SPACING * size
        ring = with_centres(ring, pattern, spacing, NEAR * size)
        while True:
            fine = shapely.get_coordinates(
                shapely.segmentize(shapely.LinearRing(ring), 2 * spacing)
            )[:-1]
            mesh = triangulate(fine, spacing)
            corners = complex_points(mesh.points[mesh.triangles])
            middles = corners.mean(axis=1)
            away = pattern.to_centres(middles)
            near = np.abs(away).argmin(axis=1)
            reach = pattern.around_centres.reach[near]
            off = np.abs(away[np.arange(len(away)), near])
            wide = np.abs(corners - middles[:, None]).max(axis=1)
            # about a centre, within its own series, else about the middle
            if (np.where(off < ROUND * reach, (off + wide) / reach, wide / off) < REACHED).all():
                break
            spacing /= 2
            if spacing < FINEST * size:
                raise OrbiflowError(
                    "the centres of rotation are too near to each other for another world"
                )
        root = int(np.argmin(np.abs(middles - pattern.middle) / pattern.clearance(middles)))
        parents, order, halves = _tree(mesh, root)
        return cls(ring, mesh, pattern.around(middles), parents, order, halves)

    @cached_property
    def _index(self) -> Any:
        return shapely.STRtree(np.asarray(shapely.polygons(self.mesh.points[self.mesh.triangles])))

    def nearest(self, points: Array) -> Integers:
        """Return the triangles (N,) that are nearest to points (N, 2)."""
        return self._index.nearest(shapely.points(points))


@dataclass(frozen=True, eq=False)
class Unfolding:
    """A tile in a world that its group's pattern goes to.

    - `tiling`: The plane's tiling.
    - `development`: The conformal map.
    - `tile`: The tile's triangles.
    """

    tiling: Tiling
    development: Development
    tile: TileMesh

    @property
    def sign(self) -> int:
        """Whether the world is curved as a sphere, 1, or hyperbolic, -1."""
        return self.development.sign

    @property
    def words(self) -> str:
        """How many copies meet where."""
        pattern, orders = self.development.potential.pattern, self.development.orders
        if order_count(self.tiling.group) == 1:
            return (
                f"at one point of a tile's edge meet {orders[0] // 2} times as many as in the plane"
            )
        every = (orders[pattern.kinds.index(kind)] for kind in sorted(set(pattern.kinds)))
        return (
            f"around its turning points it repeats {', '.join(f'{count} times' for count in every)}"
        )

    @property
    def ring(self) -> Array:
        """The tile's outline (N, 2), counter-clockwise; of several figures, their union."""
        return self.tile.ring

    @cached_property
    def cones(self) -> Array:
        """Points (K, 2) of the outline about which angles are others in the world than in the plane."""
        potential = self.development.potential
        away = potential.pattern.to_centres(complex_points(self.ring))
        corner = potential.pattern.corner_of
        bent = potential.pattern.flat[corner] != np.array(potential.orders)[corner]
        size = float(np.sqrt(self.tiling.tile_area))
        return self.ring[(np.abs(away[:, bent]) < NEAR * size).any(axis=1)]

    @cached_property
    def _series(self) -> Series:
        """Solutions about a point near each triangle."""
        return self.development.potential.about(self.tile.around)

    @cached_property
    def _matrices(self) -> Complex:
        """What takes the solutions near each triangle to those of the development (N, 2, 2)."""
        tile, series = self.tile, self._series
        before, after = (
            series.take(rows).wronskians(tile.halves)
            for rows in (tile.parents[tile.order], tile.order)
        )
        steps = before @ np.linalg.inv(after)
        root = tile.parents[tile.order[:1]]
        middle = tile.around.points[root]
        here = self.development.reached(complex(middle[0]))
        matrices = np.zeros((len(tile.parents), 2, 2), dtype=np.complex128)
        matrices[root] = here @ np.linalg.inv(series.take(root).wronskians(middle))
        for k, step in zip(tile.order.tolist(), steps, strict=True):
            matrices[k] = matrices[tile.parents[k]] @ step
        return matrices

    def vectors(self, points: Array) -> Array:
        """Return where points (N, 2) of the tile are in the world, vectors (N, 3)."""
        near = self.tile.nearest(points)
        values = self._series.take(near).spinors(complex_points(points))
        return vectors_of(np.einsum("nij,nj->ni", self._matrices[near], values), self.sign)

    def _wronskians(self, points: Array) -> Complex:
        """Return the solutions and their derivatives (N, 2, 2) at points (N, 2) that are no centres."""
        near = self.tile.nearest(points)
        return self._matrices[near] @ self._series.take(near).wronskians(complex_points(points))

    @cached_property
    def middle(self) -> Array:
        """The vector (3,) of a point inside of the tile."""
        point = shapely.Polygon(self.ring).representative_point()
        return self.vectors(np.array(point.coords))[0]

    @cached_property
    def neighbours(self) -> Array:
        """The motions (E, 3, 3) that take the tile to those along its edge."""
        across = list[Array]()
        for isometry, points in contacts(self.tiling, self.ring):
            here, there = self._wronskians(points), self._wronskians(isometry.inverse()(points))
            turn = complex(*isometry.linear[:, 0])
            here = here * np.array([turn**-0.5, turn**0.5])
            if mirrored := isometry.determinant < 0:
                there = np.conj(there)
            across.append(motions_of_spinors(here @ np.linalg.inv(there), self.sign, mirrored))
        motions = np.concatenate(across)
        _, first = np.unique(np.round(motions @ self.middle, 6), axis=0, return_index=True)
        return motions[np.sort(first)]

    @property
    def generators(self) -> tuple[Array, tuple[int, ...]] | None:
        """Rotations (k, 3, 3) with the product 1, and their orders, if they generate the group."""
        if order_count(self.tiling.group) < len(self.development.orders):
            return None
        return self.development.rotations, self.development.orders

    @property
    def scales(self) -> tuple[Array, Array]:
        """Logarithms of how much triangles are enlarged, up to a constant, and twice their areas."""
        values = self._matrices @ self._series.wronskians(self.tile.around.points)
        logs = np.log(np.abs(np.linalg.det(values)) / norms(values[..., 0], self.sign))
        return logs, abs(doubled_areas(self.tile.mesh.points, self.tile.mesh.triangles))


def distortion(unfolding: Unfolding) -> float:
    """Return how unevenly a tile is enlarged: the deviation of the logarithm of its scale."""
    logs, weights = unfolding.scales
    mean = np.average(logs, weights=weights)
    return float(np.sqrt(np.average((logs - mean) ** 2, weights=weights)))


def _tree(mesh: SilhouetteMesh, root: int) -> tuple[Integers, Integers, Complex]:
    """Return `parents`, `order` and `halves` of a mesh's triangles from a root."""
    triangles, count = mesh.triangles, len(mesh.triangles)
    pairs = np.sort(np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    order, owner = np.lexsort(pairs.T), np.tile(np.arange(count), 3)
    pairs, owner = pairs[order], owner[order]
    twins = np.flatnonzero((pairs[1:] == pairs[:-1]).all(axis=1))
    graph: Any = scipy.sparse.csr_matrix(
        (twins + 1, (owner[twins], owner[twins + 1])), (count, count)
    )
    graph = graph + graph.T
    order, parents = breadth_first_order(graph, root, directed=False)
    sides = np.asarray(graph[order[1:], parents[order[1:]]]).ravel() - 1
    order, parents = order.astype(np.int64), parents.astype(np.int64)
    return parents, order[1:], complex_points(mesh.points[pairs[sides]].mean(axis=1))


def usual_orders(group: CrystallographicGroup, sign: int) -> tuple[int, ...]:
    """Return the orders of a sphere, 1, or a disc, -1, for a group's tiles.

    Raises:
        OrbiflowError: If the group has no pattern there.
    """
    _check_group(group, sign)
    return USUAL[group.name, sign]


def order_count(group: CrystallographicGroup) -> int:
    """Return how many orders a group's tiles take, 0 for a group that stays in the plane."""
    return len(USUAL.get((group.name, -1), ()))


def _check_group(group: CrystallographicGroup, sign: int) -> None:
    if not order_count(group):
        raise OrbiflowError(
            f"tiles of {group.name or 'this group'} stay in the plane, or go around a spiral: other "
            f"worlds take tiles of the groups {', '.join(name for name, curved in USUAL if curved < 0)}"
        )
    if sign > 0 and (group.name, 1) not in USUAL:
        raise OrbiflowError(
            f"tiles of {group.name} have no pattern on a sphere, which takes tiles turned by thirds, "
            "quarters or sixths (p3, p4 and p6: IH7, IH28, IH21)"
        )


def check_world(tiling: Tiling, sign: int) -> None:
    """Check, without much work, that a tiling has a pattern on a sphere, 1, or a disc, -1.

    Raises:
        OrbiflowError: If its group has none there, or a centre of rotation is inside of the tile.
    """
    _check_group(tiling.group.primitive(), sign)
    _check_inside(tiling, ring_of(tiling))


def unfolded(
    tiling: Tiling,
    orders: Sequence[int],
    sign: int = 0,
    cost: Callable[[Unfolding], float] = distortion,
) -> Unfolding:
    """Return a tile in the world of these orders, given to its centres as they cost least.

    With a `sign` it must be the sphere, 1, or the hyperbolic plane, -1. Groups of translations and
    glides have one order: so many times as many copies meet at a point of the tile's edge.

    Raises:
        OrbiflowError: If the tiling's group has no pattern there, or the orders are not of it, or a
            centre of rotation is inside of the tile.
    """
    group, ring = tiling.group.primitive(), ring_of(tiling)
    _check_group(group, sign)
    count = order_count(group)
    if len(orders) != count:
        raise OrbiflowError(
            f"tiles of {group.name} take {count} order{'s' * (count > 1)}, such as "
            f"{','.join(map(str, USUAL[group.name, -1]))}, but {','.join(map(str, orders))} was given"
        )
    _check_inside(tiling, ring)
    if count == 1:
        lattice, points = cone_points(tiling, ring)
        every = [(Pattern.about(lattice, point), [(2 * orders[0], 2, 2, 2)]) for point in points]
    else:
        pattern, chosen = Pattern.near(group, tiling.center), sorted(set(permutations(orders)))
        every = [(pattern, [tuple(assigned[k] for k in pattern.kinds) for assigned in chosen])]
    curved = 0 if min(orders) < 2 else curvature(every[0][1][0])
    if not curved or sign not in (0, curved):
        where = {0: "a sphere or a disc", 1: "the sphere", -1: "the hyperbolic plane"}[sign]
        raise OrbiflowError(
            f"the orders {', '.join(map(str, orders))} are not of {where}: the sphere has 2,3,3, "
            "2,3,4, 2,3,5 and 2,2,n, the hyperbolic plane larger ones, such as 3,3,4 or 2,3,7"
        )
    worlds = list[Unfolding]()
    for pattern, assignments in every:
        tile = TileMesh.of(tiling, ring, pattern)
        worlds += [Unfolding(tiling, Development.of(pattern, cones), tile) for cones in assignments]
    return min(worlds, key=lambda world: round(cost(world), 9))


def _check_inside(tiling: Tiling, ring: Array) -> None:
    size = float(np.sqrt(tiling.tile_area))
    polygon = shapely.Polygon(ring).buffer(-INSIDE * size)
    reach = float(np.linalg.norm(ring - tiling.center, axis=1).max())
    centres = symmetry_elements(tiling.group, tiling.center, reach).centers
    if any(polygon.contains(shapely.Point(*centre.point)) for centre in centres):
        raise OrbiflowError(
            "the tile has a centre of rotation inside, where another world would have a cone's tip: "
            "it stays in the plane, or goes around a spiral"
        )
