"""An elastic body with pinned parts, which keep their shape.

A part costs, for each of its points, the squared distance from the nearest similar copy a x + b of
the part x at rest, with complex a and b (shape matching: Mueller et al., Meshless Deformations
Based on Shape Matching, 2005). Stiffer springs would do the same, but with them a part turns, in
each step of choosing rotations and solving, only by the ratio of the stiffnesses; a and b are
solved for together with the points, so that a part moves freely at once. A cost is added if a
differs from a rotation at the whole body's size or, if parts keep their angle, from the whole
body's own rotation.

With a and b eliminated, the stiffness matrix is a real one less W W^H, where W has two complex
columns per part. All equations are solved with the real matrix and corrected (Sherman, Morrison,
Woodbury).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from orbiflow.arrays import Array, Complex, Integers
from orbiflow.tiles.geometry import best_similarity
from orbiflow.tiles.likeness.elastic import Condensed, Elastic, Stiffness
from orbiflow.tiles.silhouette import SilhouetteMesh

SHAPE_WEIGHT = 1e5  # weight of the mean squared distance of the body's points from similar copies
SIZE_WEIGHT = 30.0  # the weight of a part's change of size, for the whole body
ANGLE_WEIGHT = 3e4  # the weight of a part's rotation, for the whole body, if it keeps its angle
MIN_PART_POINTS = 3  # least number of points of a part: a similarity can take two points anywhere


class Pinned(Elastic):
    """A triangulated silhouette with parts that keep their shape.

    `energy` and `lenient_energy` include the parts' cost; `forgiving_energy` leaves it out, so that it
    can be compared with that of bodies with other pins or none. `parts` are the indices of the points
    of each part; parts of fewer than three points are ignored. With `keep_angle` they rotate only with
    the whole body.
    """

    def __init__(
        self,
        ring: Array,
        parts: Sequence[Integers],
        stiffness: Stiffness | None = None,
        *,
        keep_angle: bool = False,
        stiff: Array | None = None,
        mesh: SilhouetteMesh | None = None,
    ) -> None:
        super().__init__(ring, stiffness, stiff=stiff, mesh=mesh)
        self.keep_angle = keep_angle
        # a stiffer body holds its parts more strongly
        unit = (1.0 if stiff is None else float(np.mean(stiff))) / len(self)
        held = unit * (ANGLE_WEIGHT if keep_angle else SIZE_WEIGHT)
        self.parts = [
            _Part(self.rest, index, SHAPE_WEIGHT * unit, held * len(index))
            for index in parts
            if len(index) >= MIN_PART_POINTS
        ]
        self._low = np.zeros((len(self), 2 * len(self.parts)), dtype=complex)
        for k, part in enumerate(self.parts):
            self._low[part.index, 2 * k : 2 * k + 2] = part.columns

    def energy(self, z: Complex) -> Array:
        """Return the energies (C,) of shapes (N, C), with the parts' but without the pose's."""
        return super().energy(z) + self._held(z)

    def lenient_energy(self, z: Complex) -> Array:
        """Return `Elastic.lenient_energy` and the parts' cost: placements that hold them are better."""
        return super().lenient_energy(z) + self._held(z)

    def _held(self, z: Complex) -> Array:
        """Return the cost (C,) of the parts."""
        goals = zip(self.parts, self._goals(z), strict=True)
        return np.sum([part.cost(z, goal) for part, goal in goals], axis=0)

    def misfit(self, outline: Complex) -> float | None:
        """Return how dissimilar the worst part of an outline (n,) is to its original, 0 to 1.

        This is the root mean square distance after the best similarity, over that from the part's
        middle (Procrustes); None if no part has three points of the outline.
        """
        misfits: list[float] = []
        for part in self.parts:
            index = part.index[part.index < self.size]
            if len(index) >= MIN_PART_POINTS:
                rest: Complex = self.rest[index] - self.rest[index].mean()
                bent: Complex = outline[index] - outline[index].mean()
                sizes = np.vdot(rest, rest).real * np.vdot(bent, bent).real
                misfits.append(np.sqrt(max(0.0, 1 - abs(np.vdot(rest, bent)) ** 2 / sizes)))
        return float(max(misfits)) if misfits else None

    def forces(self, z: Complex) -> Complex:
        """Return the forces of `Elastic` and the parts' pull to their sizes or angles."""
        pull = super().forces(z)
        for part, goal in zip(self.parts, self._goals(z), strict=True):
            pull[part.index] += part.pull[:, None] * goal
        return pull

    def _goals(self, z: Complex) -> list[Complex]:
        """Return the values (C,) that each part's a is pulled to."""
        whole = best_similarity(self.rest, z)
        if self.keep_angle:
            return [whole] * len(self.parts)
        turns = [part.factor(z) for part in self.parts]
        return [abs(whole) * a / np.maximum(abs(a), 1e-300) for a in turns]

    @cached_property
    def matrix(self) -> Array:
        """The stiffness matrix (N, N) without the correction W W^H for the parts."""
        spring = np.zeros(len(self))
        for part in self.parts:
            spring[part.index] += part.weight
        return super().matrix + np.diag(spring)

    @cached_property
    def condensed(self) -> PinnedCondensed:
        """The body with its inner points eliminated, so that only the outline is free."""
        plain, n = super().condensed, self.size
        low = self._low
        spread = _complex(plain.inverse @ low[n:])
        coupling = _complex(low[:n] + plain.follow.T @ low[n:])
        solve = _complex(np.linalg.inv(_one_less(low[n:], spread)))
        matrices = plain.outline, plain.follow, plain.inverse
        return PinnedCondensed(*matrices, coupling, spread, solve)

    def pulled(self, z: Complex, towards: Complex, strength: float, rounds: int) -> Complex:
        """Let the outline be pulled towards other points, as `Elastic.pulled` does."""
        mu = strength / self.size
        solve = self._pulled_solver(mu)
        spread = _complex(solve @ self._low)
        small = np.linalg.inv(_one_less(self._low, spread))
        for _ in range(rounds):
            right = self.forces(z)
            right[: self.size] += mu * towards
            z = solve @ right.real + 1j * (solve @ right.imag)
            z += spread @ (small @ (spread.conj().T @ right))
        return z


