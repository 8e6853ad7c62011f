"""A tile carried into another world, with its copies: the pattern of a group of rotations, bent.

The plane's pattern is a surface with three cone points, the triangle of rotation centres twice. A
world whose triangle has other angles gives the same surface other cone points, and the conformal map
of the triangles takes the pattern along: a point of the tile is reached from the tile's middle through
a row of reflected triangles, and the same row of reflections is gone in the world. What the plane's
group identifies on the tile's edge, the world's group does, exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import permutations
from typing import Any, NamedTuple

import numpy as np
import shapely

from orbiflow.arrays import Array, Complex
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import CrystallographicGroup, symmetry_elements
from orbiflow.tiles.geometry import complex_points, orient
from orbiflow.tiles.silhouette import triangulate
from orbiflow.tiles.tilings import Tiling, copies_meeting
from orbiflow.tiles.worlds.schwarz import Orders, TriangleMap, curvature, triangle_map, undone

FLAT: dict[str, Orders] = {"p3": (3, 3, 3), "p4": (4, 4, 2), "p6": (6, 3, 2)}
"""The orders of the rotation centres of groups whose pattern goes to other worlds."""

USUAL: dict[tuple[str, int], Orders] = {
    ("p3", 1): (2, 3, 3),
    ("p4", 1): (2, 3, 4),
    ("p6", 1): (2, 3, 5),
    ("p3", -1): (3, 3, 4),
    ("p4", -1): (2, 4, 5),
    ("p6", -1): (2, 3, 7),
}
"""The orders of the sphere, 1, and of the disc, -1, that bend the tiles of a group least."""

NEAR = 1e-7  # of a lattice vector: places that are one
ON_SIDE = 1e-12  # of a triangle's size, within which a point lies in it
MOST_STEPS = 400  # triangles that the way to a point of a tile passes
SPACING = 0.04  # of triangles inside, in sizes of the tile
BEYOND = 1e-4  # how far beyond its edge a tile's neighbour is looked for, in its size


class Cells(NamedTuple):
    """Where N points are: in which triangle of the plane, and in which one of the world.

    A point z lies at `turn` z + `shift`, or of its conjugate where `flips`, in the first triangle; the
    world's triangle is that which `motion` (N, 3, 3) takes the first one to.
    """

    turn: Complex
    shift: Complex
    flips: Any
    motion: Array

    def take(self, index: Any) -> Cells:
        """Return those at an index."""
        return Cells(*(part[index] for part in self))

    def local(self, points: Complex) -> Complex:
        """Return points (N,) of the plane in the first triangle's place."""
        return self.turn * np.where(self.flips, np.conj(points), points) + self.shift


def walked(triangle: TriangleMap, cells: Cells, start: Complex, end: Complex) -> Cells:
    """Return the cells of points `end` (N,), reached along straight lines from `start`, in `cells`."""
    corners = triangle.vertices
    begin, ahead = np.roll(corners, -1), np.roll(corners, -2)  # side k is opposite to vertex k
    along = (ahead - begin) / np.abs(ahead - begin)
    size = float(np.abs(along * 0 + ahead - begin).max())
    turn, shift, flips, motion = (part.copy() for part in cells)
    here, there = cells.local(start), cells.local(end)
    came = np.full(len(end), -1)
    for _ in range(MOST_STEPS):
        off = ((there[:, None] - begin) * np.conj(along)).imag  # of each side, inside positive
        outside = off < -ON_SIDE * size
        if not outside.any():
            return Cells(turn, shift, flips, motion)
        before = np.maximum(((here[:, None] - begin) * np.conj(along)).imag, 0.0)
        share = np.where(outside, before / np.where(outside, before - off, 1.0), np.inf)
        share[np.arange(len(end)), came] = np.where(came < 0, share[:, -1], np.inf)
        side = np.argmin(share, axis=1)
        go = np.flatnonzero(np.isfinite(share.min(axis=1)))
        if not len(go):
            return Cells(turn, shift, flips, motion)
        k = side[go]
        own = share[go, k]
        crossing = here[go] + own * (there[go] - here[go])
        u = along[k] ** 2  # z -> begin + u conj(z - begin)
        there[go] = begin[k] + u * np.conj(there[go] - begin[k])
        here[go] = crossing
        turn[go] = u * np.conj(turn[go])
        shift[go] = begin[k] + u * np.conj(shift[go] - begin[k])
        flips[go] = np.logical_not(flips[go])
        motion[go] = motion[go] @ triangle.mirrors[k]
        came[go] = k
    raise OrbiflowError("the way to a point of the tile does not end; this is a bug")


