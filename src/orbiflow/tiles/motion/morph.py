"""The way from a class's template to a tile through tiles: no frame overlaps, however limbs are bent.

Both tiles are divided into triangles that correspond. Every vertex of the tiling is a mean of its
neighbours with positive weights (mean value coordinates; Floater, 2003), and on a torus any
positive weights give a plane drawing (Tutte, 1963; Gortler, Gotsman and Thurston, 2006). So the
weights are interpolated instead of the places (Floater and Gotsman, How to morph tilings
injectively, 1999), and the places are solved for. Weights that are invariant under the group give
places that are, so there are two unknowns for each orbit of vertices.

If the group has no rotation, walks by such weights may drift, and the torus would have to change.
The weights along the drift are then tilted by an exponential, which keeps them positive, until it
stops.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import bmat, coo_array, csc_array
from scipy.sparse.linalg import spsolve

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import Isometry, identity
from orbiflow.tiles.geometry import signed_area
from orbiflow.tiles.motion.own_frame import OwnFrame, relations
from orbiflow.tiles.silhouette import triangulate


@dataclass(frozen=True, eq=False)
class VertexOrbits:
    """The orbits of N vertices: vertex i lies at linear[i] p + shift[i], with p vertex `source[i]`."""

    source: NDArray[np.int64]  # the number (N,) of a vertex that is its own source
    linear: Array  # with `shift`: the isometries (N, 2, 2) and (N, 2) of the own frame's group
    shift: Array
    fixed: NDArray[np.bool_]  # whether (N,) the vertex lies on a centre of rotation and cannot move

    @classmethod
    def of(cls, frame: OwnFrame) -> VertexOrbits:
        """Return the orbits of a polygon's vertices."""
        links = _links(frame)
        count = len(frame.points)
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
                    earlier = elements[j]
                    if earlier is None:
                        elements[j], source[j] = reached, root
                        orbit.append(j)
                    elif not earlier.is_close(reached, 1e-6):
                        fixed[root] = True  # two ways there: an element leaves it where it is
            fixed[orbit] = fixed[root]
        isometries = [element or identity(2) for element in elements]
        linear = np.stack([element.linear for element in isometries])
        shift = np.stack([element.translation for element in isometries])
        return cls(source, linear, shift, fixed)

    def with_inner(self, count: int) -> VertexOrbits:
        """Return the orbits with `count` more vertices, each its own source."""
        n = len(self.source)
        return VertexOrbits(
            np.concatenate([self.source, np.arange(n, n + count)]),
            np.concatenate([self.linear, np.broadcast_to(np.eye(2), (count, 2, 2))]),
            np.concatenate([self.shift, np.zeros((count, 2))]),
            np.concatenate([self.fixed, np.zeros(count, dtype=bool)]),
        )

    def spread(self, points: Array) -> Array:
        """Return the vertices (N, 2), with sources and fixed ones taken from `points` (N, 2)."""
        images = np.einsum("nij,nj->ni", self.linear, points[self.source]) + self.shift
        return np.where(self.fixed[:, None], points, images)


def _links(frame: OwnFrame) -> list[list[tuple[int, Isometry]]]:
    """Return for each vertex i the vertices j and elements g with p_j = g p_i, one for each edge."""
    count = len(frame.points)
    links: list[list[tuple[int, Isometry]]] = [[] for _ in range(count)]
    bounds = [*frame.starts, count]
    for edge, image in relations(frame.edge_classes):
        element = image.isometry
        back = element.inverse()
        first = np.arange(bounds[edge], bounds[edge + 1] + 1) % count
        second = np.arange(bounds[image.edge], bounds[image.edge + 1] + 1) % count
        if image.reversed:
            second = second[::-1]
        for i, j in zip(first.tolist(), second.tolist(), strict=True):
            links[i].append((j, element))
            links[j].append((i, back))
    return links


ROUNDS = 12  # number of times that sides of the outline may be halved for the triangulation
STIFF = 1e4  # how much more strongly edges pull than the inside where they are to be straight

