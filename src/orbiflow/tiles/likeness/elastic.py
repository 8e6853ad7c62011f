"""A silhouette as an elastic body, and the energy of its deformations.

As rigid as possible (Sorkine and Alexa, As-Rigid-As-Possible Surface Modeling, SGP 2007; a distance
for Escher tiles since Nagata and Imahori, 2021): with points x at rest, moved to z, and a rotation
r_i of each, the energy is the sum over all pairs of w_ij |(z_i - z_j) - r_i (x_i - x_j)|^2.
Cotangent weights measure the strain of areas; weights along the outline measure strain by length,
so that small parts count: an ear has little area and much outline. The outline also bends as a rod,
at the square of the change of its curvature, so that straight parts stay straight and corners stay
corners. Points are complex numbers x + iy; a batch of C shapes is (N, C).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse

from orbiflow.arrays import Array, Complex, Integers
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.geometry import best_similarity, complex_points, plane_points, signed_area
from orbiflow.tiles.likeness.measures import Measures
from orbiflow.tiles.silhouette import SilhouetteMesh, triangulate

# the bounds of the weights of areas, which are negative for obtuse triangles
COTANGENT_BOUNDS = (0.05, 40.0)
# the radius of a part that is not thin, in square roots of the area; a disc has 0.56
THICK_RADIUS = 0.25
SALIENCE_BOUNDS = (0.25, 8.0)  # the bounds of the factor of thin parts' weights
POSE_WEIGHT = 4.0  # the weight of the displacement relative to the energy, when shapes are ranked
MAX_REWEIGHTINGS = 50  # the largest number of steps to the rotations of least forgiving energy


@dataclass(frozen=True)
class Stiffness:
    """The costs of deforming a silhouette of area 1.

    - `stretch`: The cost of stretching the outline, per unit of length and squared strain.
    - `bend`: The cost of bending the outline, per unit of length and squared change of curvature.
    - `salience`: The power of thinness in the weights of areas: with 0 a leg of half the width weighs
      half as much per length, with 1 the same; below 0 thin parts deform first.
    - `pose`: The cost of the mean squared distance from the silhouette's best similar copy.
    - `forgiven`: The strain, and the angle of a kink in radians, beyond which `forgiving_energy` grows
      only in proportion.
    """

    stretch: float = 0.2
    bend: float = 0.0003
    salience: float = 0.5
    pose: float = 3.0
    forgiven: tuple[float, float] = (0.1, 0.15)


class ElasticBody(ABC):
    """What springs can pull: N points, of which the first n are an outline, and a quadratic energy.

    Subclasses have the points at rest (N,), the number `size` n, the stiffness matrix (N, N), and the
    forces of shapes. The first `outer` points, n at least, lie on outlines of its figures.
    """

    rest: Complex
    size: int
    outer: int

    def __init__(self) -> None:
        self._solvers: dict[float, Array] = {}

    def __len__(self) -> int:
        return len(self.rest)

    @property
    @abstractmethod
    def figures(self) -> tuple[Elastic, ...]:
        """The figures of which it consists: itself, or several that share a part of their outlines."""

    @property
    @abstractmethod
    def places(self) -> tuple[Integers, ...]:
        """Which of its points each figure's points (N_k,) are."""

    @cached_property
    @abstractmethod
    def matrix(self) -> Array:
        """The dense stiffness matrix (N, N)."""

    @abstractmethod
    def forces(self, z: Complex) -> Complex:
        """Return the right side b (N, C) of matrix z = b, for rotations and pose of shapes (N, C)."""

    def pulled(self, z: Complex, towards: Complex, strength: float, rounds: int) -> Complex:
        """Return shapes (N, C), from `z`, whose outline springs pull towards points (n, C).

        All springs together have `strength`, in the unit of the energy. Each of the rounds chooses
        rotations and solves.
        """
        mu = strength / self.size
        solve = self._pulled_solver(mu)
        for _ in range(rounds):
            right = self.forces(z)
            right[: self.size] += mu * towards
            z = _times(solve, right)
        return z

    @property
    def ring_places(self) -> list[Integers]:
        """Which of its points the outlines (n_k,) of all figures are."""
        owners = zip(self.figures, self.places, strict=True)
        return [places[: figure.size] for figure, places in owners]

    def rings(self, z: Complex) -> list[Complex]:
        """Return the outlines (n_k, ...) of all figures in shapes (N, ...)."""
        return [z[places] for places in self.ring_places]

    def on_outlines(self, rings: Iterable[Complex]) -> Complex:
        """Return the points (m,) that lie on outlines, from the outlines (n_k,) of all figures."""
        points = np.empty(self.outer, dtype=complex)
        for ring, places in zip(rings, self.ring_places, strict=True):
            points[places] = ring
        return points

    @cached_property
    def condensed(self) -> Condensed:
        """The body with its inner points eliminated, so that only the outline is free."""
        return self._condensed_to(self.size)

    @cached_property
    def condensed_to_outlines(self) -> Condensed:
        """The same with the outlines of all figures free."""
        return self.condensed if self.outer == self.size else self._condensed_to(self.outer)

    def _condensed_to(self, n: int) -> Condensed:
        inner = self.matrix[n:, n:]
        if not len(inner):
            none = np.zeros((0, n))
            return Condensed(self.matrix, none, none[:, :0])
        inverse = _inverse(inner)
        follow = -inverse @ self.matrix[n:, :n]
        return Condensed(self.matrix[:n, :n] + self.matrix[:n, n:] @ follow, follow, inverse)

    def _pulled_solver(self, mu: float) -> Array:
        solver = self._solvers.get(mu)  # looked up once: another thread may clear them
        if solver is None:
            matrix = self.matrix.copy()
            matrix[np.arange(self.size), np.arange(self.size)] += mu
            solver = _inverse(matrix)
            if len(self._solvers) >= 16:
                self._solvers.clear()
            self._solvers[mu] = solver
        return solver


