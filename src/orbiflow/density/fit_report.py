"""What every fit does before and after its training: split, settle the steps, report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import torch
from torch import Tensor

from orbiflow.density.density import SymmetricDensity
from orbiflow.density.likelihood import Refinement
from orbiflow.errors import OrbiflowError

MASS_TOLERANCE = 1e-3
"""Of the integral over the square, and of the log-likelihood at doubled steps."""

Progress = Callable[[float, str], None]
"""Told the share of the work done and what is being done."""


@dataclass(frozen=True)
class FitReport:
    """What a fit did; log-likelihoods in nats with respect to the square.

    - `points`, `duplicates`: data points, and those that equal an earlier one.
    - `train`, `validation`: points of each.
    - `train_nll`, `validation_nll`: mean negative log density at the end, of 20,000 points at most.
    - `start_nll`: on the validation points, of the closed-form start.
    - `stages`: one for each roughness.
    - `steps`: RK4 steps a segment, in the end.
    - `mass`: integral over the square, see `SymmetricDensity.mass`; None above two dimensions.
    - `integration_error`: change of the flow's mean validation log density at doubled steps.
    - `shares`: of flow, kernels and uniform floor, None without kernels.
    - `notes`: what the user should know, in words.
    """

    points: int
    duplicates: int
    train: int
    validation: int
    start_nll: float
    train_nll: float
    validation_nll: float
    stages: tuple[Refinement, ...]
    steps: int
    mass: float | None
    integration_error: float
    shares: tuple[float, ...] | None = None
    notes: tuple[str, ...] = field(default=())


def split(points: Tensor, share: float, generator: torch.Generator) -> tuple[Tensor, Tensor, int]:
    """Shuffle and hold out a share, equal points on the same side; and how many repeat another.

    Raises:
        OrbiflowError: if there are fewer than ten different points.
    """
    # rounding keeps together what differs by the projection's last digit
    unique, where = torch.unique((points * 1e9).round(), dim=0, return_inverse=True)
    if len(unique) < 10:
        raise OrbiflowError(
            f"a density needs at least 10 different points, got {len(unique)} among {len(points)}"
        )
    held = torch.zeros(len(unique), dtype=torch.bool)
    held[torch.randperm(len(unique), generator=generator)[: max(1, round(share * len(unique)))]] = (
        True
    )
    order = torch.randperm(len(points), generator=generator)
    points, held = points[order], held[where][order]
    return points[~held], points[held], len(points) - len(unique)


@torch.no_grad()
def mean_nll(density: SymmetricDensity, points: Tensor) -> float:
    """Mean negative log density at `points` (N, d), per area of the square."""
    return -float(density.log_prob(points).mean())


def step_error(density: SymmetricDensity, points: Tensor) -> float:
    """Change of the mean log density at `points` when the steps are doubled."""
    return abs(_finer(density, points) - mean_nll(density, points))


def settle(density: SymmetricDensity, points: Tensor, most: int) -> tuple[float, float | None]:
    """Double the steps until the mean log density has settled and, in two dimensions, the mass is 1.

    Args:
        density: its flow's steps are changed, up to `most`.
        points: (N, d), at which it is looked at.
        most: steps a segment.

    Returns:
        By how much the mean log density still changes, and the mass (None in other dimensions).
    """
    now = mean_nll(density, points)
    while True:
        finer = _finer(density, points)
        error = abs(finer - now)
        last = density.flow.steps >= most
        if last or error <= MASS_TOLERANCE / 2:
            mass = density.mass() if density.space.dim == 2 else None
            if last or mass is None or abs(mass - 1) <= MASS_TOLERANCE / 2:
                return error, mass
        density.flow, now = density.flow.with_steps(2 * density.flow.steps), finer


def _finer(density: SymmetricDensity, points: Tensor) -> float:
    return mean_nll(density.with_steps(2 * density.flow.steps), points)


def repeats_note(count: int, duplicates: int) -> list[str]:
    """What to say of `duplicates` among `count` points."""
    if not duplicates:
        return []
    return [
        f"{duplicates} of {count} points repeat another: they count as often as they come, and "
        "equal points were kept on the same side of the validation split"
    ]


def steps_note(density: SymmetricDensity, error: float) -> list[str]:
    """What to say of the error that `settle` left."""
    if error <= MASS_TOLERANCE:
        return []
    return [
        f"the integrator has not converged at {density.flow.steps} steps a segment: the mean log "
        f"density changes by {error:.1e} when they are doubled"
    ]