# Most steps in which weights are tilted, the force that counts as none, the finite difference's step
TILTS, BALANCED, TINY = 12, 1e-9, 1e-4
# The logarithm by which a step changes weights at most, and halvings of a step that does not help
WIDEST_TILT, HALVINGS = 2.0, 12

# Number of places at which the way of the weights is measured, so that the outline moves evenly
EVEN = 24

CHECKED = 96  # number of places at which the straight way is checked


class Morph:
    """The way from a tile's template to the tile: straight if it stays simple, else by weights.

    Parts of the tile, polygons (N, 2) with the tile's vertices, go with the weights, which take the
    triangles along; where there are parts, nothing moves along straight lines.
    """

    def __init__(self, frame: OwnFrame, parts: Sequence[Array] = ()) -> None:
        self.end, self.start = frame, frame.straight()
        self.weights: _Weights | None = None  # None if every vertex moves along a straight line
        shares = np.linspace(0, 1, CHECKED + 1)
        straight = (shapely.Polygon(self._straight_way(float(s))).is_valid for s in shares)
        self._parts: list[_Within] = []
        if parts or not all(straight):
            self.weights = _Weights.of(frame)
            self.end = self.weights.frame
            self.start = replace(self.end.straight(), points=self.weights.points(0.0))
            # how far the outline has moved, 0 to 1, at even shares of the weights' way
            outlines = [self.weights.points(float(s)) for s in np.linspace(0, 1, EVEN + 1)]
            steps = [np.sqrt(((b - a) ** 2).sum(axis=1).mean()) for a, b in pairwise(outlines)]
            far = np.concatenate([[0], np.cumsum(steps)])
            self._even = far / far[-1]
            inverse = np.linalg.inv(frame.linear).T
            self._parts = [
                _Within.of(self.weights, (ring - frame.offset) @ inverse) for ring in parts
            ]

    def at(self, share: float) -> OwnFrame:
        """Return the tile at 0 (the template) to 1 (the tile)."""
        if share >= 1:
            return self.end
        if share <= 0:
            return self.start
        if self.weights is None:
            points = self._straight_way(share)
        else:
            points = self.weights.points(self._of_weights(share))
        linear = (1 - share) * self.start.linear + share * self.end.linear
        return replace(self.end, points=points, linear=linear)

    def rings(self, share: float) -> list[Array]:
        """Return the polygon of each part at a share of the way, or the tile's if it has none."""
        if self.weights is None or not self._parts:
            return [self.at(share).points]
        points = self.weights.every(self._of_weights(share))
        return [part.at(points) for part in self._parts]

    def _of_weights(self, share: float) -> float:
        return float(np.interp(share, self._even, np.linspace(0, 1, len(self._even))))

    def _straight_way(self, share: float) -> Array:
        return (1 - share) * self.start.points + share * self.end.points


class _Within(NamedTuple):
    """Points (n,) that move with triangles: means of the corners of one."""

    corners: NDArray[np.int64]  # (n, 3)
    weights: Array  # (n, 3)

    @classmethod
    def of(cls, weights: _Weights, points: Array) -> _Within:
        """Return those of points (n, 2) of the tile in its own frame."""
        corners = weights.guess[weights.triangles]
        tree = shapely.STRtree(np.asarray(shapely.polygons(corners)))
        nearest = weights.triangles[tree.nearest(shapely.points(points))]
        first, second, third = weights.guess[nearest].transpose(1, 0, 2)
        sides = np.stack([second - first, third - first], axis=-1)
        two = np.linalg.solve(sides, (points - first)[..., None])[..., 0]
        return cls(nearest, np.column_stack([1 - two.sum(axis=1), two]))

    def at(self, points: Array) -> Array:
        """Return them where the triangles' corners are `points` (N, 2)."""
        return np.einsum("nk,nki->ni", self.weights, points[self.corners])