def base_triangles(group: CrystallographicGroup, middle: Array) -> tuple[Orders, list[Complex]]:
    """Return the orders of a group's rotation centres, and triangles (3,) of them near a point.

    Raises:
        OrbiflowError: If the group has mirrors or glides, or no rotations by less than half a turn.
    """
    flat = FLAT[_named(group)]
    size = float(np.sqrt(group.cell_volume))
    centres = symmetry_elements(group, middle, 1.5 * size).centers
    places = {
        order: [complex(*c.point) for c in centres if c.order == order] for order in set(flat)
    }
    ends = [np.exp(1j * np.pi / order) for order in flat]
    found = list[Complex]()
    for first in places[flat[0]]:
        others = [own for own in places[flat[1]] if abs(own - first) > NEAR * size]
        if not others:
            continue
        least = min(abs(own - first) for own in others)
        for second in (own for own in others if abs(own - first) < (1 + NEAR) * least):
            # the third is where the sides from both meet
            side = second - first
            one, two = side * ends[0], -side * np.conj(ends[1])
            t = (side * np.conj(two)).imag / (one * np.conj(two)).imag
            third = first + t * one
            if any(abs(own - third) < NEAR * size for own in places[flat[2]]):
                found.append(np.array([first, second, third]))
    return flat, found


