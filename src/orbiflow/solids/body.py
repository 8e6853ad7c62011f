"""The body that bends: nodes on a silhouette's surface and inside it, held together by springs.

Its energy is that of surfaces and solids which move as rigidly as possible (Sorkine and Alexa, 2007):
the sum over edges ij of w_ij |(x_i - x_j) - R (X_i - X_j)|^2, with the best rotation R at each node.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np
import scipy.sparse
from scipy.sparse.linalg import splu
from scipy.spatial import Delaunay, cKDTree
from skimage.measure import marching_cubes  # pyright: ignore[reportAttributeAccessIssue]

from orbiflow.arrays import Array, Integers
from orbiflow.errors import OrbiflowError
from orbiflow.solids.distance import SignedDistance
from orbiflow.solids.mesh import Mesh

EVENING = 6  # steps that even out the surface's points
INNER = 1.45  # spacing of nodes inside over that of the surface
LONGEST_EDGE = 3.0  # times the spacing
THIN, THIN_POWER, MOST_IMPORTANT = 0.55, 1.2, 5.0  # importance of a part so thick, at most
THICKEST = 1.2  # that is told apart
CARRIERS = 8  # nodes that carry a point between them

Weight = Callable[[Array], Array]
"""How much more points (n, 3) matter, (n,): 1 where nothing was said."""


@dataclass(frozen=True, eq=False)
class Body:
    """The nodes of a body of volume 1 and the springs between them.

    - `rest`: (N, 3) where nodes are at rest; those of the surface come first.
    - `faces`: (M, 3) triangles of the surface's nodes.
    - `edges`: (E, 2) the springs, and their stiffness `weights` (E,).
    - `importance`: (N,) how little a node yields to others.
    - `spacing`: Distance of neighbouring nodes on the surface.
    """

    rest: Array
    faces: Integers
    edges: Integers
    weights: Array
    importance: Array
    spacing: float

    @classmethod
    def of(
        cls, distance: SignedDistance, bounds: Array, spacing: float, weight: Weight | None = None
    ) -> Body:
        """Return the body of a surface.

        Args:
            distance: The signed distance to the surface.
            bounds: The least and greatest coordinates (2, 3) of the surface.
            spacing: Distance of neighbouring nodes on the surface.
            weight: What matters more.

        Raises:
            OrbiflowError: If the surface is thinner than the spacing all over.
        """
        surface = _even_surface(distance, bounds, spacing)
        inner = _inner_nodes(distance, bounds, spacing)
        rest = np.concatenate([surface.points, inner])
        edges = _edges(rest, surface, distance, spacing)
        importance = _importance(distance, surface, edges, len(rest))
        if weight is not None:
            importance = importance * weight(rest)
        long = np.linalg.norm(rest[edges[:, 0]] - rest[edges[:, 1]], axis=1)
        stiff = (spacing / np.maximum(long, 0.3 * spacing)) ** 2
        stiff *= importance[edges].prod(axis=1) ** 0.25
        return cls(rest, surface.faces, edges, stiff, importance, spacing)

    @cached_property
    def size(self) -> int:
        """How many nodes are on the surface."""
        return int(self.faces.max()) + 1

    @cached_property
    def _pairs(self) -> tuple[Integers, Integers, Array, Array, Any]:
        """Both directions of all edges: from, to, weights, rests, and what sums over `from`."""
        ones, others = np.concatenate([self.edges, self.edges[:, ::-1]]).T
        weights = np.concatenate([self.weights, self.weights])
        shape = len(self.rest), len(ones)
        sums = scipy.sparse.csr_matrix((np.ones(len(ones)), (ones, np.arange(len(ones)))), shape)
        return ones, others, weights, self.rest[ones] - self.rest[others], sums

    @cached_property
    def laplacian(self) -> Any:
        """The matrix (N, N) of the springs."""
        ones, others, weights, _, sums = self._pairs
        n = len(self.rest)
        across = scipy.sparse.csr_matrix((weights, (ones, others)), (n, n))
        return (scipy.sparse.diags(sums @ weights) - across).tocsc()

    def rotations(self, nodes: Array) -> Array:
        """Return the best rotation (N, 3, 3) at each of the nodes (N, 3)."""
        ones, others, weights, rests, sums = self._pairs
        bent = (nodes[ones] - nodes[others]) * weights[:, None]
        products = (sums @ (bent[:, :, None] * rests[:, None, :]).reshape(-1, 9)).reshape(-1, 3, 3)
        left, _, right = np.linalg.svd(products)
        left[np.linalg.det(left @ right) < 0, :, 2] *= -1
        return left @ right

    def forces(self, rotations: Array) -> Array:
        """Return the springs' forces (N, 3) at rest, turned."""
        ones, others, weights, rests, sums = self._pairs
        both = rotations[ones] + rotations[others]
        return sums @ (np.einsum("eij,ej->ei", both, rests) * (0.5 * weights)[:, None])

    def strain(self, nodes: Array) -> float:
        """Return by how much, of their lengths, springs are longer or shorter than at rest."""
        ones, others, weights, rests, _ = self._pairs
        turned = np.einsum("eij,ej->ei", self.rotations(nodes)[ones], rests)
        lost = (nodes[ones] - nodes[others]) - turned
        return float(np.sqrt((weights @ (lost**2).sum(1)) / (weights @ (rests**2).sum(1))))

    def pulled(self, strength: float) -> Pulled:
        """Return the body with springs of a strength from its surface to places."""
        pull = np.zeros(len(self.rest))
        pull[: self.size] = strength
        return Pulled(self, pull)

    def surface(self, nodes: Array) -> Mesh:
        """Return the surface of the body with nodes in these places (N, 3)."""
        return Mesh(nodes[: self.size], self.faces)

    def carried(self, nodes: Array, points: Array) -> Array:
        """Return where points (n, 3) at rest are carried: a blend of rigid motions of near nodes."""
        away: Array
        near: Integers
        away, near = cast(Any, cKDTree(self.rest).query(points, CARRIERS))
        share = np.maximum(1 - away / (1.05 * away[:, -1:]), 1e-6) ** 2
        share /= share.sum(axis=1, keepdims=True)
        turns = self.rotations(nodes)[near]
        moved = np.einsum("nkij,nkj->nki", turns, points[:, None] - self.rest[near]) + nodes[near]
        return np.einsum("nk,nki->ni", share, moved)