@dataclass(frozen=True, eq=False)
class _Weights:
    """The weights of template and tile, from which places between them are solved for."""

    frame: OwnFrame  # with as many vertices as the triangles need; they are the first n points
    orbits: VertexOrbits  # the orbits of all points
    sides: NDArray[np.int64]  # each side (E, 2) of a triangle, from either end
    first: Array  # with `last`: weights (E,) of template and tile, which add up to 1 for each orbit
    last: Array
    guess: Array  # the points (N, 2) of the tile
    triangles: NDArray[np.int64]  # (M, 3) of these

    @classmethod
    def of(cls, frame: OwnFrame) -> _Weights:
        if frame.group.order * signed_area(frame.kind.template()) > 1.5 * frame.group.cell_volume:
            name = frame.kind.name
            raise OrbiflowError(
                f"the straight way to this tile crosses itself, and tiles of {name} know no other: "
                "animate it with another kind, bend or grow"
            )
        for _ in range(ROUNDS):
            mesh = triangulate(frame.points)
            if not len(mesh.sides):
                break
            frame = frame.refined(set(mesh.sides.tolist()))
        else:
            raise OrbiflowError("the tile is too thin somewhere to be animated")
        orbits = VertexOrbits.of(frame).with_inner(len(mesh.points) - mesh.size)
        pairs = [(a, b) for a in range(3) for b in range(3) if a != b]
        sides = np.unique(np.concatenate([mesh.triangles[:, pair] for pair in pairs]), axis=0)
        first, last = (
            weights / _sums(weights, sides, orbits)
            for weights in (
                _stiff_edges(frame, sides),
                _mean_values(mesh.points, mesh.triangles, sides),
            )
        )
        return cls(frame, orbits, sides, first, last, mesh.points, mesh.triangles)

    def points(self, share: float) -> Array:
        """Return the outline (n, 2) at a share of the way."""
        return self.every(share)[: len(self.frame.points)]

    def every(self, share: float) -> Array:
        """Return all points (N, 2) at a share of the way."""
        weights = self.first ** (1 - share) * self.last**share
        ways = _open_ways(self.frame)
        i, j = self.sides.T
        along = (self.guess[j] - self.guess[i]) @ ways.T
        tilt = np.zeros(len(ways))
        solution, force = self._solved(weights, ways)
        for _ in range(TILTS):
            left = np.abs(force).max(initial=0.0)
            if left < BALANCED:
                break
            nearby = [
                self._solved(weights * np.exp(along @ (tilt + way)), ways)[1] - force
                for way in TINY * np.eye(len(ways))
            ]
            step = np.linalg.solve(np.stack(nearby, axis=1) / TINY, force)
            step /= max(1.0, float(np.abs(along @ step).max()) / WIDEST_TILT)
            for _ in range(HALVINGS):
                solved = self._solved(weights * np.exp(along @ (tilt - step)), ways)
                if np.abs(solved[1]).max() < left:
                    break
                step = step / 2
            tilt, (solution, force) = tilt - step, solved
        return self.orbits.spread(solution)

    def _solved(self, weights: Array, ways: Array) -> tuple[Array, Array]:
        """Return places (N, 2) in which each orbit is the mean of its neighbours, and a force (k,).

        The force, along the open directions and the same on all orbits, is what stops the drift.
        """
        weights = weights / _sums(weights, self.sides, self.orbits)
        guess, orbits = self.guess, self.orbits
        i, j = self.sides.T
        free = np.flatnonzero((orbits.source == np.arange(len(orbits.source))) & ~orbits.fixed)
        number = np.full(len(orbits.source), -1)
        number[free] = np.arange(len(free))
        keep = ~orbits.fixed[i]
        i, j, weights = i[keep], j[keep], weights[keep]
        back = weights[:, None, None] * np.swapaxes(orbits.linear[i], 1, 2)
        row, column = number[orbits.source[i]], number[orbits.source[j]]
        moves = ~orbits.fixed[j]
        blocks = np.concatenate(
            [(back @ orbits.linear[j])[moves], -weights[:, None, None] * np.eye(2)]
        )
        rows = np.concatenate([row[moves], row])
        columns = np.concatenate([column[moves], row])
        there = np.where(moves[:, None], orbits.shift[j], guess[j])
        right = np.zeros((len(free), 2))
        np.add.at(right, row, -np.einsum("eij,ej->ei", back, there - orbits.shift[i]))
        matrix = _block_matrix(blocks, rows, columns, len(free))
        solution = guess.copy()
        solution[free], force = _bordered(matrix, right, guess[free], ways)
        return solution, force