@dataclass(frozen=True, eq=False)
class PinnedCondensed(Condensed):
    """A pinned body whose inner points, and the parts' similar copies, follow its outline.

    `coupling` (n, k) is that of the outline and the copies, `spread` (N - n, k) takes the copies to
    the inner points, and `solve` (k, k) is the inverse of the copies' own matrix.
    """

    coupling: Complex
    spread: Complex
    solve: Complex

    @property
    def low(self) -> Complex:
        return self.coupling @ np.linalg.cholesky(self.solve)

    def forces(self, forces: Complex) -> Complex:
        """Return forces (N, C) as forces (n, C) on the outline."""
        inner = self.spread.conj().T @ forces[len(self.outline) :]
        return super().forces(forces) + self.coupling @ (self.solve @ inner)

    def whole(self, outline: Complex, forces: Complex) -> Complex:
        """Return all points (N, C), from the outline (n, C) and the forces (N, C)."""
        n = len(self.outline)
        z = super().whole(outline, forces)
        pull = self.coupling.conj().T @ outline + self.spread.conj().T @ forces[n:]
        z[n:] += self.spread @ (self.solve @ pull)
        return z


class _Part:
    """Points `index` of a body at rest (N,) that keep their shape.

    `weight` is that of each point's squared distance from the part's similar copy, `held` that of
    |a - goal|^2.
    """

    def __init__(self, rest: Complex, index: Integers, weight: float, held: float) -> None:
        self.index, self.weight = index, weight
        self.rest = rest[index] - rest[index].mean()
        self.moment = float((abs(self.rest) ** 2).sum())
        both = weight * self.moment + held
        self.stays = weight * self.moment * held / both
        self.pull: Complex = weight * held / both * self.rest
        """Force on each point for a unit of the goal."""
        middle = np.full(len(index), np.sqrt(weight / len(index)))
        self.columns: Complex = np.stack([weight / np.sqrt(both) * self.rest, middle], axis=1)

    def factor(self, z: Complex) -> Complex:
        """Return the factors a (C,) of the similar copies nearest to shapes (N, C)."""
        return np.conj(self.rest) @ z[self.index] / self.moment

    def cost(self, z: Complex, goal: Complex) -> Array:
        """Return the cost (C,) of the part in shapes (N, C)."""
        centered = z[self.index] - z[self.index].mean(axis=0)
        a = self.factor(z)
        apart = (abs(centered - self.rest[:, None] * a) ** 2).sum(axis=0)
        return self.weight * apart + self.stays * abs(a - goal) ** 2


def _complex(array: Array) -> Complex:
    return np.asarray(array, dtype=np.complex128)


def _one_less(low: Complex, spread: Complex) -> Complex:
    """Return 1 - W^H S W, made Hermitian."""
    product = low.conj().T @ spread
    return np.eye(low.shape[1]) - (product + product.conj().T) / 2