class Pulled:
    """A body whose nodes are pulled: one factorization for all places."""

    def __init__(self, body: Body, pull: Array) -> None:
        self.body, self.pull = body, pull
        matrix = (body.laplacian + scipy.sparse.diags(pull)).tocsc()
        self._factors = splu(
            matrix,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )

    def solved(self, nodes: Array, places: Array) -> Array:
        """Return the nodes (N, 3) after one step: rotations, then all nodes with the surface pulled."""
        force = self.body.forces(self.body.rotations(nodes))
        size = self.body.size
        force[:size] += self.pull[:size, None] * places
        return self._factors.solve(force)


def _even_surface(distance: SignedDistance, bounds: Array, spacing: float) -> Mesh:
    """Return a mesh of a surface whose points lie evenly, so far from each other."""
    low = bounds[0] - 2 * spacing
    counts = np.ceil((bounds[1] + 2 * spacing - low) / spacing).astype(int) + 1
    places = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), -1).reshape(-1, 3)
    values = distance(low + spacing * places).reshape(counts)
    if values.min() >= 0:
        raise OrbiflowError(
            f"the solid is thinner than {spacing:.3g} all over: give it more volume"
        )
    points, faces, *_ = marching_cubes(values, 0.0)
    pieces = Mesh(low + spacing * points, faces).pieces()
    mesh = pieces[0]
    n, edges = len(mesh.points), mesh.edges
    ones, others = np.concatenate([edges, edges[:, ::-1]]).T
    share = 1 / np.bincount(ones, minlength=n)
    mean = scipy.sparse.csr_matrix((share[ones], (ones, others)), (n, n))
    points = mesh.points
    for _ in range(EVENING):
        normals = Mesh(points, mesh.faces).normals
        step_to = mean @ points - points
        step_to -= normals * (step_to * normals).sum(axis=1, keepdims=True)
        points = points + 0.5 * step_to
        points = points - normals * distance(points)[:, None]
    return Mesh(points, mesh.faces)


def _inner_nodes(distance: SignedDistance, bounds: Array, spacing: float) -> Array:
    apart = INNER * spacing
    axes = [np.arange(a, b, apart) for a, b in zip(*bounds, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    # off the grid, so that the triangulation of the nodes has no ties
    grid += np.random.default_rng(0).uniform(-0.1, 0.1, grid.shape) * apart
    return grid[distance(grid) < -0.6 * spacing]


def _edges(rest: Array, surface: Mesh, distance: SignedDistance, spacing: float) -> Integers:
    """Return the edges (E, 2) of tetrahedra inside the body, and those of its surface."""
    cells = Delaunay(rest).simplices
    cells = cells[distance(rest[cells].mean(axis=1)) < 0]
    pairs = np.concatenate([cells[:, [i, j]] for i in range(4) for j in range(i)])
    edges = np.unique(np.sort(pairs, axis=1), axis=0)
    edges = edges[distance(rest[edges].mean(axis=1)) < 0.25 * spacing]
    edges = np.unique(np.concatenate([edges, surface.edges]), axis=0).astype(np.int64)
    long = np.linalg.norm(rest[edges[:, 0]] - rest[edges[:, 1]], axis=1)
    return edges[long < LONGEST_EDGE * spacing]


def _importance(distance: SignedDistance, surface: Mesh, edges: Integers, count: int) -> Array:
    """Return how much each node matters: more where the body is thin, smoothly."""
    depths = np.arange(0.06, THICKEST, 0.03)
    deep = surface.points[:, None] - surface.normals[:, None] * depths[:, None]
    out = (distance(deep.reshape(-1, 3)) > 0).reshape(len(surface.points), -1)
    thick = np.where(out.any(axis=1), depths[out.argmax(axis=1)], THICKEST)
    worth, reached = np.ones(count), np.zeros(count)
    worth[: len(thick)] = np.clip((THIN / thick) ** THIN_POWER, 1, MOST_IMPORTANT)
    reached[: len(thick)] = 1
    ones, others = np.concatenate([edges, edges[:, ::-1]]).T
    links = scipy.sparse.csr_matrix((np.ones(len(ones)), (ones, others)), (count, count))
    near: Any = links + scipy.sparse.identity(count)
    for _ in range(5):
        total = near @ reached
        worth = np.where(total > 0, (near @ (worth * reached)) / np.maximum(total, 1e-9), worth)
        reached = (total > 0).astype(float)
    return np.where(reached > 0, worth, 1.0)