@dataclass(frozen=True, eq=False)
class Unfolding:
    """A tile in a world that its group's pattern goes to.

    - `tiling`: The plane's tiling.
    - `triangle`: The conformal map.
    - `placed`: The triangle of rotation centres (3,) in the tile's coordinates that it begins with.
    """

    tiling: Tiling
    triangle: TriangleMap
    placed: Complex

    @property
    def sign(self) -> int:
        """Whether the world is curved as a sphere, 1, or hyperbolic, -1."""
        return self.triangle.sign

    @cached_property
    def ring(self) -> Array:
        """The tile's outline (N, 2), counter-clockwise; of several figures, their union."""
        polygons = [shapely.Polygon(own.polygon) for own in self.tiling.prototiles]
        if len(polygons) == 1:
            return orient(self.tiling.prototiles[0].polygon, counter_clockwise=True)
        size = float(np.sqrt(self.tiling.tile_area))
        union: Any = shapely.union_all(polygons, grid_size=1e-9 * size)
        return orient(shapely.get_coordinates(union.exterior)[:-1], counter_clockwise=True)

    @cached_property
    def mesh(self) -> Any:
        """What fills the outline."""
        return triangulate(self.ring, SPACING * float(np.sqrt(self.tiling.tile_area)))

    def _normal(self, points: Array) -> Complex:
        """Return points (N, 2) where the first triangle is that of the map."""
        first, second, _ = self.placed
        scale = self.triangle.vertices[1] / (second - first)
        return (complex_points(points) - first) * scale

    @cached_property
    def _cells(self) -> tuple[Complex, Cells]:
        """The middles of the mesh's triangles, and their cells."""
        middles = self._normal(self.mesh.points[self.mesh.triangles].mean(axis=1))
        triangles, count = self.mesh.triangles, len(middles)
        pairs = np.sort(np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
        owner = np.tile(np.arange(count), 3)
        order = np.lexsort(pairs.T)
        pairs, owner = pairs[order], owner[order]
        twins = np.flatnonzero((pairs[1:] == pairs[:-1]).all(axis=1))
        near: list[list[tuple[int, int]]] = [[] for _ in range(count)]
        for k in twins.tolist():
            near[owner[k]].append((int(owner[k + 1]), k))
            near[owner[k + 1]].append((int(owner[k]), k))
        halves = self._normal(self.mesh.points[pairs].mean(axis=1))
        middle = self._normal(np.array([shapely.Polygon(self.ring).centroid.coords[0]]))[0]
        root = int(np.argmin(np.abs(middles - middle)))
        one = np.ones(count, dtype=np.complex128)
        cells = Cells(one, 0 * one, np.zeros(count, dtype=bool), np.tile(np.eye(3), (count, 1, 1)))
        # from the corner's triangle to the root, then outwards
        start = np.array([self.triangle.vertices.mean()])
        first = walked(self.triangle, cells.take([0]), start, middles[[root]])
        for part, value in zip(cells, first, strict=True):
            part[root] = value[0]
        known, level = np.zeros(count, dtype=bool), [root]
        known[root] = True
        while level:
            steps = [(i, j, k) for i in level for j, k in near[i] if not known[j]]
            unique = {j: (i, k) for i, j, k in reversed(steps)}
            level = list(unique)
            if not level:
                break
            parents, sides = (np.array([unique[j][m] for j in level]) for m in (0, 1))
            half = walked(self.triangle, cells.take(parents), middles[parents], halves[sides])
            done = walked(self.triangle, half, halves[sides], middles[level])
            for part, values in zip(cells, done, strict=True):
                part[level] = values
            known[level] = True
        return middles, cells

    @cached_property
    def _tree(self) -> Any:
        return shapely.STRtree(np.asarray(shapely.polygons(self.mesh.points[self.mesh.triangles])))

    def cells(self, points: Array) -> tuple[Complex, Cells]:
        """Return points (N, 2) of the tile in the triangle's place, and their cells."""
        middles, cells = self._cells
        nearest = self._tree.nearest(shapely.points(points))
        goal = self._normal(points)
        found = walked(self.triangle, cells.take(nearest), middles[nearest], goal)
        return goal, found

    def vectors(self, points: Array) -> Array:
        """Return where points (N, 2) of the tile are in the world, vectors (N, 3)."""
        goal, cells = self.cells(points)
        local = self.triangle.forward(cells.local(goal))
        return np.einsum("nij,nj->ni", cells.motion, local)

    @cached_property
    def middle(self) -> Array:
        """The vector (3,) of a point inside of the tile."""
        middles, cells = self._cells
        center = self._normal(
            np.array([shapely.Polygon(self.ring).representative_point().coords[0]])
        )
        root = int(np.argmin(np.abs(middles - center[0])))
        local = self.triangle.forward(cells.take([root]).local(middles[[root]]))
        return cells.motion[root] @ local[0]

    @cached_property
    def neighbours(self) -> Array:
        """The motions (E, 3, 3) that take the tile to those along its edge."""
        size = float(np.sqrt(self.tiling.tile_area))
        ring = self.ring
        ends = np.roll(ring, -1, axis=0)
        step = ends - ring
        normals = np.column_stack([step[:, 1], -step[:, 0]]) / np.linalg.norm(step, axis=1)[:, None]
        inside, beyond = ((ring + ends) / 2 + side * BEYOND * size * normals for side in (-1, 1))
        low, high = ring.min(axis=0) - size, ring.max(axis=0) + size
        copies = copies_meeting(self.tiling, (*low.tolist(), *high.tolist()))
        polygon = shapely.Polygon(ring)
        back = np.full(ring.shape, np.nan)
        for k in range(len(copies)):
            if copies.prototiles[k]:
                continue
            own = copies.isometry(k).inverse()(beyond)
            held = shapely.contains_xy(polygon, *own.T)
            back[held] = own[held]
        sound = ~np.isnan(back).any(axis=1)
        start, begin = self.cells(inside[sound])
        there = walked(self.triangle, begin, start, self._normal(beyond[sound]))
        _, here = self.cells(back[sound])
        motions = there.motion @ undone(here.motion, self.sign)
        _, first = np.unique(np.round(motions @ self.middle, 6), axis=0, return_index=True)
        return motions[np.sort(first)]

    @cached_property
    def distortion(self) -> float:
        """How unevenly the map enlarges the tile: the deviation of the logarithm of its scale."""
        middles, cells = self._cells
        logs = np.log(self.triangle.scale(cells.local(middles)))
        weights = shapely.area(shapely.polygons(self.mesh.points[self.mesh.triangles]))
        mean = np.average(logs, weights=weights)
        return float(np.sqrt(np.average((logs - mean) ** 2, weights=weights)))


def usual_orders(group: CrystallographicGroup, sign: int) -> Orders:
    """Return the orders of a sphere, 1, or a disc, -1, for a group's tiles.

    Raises:
        OrbiflowError: If the group has no pattern there.
    """
    return USUAL[_named(group), sign]


def _named(group: CrystallographicGroup) -> str:
    """Return the name of a group whose pattern goes to other worlds."""
    if group.name not in FLAT:
        raise OrbiflowError(
            f"tiles of {group.name} stay in the plane: the sphere and the disc take tiles whose copies "
            "are turned by thirds, quarters or sixths (p3, p4 and p6: IH7, IH28, IH21)"
        )
    return group.name


def unfolded(tiling: Tiling, orders: Orders, sign: int = 0) -> Unfolding:
    """Return a tile in the world of these orders, given to its centres as they distort it least.

    With a `sign` it must be the sphere, 1, or the hyperbolic plane, -1.

    Raises:
        OrbiflowError: If the tiling's group is not one of rotations, or the orders are not of it.
    """
    found = 0 if min(orders) < 2 else curvature(orders)
    if not found or sign not in (0, found):
        where = {0: "a sphere or a disc", 1: "the sphere", -1: "the hyperbolic plane"}[sign]
        raise OrbiflowError(
            f"the orders {', '.join(map(str, orders))} are not of {where}: the sphere has 2,3,3, "
            "2,3,4, 2,3,5 and 2,2,n, the hyperbolic plane larger ones, such as 3,3,4 or 2,3,7"
        )
    flat, near = base_triangles(tiling.group, tiling.center)
    middle = complex(*tiling.center)
    placed = min(near, key=lambda own: abs(own.mean() - middle))
    every = sorted(set(permutations(orders)))
    found = (Unfolding(tiling, triangle_map(flat, own), placed) for own in every)
    return min(found, key=lambda own: round(own.distortion, 9))
