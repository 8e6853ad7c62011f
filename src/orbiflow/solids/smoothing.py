"""Points of a tile's surface that move by orbits of the group, so that copies keep matching."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse

from orbiflow.arrays import Array, Integers
from orbiflow.solids.closing import Function
from orbiflow.solids.complexes import Complex

if TYPE_CHECKING:
    from orbiflow.solids.surfaces import Patches

FARTHEST = 1.2
"""How far a point may go from its corner of the cells, in the shortest edges of a block."""

NEWTON_SHARE = 0.5
"""How far Newton steps may take a point from where it was relaxed, in shares of the farthest."""

RELAXATIONS, ROUNDS, RELAXATIONS_PER_ROUND = 14, 8, 2


class PointOrbits:
    """The points of a tile's surface by orbits of the group: one place for each orbit.

    A place is that of the orbit's first point in the cell of the lattice. Points that elements fix
    only move within what these fix.

    - `complex`: The cells.
    - `number`: The orbit (N,) of each point.
    - `start`: The places (n, 3) of the orbits on the grid.
    - `edges`: The edges (E, 2) of the patches, once in each direction, along which points are smoothed:
      at points where three tiles meet, only those where three tiles meet.
    - `links`: The pairs (2, L) of orbits that an edge links, in both orders.
    - `seams`: The edges (S, 2), in both directions, where three tiles meet.
    - `is_curve`: Whether three tiles meet along an edge at the orbit (n,).
    """

    def __init__(self, complex: Complex, points: Integers, patches: Integers) -> None:
        self.complex = complex
        keys, coset, shift, fixed, _ = _canonical(complex, points, 1)
        _, first, self.number = np.unique(keys, return_index=True, return_inverse=True)
        self._turns = complex.group.linear_parts[coset]
        self._moves = complex.group.translations[coset] + shift @ complex.group.lattice.T
        self._free = fixed[first]
        self.start = self._to_orbit(complex.places(points))[first]
        self.edges, curves = _smoothing_edges(complex, points, patches)
        self.seams = self.edges[curves]
        self.is_curve = np.zeros(len(self.start), bool)
        self.is_curve[self.number[self.edges[curves].ravel()]] = True
        self.links = np.unique(self.number[self.edges], axis=0).T
        at_curve = self.is_curve[self.number[self.edges[:, 0]]]
        self.edges = self.edges[~at_curve | curves]
        self._to_number = self._sum_by(self.number)
        self._to_start = self._sum_by(self.number[self.edges[:, 0]])

    @property
    def longest_move(self) -> float:
        """How far (float) an orbit may move from its start."""
        return FARTHEST * float(np.linalg.norm(self.complex.steps, axis=0).min())

    def places(self, orbits: Array) -> Array:
        """Return where the points (N, 3) are if the orbits are at some places (n, 3)."""
        return np.einsum("nji,nj->ni", self._turns, orbits[self.number] - self._moves)

    def mean_moves(self, moves: Array) -> Array:
        """Return the mean moves (n, 3) of the orbits, of moves (N, 3) of points."""
        turned = np.einsum("nij,nj->ni", self._turns, moves)
        counts = np.bincount(self.number, minlength=len(self.start))
        return self.allowed(self._to_number @ turned / counts[:, None])

    def pull(self, orbits: Array) -> Array:
        """Return for each orbit the step (n, 3) to the mean of its neighbours."""
        points = self.places(orbits)
        a, b = self.edges.T
        steps = np.einsum("nij,nj->ni", self._turns[a], points[b] - points[a])
        counts = np.bincount(self.number[a], minlength=len(self.start))
        return self.allowed(self._to_start @ steps / np.maximum(counts, 1)[:, None])

    def allowed(self, moves: Array) -> Array:
        """Return the part (n, 3) of moves that keeps fixed what elements fix."""
        return np.einsum("nij,nj->ni", self._free, moves)

    def near(self, orbits: Array, start: Array, share: float = 1.0) -> Array:
        """Return places (n, 3) taken back to within a share of the longest move from a start."""
        moves = orbits - start
        lengths = np.linalg.norm(moves, axis=1, keepdims=True)
        longest = share * self.longest_move
        return start + moves * np.minimum(1, longest / np.maximum(lengths, 1e-300))

    def _to_orbit(self, places: Array) -> Array:
        return np.einsum("nij,nj->ni", self._turns, places) + self._moves

    def _sum_by(self, numbers: Integers) -> scipy.sparse.csr_array:
        n = len(numbers)
        shape = (len(self.start), n)
        return scipy.sparse.csr_array((np.ones(n), (numbers, np.arange(n))), shape=shape)


def relax(orbits: PointOrbits, places: Array, steps: int = RELAXATIONS) -> Array:
    """Return the orbits' places (n, 3) after some steps towards the means of their neighbours."""
    for _ in range(steps):
        places = orbits.near(places + 0.6 * orbits.pull(places), orbits.start)
    return places


def place_between_copies(
    orbits: PointOrbits, places: Array, function: Function, patches: Patches
) -> Array:
    """Return the orbits' places (n, 3) where the function is as large as on the copies that meet.

    Rounds of Newton steps, of at most half a spacing, alternate with smoothing along the surface.
    """
    pairs, relaxed = _copies_at_points(patches), places
    for _ in range(ROUNDS):
        for _ in range(RELAXATIONS_PER_ROUND):
            step = orbits.pull(places)
            normals = _orbit_normals(orbits, orbits.places(places), patches.corners)
            along = step - normals * np.einsum("ni,ni->n", step, normals)[:, None]
            step = np.where(orbits.is_curve[:, None], 0.5 * step, along + 0.1 * (step - along))
            places = places + 0.6 * orbits.allowed(step)
        moves = _steps_between_copies(orbits, orbits.places(places), function, pairs)
        places = orbits.near(places + orbits.mean_moves(moves), relaxed, NEWTON_SHARE)
    return places


