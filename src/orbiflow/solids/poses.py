"""Where a body lies in a space group: the poses whose copies cover most of space (design point 22).

Of a body of volume 1 and its copies U is the share of space that at least one of them covers. No
fundamental domain has more in common with the body than U of its volume, and the exact tile has that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from orbiflow.arrays import Array, Integers
from orbiflow.solids.families import GroupFamily

BINS = {
    1: 8,
    2: 10,
    3: 12,
    4: 12,
    6: 12,
    8: 16,
}  # along each side of the cell, by the group's order
MOST_BINS = 24
SPREAD = 0.3  # of the logarithms of the lattice's stretches
LEAST_STEP, MOST_STEP = 0.08, 1.5  # of a climb, times those below
LATTICE_STEP, TURN_STEP, SHIFT_STEP = 0.06, 0.12, 0.05
POLISHING_STEP, FINENESS = 0.35, 2  # of a second climb: first steps, and bins to each of the first


@dataclass(frozen=True, eq=False)
class Pose:
    """A place of a body in one of a family's groups.

    - `family`: The groups.
    - `stretches`: Which of them (k,).
    - `turn`: The rotation (3, 3) of the body.
    - `place`: Where its origin lies (3,), in the lattice's coordinates.
    - `cover`: U, as it was estimated.
    """

    family: GroupFamily
    stretches: Array
    turn: Array
    place: Array
    cover: float = 0.0

    @property
    def lattice(self) -> Array:
        """The lattice's basis vectors as columns (3, 3)."""
        return self.family.lattice(self.stretches)

    def moved(self, points: Array) -> Array:
        """Return points (n, 3) of the body in their place."""
        return points @ self.turn.T + self.lattice @ self.place


@dataclass(frozen=True, eq=False)
class Cover:
    """Estimates U of poses by how many of a body's points fall into each orbit of a cell's bins."""

    family: GroupFamily
    points: Array  # (n, 3) evenly inside the body
    fineness: int = 1  # bins along a side of the usual ones

    @cached_property
    def _orbits(self) -> Integers:
        return orbits_of_bins(self.family, self._side)

    @cached_property
    def _number(self) -> int:
        return int(self._orbits.max()) + 1

    @cached_property
    def _side(self) -> int:
        return self.fineness * BINS.get(self.family.order, MOST_BINS)

    def of(self, stretches: Array, turn: Array, place: Array) -> float:
        """Return the share of space that the copies of a body in a pose cover."""
        inverse = np.linalg.inv(self.family.lattice(stretches))
        at = self.points @ (inverse @ turn).T + place
        at -= np.floor(at)
        at *= self._side
        x, y, z = np.ascontiguousarray(at.T).astype(np.intp)
        x, y, z = (np.where(bins == self._side, 0, bins) for bins in (x, y, z))  # rounded up
        counts = np.bincount(self._orbits.take((x * self._side + y) * self._side + z))
        even = len(self.points) / self._number
        return float(np.minimum(counts, even).sum()) / len(self.points)


def orbits_of_bins(family: GroupFamily, side: int) -> Integers:
    """Return the number (side, side, side) of the orbit of each bin of the lattice's cell.

    Where the group does not map bins to bins, as about 3-fold axes, it is that of the bin's centre.
    """
    places = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), -1).reshape(-1, 3)
    least = np.full(len(places), side**3)
    for turn, shift in zip(family.turns, family.shifts, strict=True):
        at = np.floor(((places + 0.5) / side @ turn.T + shift) * side + 1e-6).astype(int) % side
        least = np.minimum(least, np.ravel_multi_index(tuple(at.T), (side,) * 3))
    while (further := least[least] < least).any():
        least = np.where(further, least[least], least)
    return np.unique(least, return_inverse=True)[1].reshape(side, side, side)


def best_poses(
    family: GroupFamily,
    points: Array,
    random: np.random.Generator,
    *,
    tried: int = 1500,
    climbed: int = 12,
    steps: int = 250,
) -> list[Pose]:
    """Return poses of a body that cover most of space, the best first.

    Args:
        family: The groups.
        points: Points (n, 3) evenly inside the body, whose volume is 1.
        random: Where poses are drawn from.
        tried: Number of random poses.
        climbed: Number of these, the best, that climb.
        steps: Of each climb.
    """
    cover = Cover(family, points)
    drawn = [_random_pose(family, random) for _ in range(tried)]
    marks = np.array([cover.of(*pose) for pose in drawn])
    best = np.argsort(-marks, kind="stable")[:climbed]
    poses = [_climbed(cover, drawn[k], float(marks[k]), random, steps) for k in best]
    return sorted(poses, key=lambda pose: -pose.cover)


def polished(
    poses: Sequence[Pose], points: Array, random: np.random.Generator, steps: int
) -> list[Pose]:
    """Return poses of one family that have climbed on, with finer bins, the best first.

    With few points the climb follows the noise of their places: it promises a U that is some
    hundredths too large.

    Args:
        poses: The poses.
        points: Points (n, 3) evenly inside the body, `FINENESS`^3 times as many as for the first climb.
        random: Where steps are drawn from.
        steps: Of each climb.
    """
    cover, better = Cover(poses[0].family, points, FINENESS), list[Pose]()
    for pose in poses:
        start = pose.stretches, pose.turn, pose.place
        better.append(_climbed(cover, start, cover.of(*start), random, steps, POLISHING_STEP))
    return sorted(better, key=lambda pose: -pose.cover)


def _random_pose(family: GroupFamily, random: np.random.Generator) -> tuple[Array, Array, Array]:
    stretches = random.normal(0, SPREAD, family.freedom)
    four = random.normal(size=4)
    return stretches, Rotation.from_quat(four).as_matrix(), random.uniform(0, 1, 3)


def _climbed(
    cover: Cover,
    start: tuple[Array, Array, Array],
    mark: float,
    random: np.random.Generator,
    steps: int,
    size: float = 1.0,
) -> Pose:
    current = start
    for _ in range(steps):
        stretches, turn, place = current
        tried = (
            stretches + size * random.normal(0, LATTICE_STEP, len(stretches)),
            Rotation.from_rotvec(size * random.normal(0, TURN_STEP, 3)).as_matrix() @ turn,
            place + size * random.normal(0, SHIFT_STEP, 3),
        )
        if (reached := cover.of(*tried)) > mark:
            current, mark, size = tried, reached, min(1.3 * size, MOST_STEP)
        else:
            size = max(0.985 * size, LEAST_STEP)
    return Pose(cover.family, *current, mark)
