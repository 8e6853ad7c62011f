"""Short flow lines of a field whose starting points have the symmetry of the field's group."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from orbiflow.symmetry import CrystallographicGroup
from orbiflow.symmetry.isometry import Array

_STEPS = 12


def symmetric_seeds(group: CrystallographicGroup, spacing: float, *, tries: int = 600) -> Array:
    """(N, 2) points in the cell, whole orbits, all about `spacing` apart; deterministic.

    Dart throwing: a random orbit is kept if all its points stay `spacing` away from those kept.
    """
    darts = np.random.default_rng(0).random((tries, 2)) @ group.lattice.T
    shifts = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), axis=-1).reshape(-1, 2) @ group.lattice.T
    kept = np.empty((0, 2))
    for dart in darts:
        orbit = group.wrap(np.stack([g(dart) for g in group.cosets]))
        others = np.concatenate([kept, orbit[1:]])
        gaps = np.linalg.norm(others[:, None] + shifts - orbit[0], axis=-1)
        if gaps.size == 0 or gaps.min() >= spacing:
            kept = np.concatenate([kept, orbit])
    return kept


def flow_lines(velocity: Callable[[Array], Array], seeds: Array, length: float) -> Array:
    """(M, 13, 2) flow lines of at most that length, with the seed in the middle.

    Integrated (midpoint rule) at a speed that is near one where the field is strong and goes to
    zero with the field, so that lines end in a sink and do not jitter about it. Seeds where the
    field vanishes are left out.
    """
    speeds = np.linalg.norm(velocity(seeds), axis=-1)
    strongest = float(speeds.max(initial=0.0))
    if strongest == 0.0:
        return np.empty((0, _STEPS + 1, 2))
    step = length / _STEPS

    def direction(points: Array) -> Array:
        vectors = velocity(points)
        return vectors / (np.linalg.norm(vectors, axis=-1, keepdims=True) + 0.05 * strongest)

    def walk(sign: float) -> list[Array]:
        points = [seeds]
        for _ in range(_STEPS // 2):
            half = points[-1] + 0.5 * sign * step * direction(points[-1])
            points.append(points[-1] + sign * step * direction(half))
        return points

    lines = np.stack([*walk(-1.0)[:0:-1], *walk(1.0)], axis=1)
    return lines[speeds > 1e-9 * strongest]