class Elastic(ElasticBody):
    """A triangulated silhouette of area about 1 and its energies.

    Its first n points are the counter-clockwise outline `ring` (n, 2). Where some should deform less,
    `stiff` holds factors (n,) or (N,) of the stiffness at the points. `mesh` saves triangulating again.
    """

    def __init__(
        self,
        ring: Array,
        stiffness: Stiffness | None = None,
        *,
        stiff: Array | None = None,
        mesh: SilhouetteMesh | None = None,
    ) -> None:
        super().__init__()
        self.mesh = mesh or triangulate(ring)
        self.stiffness = stiffness or Stiffness()
        self.size = self.outer = len(ring)
        self.rest = complex_points(self.mesh.points)
        pairs = self._pairs(stiff)
        self._i, self._j = pairs.row.astype(np.int64), pairs.col.astype(np.int64)
        self._d = self.rest[self._i] - self.rest[self._j]
        self._rod, self._rod_cost = self._bending(stiff)
        self._curved = self._rod @ self.rest[: self.size]
        shape = (len(self), len(self))
        self._w = pairs.data
        self._weights = scipy.sparse.csr_matrix((self._w, (self._i, self._j)), shape=shape)
        self._sums: scipy.sparse.csr_matrix = scipy.sparse.csr_matrix(
            (self._w * self._d, (self._i, self._j)), shape=shape
        )
        self._conjugate: scipy.sparse.csr_matrix = self._sums.conjugate().tocsr()
        self._own = np.asarray(self._sums.sum(axis=1)).ravel()
        self._own_conjugate = np.conj(self._own)

    @property
    def figures(self) -> tuple[Elastic, ...]:
        return (self,)

    @property
    def places(self) -> tuple[Integers, ...]:
        return (np.arange(len(self)),)

    @cached_property
    def measures(self) -> Measures:
        """What an outline keeps of this one at rest."""
        return Measures(self.rest[: self.size])

    def rotations(self, z: Complex) -> Complex:
        """Return the rotations (N, C), complex units, that suit shapes (N, C) best."""
        n = self.size
        sums = self._own_conjugate[:, None] * z - self._conjugate @ z
        sums[:n] += (self._rod_cost * np.conj(self._curved))[:, None] * (self._rod @ z[:n])
        return sums / np.maximum(abs(sums), 1e-300)

    def energy(self, z: Complex) -> Array:
        """Return the energies (C,) of shapes (N, C) without that of the pose."""
        r = self.rotations(z)
        strain, bent = self._misfits(z, r)
        return self._w @ _squares(strain) + self._rod_cost @ _squares(bent)

    def forgiving_energy(self, z: Complex) -> Array:
        """Return energies (C,) that grow only in proportion to strains and kinks once these are large.

        A strain s costs 2 f^2 (sqrt(1 + (s / f)^2) - 1) instead of s^2 (Charbonnier et al., 1994),
        where f is `Stiffness.forgiven`: a bent joint or a lost toe costs less than the same strain
        spread over the whole outline.
        """
        return self._forgiven(*self._forgiven_misfits(z))

    def cost(self, z: Complex) -> Array:
        """Return the cost (C,) of shapes (N, C): `forgiving_energy` over area, and displacement."""
        area = signed_area(plane_points(z[: self.size].T))
        return self.forgiving_energy(z) / area + POSE_WEIGHT * self.displacement(z)

    def lenient_energy(self, z: Complex) -> Array:
        """Return `forgiving_energy` (C,) at the rotations of least plain energy: an upper bound."""
        return self._forgiven(*self._relative(z, self.rotations(z)))

    def _forgiven(self, strain: Array, kinks: Array) -> Array:
        f, g = self.stiffness.forgiven
        stretched, bent = (2 * (np.sqrt(1 + misfits) - 1) for misfits in (strain, kinks))
        return (self._w * (f * abs(self._d)) ** 2) @ stretched + (self._rod_cost * g**2) @ bent

    def _forgiven_misfits(self, z: Complex) -> tuple[Array, Array]:
        """Return the squared strains and kinks of `_relative` at the best rotations."""
        n = self.size
        turned = np.conj(self._d)[:, None] * (z[self._i] - z[self._j])
        curved = np.conj(self._curved)[:, None] * (self._rod @ z[:n])
        r = self.rotations(z)
        misfits = self._relative(z, r)
        for _ in range(MAX_REWEIGHTINGS - 1):
            weights = (self._w[:, None] / np.sqrt(1 + misfits[0])) * turned
            sums = self._gather @ weights
            sums[:n] += self._rod_cost[:, None] / np.sqrt(1 + misfits[1]) * curved
            before, r = r, sums / np.maximum(abs(sums), 1e-300)
            if abs(r - before).max() < 1e-9:
                break
            misfits = self._relative(z, r)
        return misfits

    def _relative(self, z: Complex, r: Complex) -> tuple[Array, Array]:
        """Return the squared strains of pairs and squared kinks, in units of `Stiffness.forgiven`.

        Strains are means over both ends, so that weights stay symmetric.
        """
        f, g = self.stiffness.forgiven
        strain, bent = self._misfits(z, r)
        relative = _squares(strain) / (f * abs(self._d[:, None])) ** 2
        return (relative + relative[self._mates]) / 2, _squares(bent) / g**2

    @cached_property
    def _mates(self) -> Integers:
        """The same pair from its other end, for each pair."""
        keys = self._i * len(self) + self._j
        order = np.argsort(keys)
        return order[np.searchsorted(keys[order], self._j * len(self) + self._i)]

    @cached_property
    def _gather(self) -> scipy.sparse.csr_matrix:
        """The matrix (N, P) of the sums over the pairs of each point."""
        count = len(self._i)
        at = (self._i, np.arange(count))
        return scipy.sparse.csr_matrix((np.ones(count), at), shape=(len(self), count))

    def _misfits(self, z: Complex, r: Complex) -> tuple[Complex, Complex]:
        strain = (z[self._i] - z[self._j]) - r[self._i] * self._d[:, None]
        bent = self._rod @ z[: self.size] - r[: self.size] * self._curved[:, None]
        return strain, bent

    def displacement(self, z: Complex) -> Array:
        """Return the mean squared distance (C,) from the best similar copy, in areas of the copy."""
        copy, factor = self.copies(z)
        size = np.maximum(abs(factor) ** 2, 1e-12)
        return (abs(z - copy) ** 2).mean(axis=0) / size

    def forces(self, z: Complex) -> Complex:
        """Return the right side b of matrix z = b for the rotations and pose of shapes (N, C)."""
        r = self.rotations(z)
        copy, _ = self.copies(z)
        pull = r * self._own[:, None] + self._sums @ r
        bends = (self._rod_cost * self._curved)[:, None] * r[: self.size]
        pull[: self.size] += self._rod.T @ bends
        return pull + self.stiffness.pose / len(self) * copy

    @cached_property
    def matrix(self) -> Array:
        """The dense stiffness matrix (N, N), including the pose's part."""
        degree = np.asarray(self._weights.sum(axis=1)).ravel()
        pose = self.stiffness.pose / len(self)
        matrix = np.diag(2 * degree + pose) - 2 * self._weights.toarray()
        rod = self._rod.T @ scipy.sparse.diags(self._rod_cost) @ self._rod
        matrix[: self.size, : self.size] += rod.toarray()
        return matrix

    def copies(self, z: Complex) -> tuple[Complex, Complex]:
        """Return best similar copies (N, C) of the body at rest, and the similarities' factors (C,)."""
        center = z.mean(axis=0)
        factor = best_similarity(self.rest, z)
        return center + (self.rest - self.rest.mean())[:, None] * factor, factor

    def _pairs(self, stiff: Array | None) -> Any:
        triangles, count, n = self.mesh.triangles, len(self), self.size
        factors = self._salience()
        i, j, apex = (np.roll(triangles, -k, axis=1).T.ravel() for k in range(3))
        u = np.conj(self.rest[i] - self.rest[apex]) * (self.rest[j] - self.rest[apex])
        cotangent = np.clip(u.real / np.maximum(abs(u.imag), 1e-300), -5.0, 5.0)
        areas = _symmetric(i, j, np.tile(factors, 3) * cotangent / 2, count)
        areas.data = np.clip(areas.data, *COTANGENT_BOUNDS)
        index = np.arange(n)
        after = (index + 1) % n
        # each side counts twice, with either end's rotation
        sides = self.stiffness.stretch / np.maximum(abs(self.rest[after] - self.rest[index]), 1e-6)
        total = (areas + _symmetric(index, after, sides, count)).tocoo()
        if stiff is not None:
            factors = self._everywhere(stiff)
            total.data = total.data * np.sqrt(factors[total.row] * factors[total.col])
        return total

    def _salience(self) -> Array:
        if not self.stiffness.salience:
            return np.ones(len(self.mesh.triangles))
        thinness = THICK_RADIUS / self.mesh.local_thickness
        return np.clip(thinness**self.stiffness.salience, *SALIENCE_BOUNDS)

    def _bending(self, stiff: Array | None) -> tuple[scipy.sparse.csr_matrix, Array]:
        """Return the differences of unit steps along the outline (n, n), and their costs (n,)."""
        n, rest = self.size, self.rest[: self.size]
        index, after = np.arange(n), (np.arange(n) + 1) % n
        length = np.maximum(abs(rest[after] - rest), 1e-6)
        before = np.roll(length, 1)
        values = np.concatenate([1 / length, -1 / length - 1 / before, 1 / before])
        columns = np.concatenate([after, index, (index - 1) % n])
        matrix = scipy.sparse.csr_matrix((values, (np.tile(index, 3), columns)), shape=(n, n))
        cost = 2 * self.stiffness.bend / (length + before)
        return matrix, cost if stiff is None else cost * self._everywhere(stiff)[:n]

    def _everywhere(self, stiff: Array) -> Array:
        factors = np.asarray(stiff, dtype=np.float64)
        if factors.shape not in ((self.size,), (len(self),)) or not (factors > 0).all():
            raise OrbiflowError(
                f"stiff must be ({self.size},) or ({len(self)},) positive factors, "
                f"got shape {factors.shape}"
            )
        return np.concatenate([factors, np.ones(len(self) - len(factors))])