def _copies_at_points(patches: Patches) -> Integers:
    """Return each point with each copy that is behind a face at it: rows (point, coset, shift)."""
    behind = np.column_stack([patches.cosets, patches.shifts])
    rows = np.column_stack([patches.corners.ravel(), np.repeat(behind, 4, axis=0)])
    return np.unique(rows, axis=0)


def _steps_between_copies(
    orbits: PointOrbits, points: Array, function: Function, pairs: Integers
) -> Array:
    """Return the steps (N, 3) of points to where f(x) = f(g^-1 x) for all copies g that meet them."""
    group, spacing = orbits.complex.group, orbits.complex.spacing
    at, coset, shift = pairs[:, 0], pairs[:, 1], pairs[:, 2:]
    reach = 0.5 * spacing * np.concatenate([np.eye(3), -np.eye(3)])
    around = points[:, None] + reach
    depths = function(around.reshape(-1, 3)).reshape(-1, 6)
    rest = around[at] - (group.translations[coset] + shift @ group.lattice.T)[:, None]
    back = np.einsum("nji,nkj->nki", group.linear_parts[coset], rest)
    excess = depths[at] - function(back.reshape(-1, 3)).reshape(-1, 6)
    slopes = (excess[:, :3] - excess[:, 3:]) / spacing
    steepness = np.linalg.norm(slopes, axis=1)
    floor = 0.3 * np.median(steepness)
    distances = excess.mean(axis=1) / np.maximum(steepness, floor)
    ways = slopes / np.maximum(steepness, floor)[:, None]
    # where the tile is not where the function is largest, it is left as it is
    weights = np.clip(2 - np.abs(distances) / spacing, 0, 1)
    distances = np.clip(distances, -0.5 * spacing, 0.5 * spacing)
    n = len(points)
    matrix, vector = np.tile(0.05 * np.eye(3), (n, 1, 1)), np.zeros((n, 3))
    np.add.at(matrix, at, weights[:, None, None] * ways[:, :, None] * ways[:, None, :])
    np.add.at(vector, at, -(weights * distances)[:, None] * ways)
    return np.linalg.solve(matrix, vector[..., None])[..., 0]


def patch_vectors(corners: Array, three: Array) -> Array:
    """Return the outer normals (n, 3), twice as long as the areas, of patches with corners (n, 4, 3).

    The last corner of those with `three` (n,) corners is a repeated one.
    """
    vectors = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    a, b, c = np.moveaxis(corners[three, :3], 1, 0)
    vectors[three] = np.cross(b - a, c - a)
    return vectors


def _orbit_normals(orbits: PointOrbits, points: Array, patches: Integers) -> Array:
    """Return a unit normal (n, 3) of the surface at each orbit, seen from one of its sides."""
    vectors = patch_vectors(points[patches], patches[:, 2] == patches[:, 3])
    normals = np.zeros_like(points)
    for k in range(4):
        np.add.at(normals, patches[:, k], vectors)
    # from the other side the normal is opposite: one point stands for its orbit
    _, first = np.unique(orbits.number, return_index=True)
    turned = np.einsum("nij,nj->ni", orbits._turns[first], normals[first])
    return turned / np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-300)


def _smoothing_edges(
    complex: Complex, points: Integers, patches: Integers
) -> tuple[Integers, Array]:
    """Return the patches' edges (E, 2), each in both directions, and where three tiles meet (E,)."""
    half = np.stack([patches, np.roll(patches, -1, axis=1)], axis=2).reshape(-1, 2)
    half = half[half[:, 0] != half[:, 1]]
    edges = np.unique(np.sort(half, axis=1), axis=0)
    middles = points[edges[:, 0]] + points[edges[:, 1]]
    keys, _, _, _, fixing = _canonical(complex, middles, 2)
    _, number = np.unique(keys, return_inverse=True)
    # an edge of the tile is one tile's turn at the edge; elements that fix it bring others
    turns = np.bincount(number)[number] * fixing
    both = np.concatenate([edges, edges[:, ::-1]])
    return both, np.tile(turns >= 3, 2)


def _canonical(
    complex: Complex, points: Integers, finer: int
) -> tuple[Integers, Integers, Integers, Array, Integers]:
    """Return the orbits of points (n, 3) of the grid, or of one that is finer still.

    Returns a key (n,) of the orbit, the coset (n,) and shift (n, 3) of an element that takes the point
    to the orbit's first in the lattice's cell, the projection (n, 3, 3), there, to the directions that
    all elements keep which fix it, and how many elements (n,) fix it.
    """
    size = finer * complex.grid
    linear = complex.group.linear_parts
    best, coset = np.full(len(points), np.iinfo(np.int64).max), np.zeros(len(points), np.int64)
    shifts, total = np.zeros((len(points), 3), np.int64), np.zeros((len(points), 3, 3))
    count = np.zeros(len(points), np.int64)
    for k, (matrix, shift) in enumerate(zip(*complex.actions, strict=True)):
        image = points @ matrix.T + finer * shift
        wrapped = np.mod(image, size)
        key = (wrapped[:, 0] * size[1] + wrapped[:, 1]) * size[2] + wrapped[:, 2]
        better, same = key < best, key == best
        best[better], coset[better] = key[better], k
        shifts[better] = (wrapped - image)[better] // size
        total[better], count[better] = linear[k], 1
        total[same] += linear[k]
        count[same] += 1
    # of the elements to the first point, one after another's inverse are those that fix it
    fixed = np.einsum("nij,nkj->nik", total / count[:, None, None], linear[coset])
    return best, coset, shifts, fixed, count
