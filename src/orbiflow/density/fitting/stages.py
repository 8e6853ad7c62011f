"""Refinement in stages, from strong to weak roughness and from few to more Runge-Kutta steps."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from orbiflow.density.fitting.budget import Budget
from orbiflow.density.fitting.likelihood import Refinement, refine
from orbiflow.density.fitting.merging import merged
from orbiflow.density.fitting.report import MASS_TOLERANCE, Progress, nll_at, step_error
from orbiflow.density.fitting.rows import Rows
from orbiflow.density.fitting.settings import FitSettings
from orbiflow.density.models.symmetric import SymmetricDensity

MOST_STEPS = 16
"""Runge-Kutta steps a segment, to which they are doubled where the integrator has not converged."""

MOST_HELD = 4096
"""Validation points that refinement is scored on, and at which the steps are checked."""

CELLS, LEAST_CELLS = 8, 64
"""Cells a wave, and a side at least, in which points are merged; where they crowd in smaller ones."""

MERGED, CROWD = 4096, 2
"""Into how many points the data are merged, roughly; and of how many fair shares a cell is too full."""


def refine_in_stages(
    density: SymmetricDensity,
    train: Rows,
    validation: Rows,
    settings: FitSettings,
    say: Progress,
    budget: Budget,
) -> list[Refinement]:
    """One stage for each roughness; the density's flow ends with the last one's parameters and steps.

    A stage is scored at doubled steps. What is worse than before at twice as many again has gained
    from the integrator's errors alone: it is undone, and repeated at doubled steps.
    """
    stages: list[Refinement] = []
    if not settings.iterations:
        return stages
    dtype = next(density.flow.parameters()).dtype
    points, weights = (
        part.to(dtype)
        for part in merged(
            train.points,
            max(LEAST_CELLS, CELLS * settings.detail),
            crowd=math.ceil(CROWD * len(train) / MERGED),
            row_weights=train.weights,
        )
    )
    # never merged: means of cells would call overfitting to means of cells good
    held = validation[:MOST_HELD]
    held = Rows(held.points.to(dtype), held.weights)
    count = len(settings.roughness)
    while len(stages) < count and not budget.is_spent:
        number = len(stages)

        def watch(iteration: int, nll: float, score: float, number: int = number) -> None:
            share = (number + iteration / settings.iterations) / count
            say(share, f"likelihood: train {nll:.4f}, validation {score:.4f}")

        before = [p.detach().clone() for p in density.flow.parameters()]
        stage = refine(
            density,
            points,
            held.points,
            weights=weights,
            held_weights=_shares(held),
            iterations=settings.iterations,
            kinetic=settings.kinetic,
            roughness=settings.roughness[number],
            budget=budget,
            watch=watch,
        )
        if _exploits(density, held, stage):
            _restore(density, before)
            if density.flow.steps >= MOST_STEPS:
                break
            density.flow = density.flow.with_steps(2 * density.flow.steps)
            continue
        stages.append(stage)
        unconverged = step_error(density, held.points) > MASS_TOLERANCE
        if unconverged and density.flow.steps < MOST_STEPS:
            density.flow = density.flow.with_steps(2 * density.flow.steps)
        elif number > 1 and stage.best == 0:
            break
    return stages


def _exploits(density: SymmetricDensity, held: Rows, stage: Refinement) -> bool:
    if stage.best == 0:
        return False
    honest = nll_at(density, held.points, 4 * density.flow.steps, held.weights)
    return not honest <= stage.validation[0] + MASS_TOLERANCE


def _shares(rows: Rows) -> Tensor | None:
    """Weights of sum 1, in the points' dtype."""
    return None if rows.weights is None else (rows.weights / rows.weights.sum()).to(rows.points)


@torch.no_grad()
def _restore(density: SymmetricDensity, values: list[Tensor]) -> None:
    for parameter, value in zip(density.flow.parameters(), values, strict=True):
        parameter.copy_(value)