def _bordered(matrix: csc_array, right: Array, guess: Array, ways: Array) -> tuple[Array, Array]:
    """Return the solution with the guess's mean along the open ways (k, 2), and the force (k,)."""
    size, border = right.size, np.tile(ways, (1, len(right)))
    whole, value = matrix, right.ravel()
    if len(ways):
        blocks: Any = [[matrix, border.T], [border, None]]
        whole = bmat(blocks, format="csc")
        value = np.concatenate([value, border @ guess.ravel()])
    solved = np.asarray(spsolve(csc_array(whole), value))
    return solved[:size].reshape(-1, 2), solved[size:]


def _block_matrix(blocks: Array, rows: Array, columns: Array, count: int) -> csc_array:
    """Return the matrix (2 count, 2 count) of blocks (E, 2, 2); those in the same place are added."""
    r = 2 * rows[:, None] + (0, 0, 1, 1)
    c = 2 * columns[:, None] + (0, 1, 0, 1)
    entries = (blocks.ravel(), (r.ravel(), c.ravel()))
    return csc_array(coo_array(entries, shape=(2 * count, 2 * count)))


def _open_ways(frame: OwnFrame) -> Array:
    """Return the orthonormal directions (k, 2) of shifts that commute with the group."""
    rows = [np.eye(2) - g.linear for g in frame.group.cosets]
    _, sizes, ways = np.linalg.svd(np.concatenate(rows))
    return ways[sizes < 1e-6]


def _sums(weights: Array, sides: NDArray[np.int64], orbits: VertexOrbits) -> Array:
    """Return for each side (E,) the sum of the weights over all sides at the same orbit."""
    orbit = orbits.source[sides[:, 0]]
    return np.bincount(orbit, weights, minlength=len(orbits.source))[orbit]


def _stiff_edges(frame: OwnFrame, sides: NDArray[np.int64]) -> Array:
    """Return weights (E,) whose solution is a tile with edges that are straight up to 1 / `STIFF`."""
    n = len(frame.points)
    weights = np.ones(len(sides))
    along = (sides < n).all(axis=1)  # no side crosses the inside from outline to outline
    behind = np.where((sides[:, 0] + 1) % n == sides[:, 1], sides[:, 0], sides[:, 1])[along]
    edge = np.searchsorted(frame.starts, behind, side="right") - 1
    # an edge pulls with the same force however many sides it has
    weights[along] = STIFF * np.diff([*frame.starts, n])[edge]
    return weights


def _mean_values(points: Array, triangles: NDArray[np.int64], sides: NDArray[np.int64]) -> Array:
    """Return mean value weights (E,): tangents of half the angles beside a side, over its length."""
    total = np.zeros(len(sides))
    codes = sides[:, 0] * len(points) + sides[:, 1]
    for k in range(3):
        at, left, other = (triangles[:, (k + m) % 3] for m in range(3))
        u, v = points[left] - points[at], points[other] - points[at]
        lengths = np.linalg.norm(u, axis=1), np.linalg.norm(v, axis=1)
        cross, dot = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], (u * v).sum(axis=1)
        half = (lengths[0] * lengths[1] - dot) / cross  # tan of half the angle
        for end, length in zip((left, other), lengths, strict=True):
            np.add.at(total, np.searchsorted(codes, at * len(points) + end), half / length)
    return total