@dataclass(frozen=True, eq=False)
class Condensed:
    """A body whose inner points follow its outline.

    `outline` is the stiffness matrix (n, n) of the outline, `follow` (N - n, n) takes the outline to
    the inner points, and `inverse` is that of the inner points' own matrix (N - n, N - n).
    """

    outline: Array
    follow: Array
    inverse: Array

    @property
    def low(self) -> Complex:
        """A factor (n, k): the outline's matrix is `outline` less it times its adjoint."""
        return np.zeros((len(self.outline), 0), dtype=complex)

    def forces(self, forces: Complex) -> Complex:
        """Return forces (N, C) as forces (n, C) on the outline."""
        n = len(self.outline)
        return forces[:n] + _times(self.follow.T, forces[n:])

    def whole(self, outline: Complex, forces: Complex) -> Complex:
        """Return all points (N, C), from the outline (n, C) and the forces (N, C)."""
        n = len(self.outline)
        inner = _times(self.follow, outline) + _times(self.inverse, forces[n:])
        return np.concatenate([outline, inner])


def _times(matrix: Array, z: Complex) -> Complex:
    """Return the product of a real matrix and complex columns, in real arithmetic."""
    z = np.ascontiguousarray(z)
    return (matrix @ z.view(np.float64)).view(np.complex128)


def _inverse(matrix: Array) -> Array:
    """Return the inverse of a positive definite matrix by Cholesky, in a third of the usual work."""
    functions: Any = scipy.linalg.get_lapack_funcs(("potrf", "potri"), (matrix,))
    factorize, invert = functions
    factor, failed = factorize(matrix, lower=True)
    inverse, missing = invert(factor, lower=True)
    if failed or missing:
        raise OrbiflowError(
            "the silhouette's stiffness has no inverse: check that no part is without width"
        )
    lower: Array = inverse
    return np.tril(lower) + np.tril(lower, -1).T


def _squares(z: Complex) -> Array:
    return z.real**2 + z.imag**2


def _symmetric(i: Integers, j: Integers, v: Array, count: int) -> scipy.sparse.csr_matrix:
    both = (np.concatenate([v, v]), (np.concatenate([i, j]), np.concatenate([j, i])))
    return scipy.sparse.csr_matrix(both, shape=(count, count))
