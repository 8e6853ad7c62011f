"""Fitting a density to points of the chart: split, match, refine, check."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import torch
from torch import Tensor

from orbiflow.density.bases import Base, UniformBase, VonMisesBase
from orbiflow.density.density import SymmetricDensity
from orbiflow.density.fit_report import (
    MASS_TOLERANCE,
    FitReport,
    Progress,
    mean_nll,
    repeats_note,
    settle,
    split,
    step_error,
    steps_note,
)
from orbiflow.density.kernel_fit import mix_kernels
from orbiflow.density.likelihood import Refinement, refine
from orbiflow.density.matching import coupled, match_flow
from orbiflow.density.merging import merged
from orbiflow.density.space import Space
from orbiflow.errors import OrbiflowError
from orbiflow.fields import SplineField
from orbiflow.flows import Flow

MOST_STEPS = 16
"""Runge-Kutta steps a segment, to which they are doubled where the integrator has not converged."""

MOST_MATCHED = 6_000
"""Points that the closed-form start looks at."""

MOST_REPORTED = 20_000
"""Points over which the report's mean log densities are taken."""

CELLS, LEAST_CELLS = 8, 64
"""Cells a wave, and a side at least, in which points are merged; where they crowd in smaller ones."""

MERGED, CROWD = 4096, 2
"""Into how many points the data are merged, roughly; and of how many fair shares a cell is too full."""

MOST_HELD = 4096
"""Validation points that refinement is scored on, and at which the steps are checked."""


@dataclass(frozen=True)
class FitSettings:
    """Knobs of a fit; the defaults are measured on the benchmarks.

    - `detail`: largest wave number of the fields, in waves along a side of the square.
    - `segments`: stationary pieces of the flow.
    - `steps`: RK4 steps in each, at first; doubled where the integrator has not converged.
    - `smoothness`: exponent s of the parameters' scaling (1 + |kappa|^2)^(-s/2).
    - `ridge`: of the closed-form start.
    - `roughness`: weights of the roughness penalty, each a stage of refinement from where the one
      before was best on the validation points; largest first.
    - `kinetic`: weight of the kinetic energy.
    - `iterations`: of L-BFGS in each stage, at most; 0 keeps the closed-form start.
    - `validation`: share of the points held out for early stopping.
    - `base`: "uniform" or "von-mises", the paper's.
    - `kernels`: mix the flow with adaptive kernels about the training points, for data sharper than
      the flow's waves; see `mix_kernels`.
    - `single`: train in float32, about twice as fast; the result is float64 in any case.
    - `seconds`: of refinement at most.
    - `seed`: of the split, the base points and the times.
    """

    detail: int = 8
    segments: int = 6
    steps: int = 1
    smoothness: float = 2.0
    ridge: float = 1e-4
    roughness: tuple[float, ...] = (1e-3, 1e-3, 1e-4)
    kinetic: float = 0.0
    iterations: int = 100
    validation: float = 0.1
    base: str = "uniform"
    kernels: bool = False
    single: bool = True
    seconds: float = math.inf
    seed: int = 0

    def __post_init__(self) -> None:
        for name, low, high in (
            ("detail", 1, 64),
            ("segments", 1, 256),
            ("steps", 1, 256),
            ("smoothness", 0, 8),
            ("ridge", 0, math.inf),
            ("kinetic", 0, math.inf),
            ("iterations", 0, 100_000),
            ("seconds", 0, math.inf),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise OrbiflowError(f"{name} must be from {low:g} to {high:g}, got {value!r}")
        if not 0 < self.validation < 1:
            raise OrbiflowError(f"validation must be between 0 and 1, got {self.validation!r}")
        if not self.roughness or min(self.roughness) < 0:
            raise OrbiflowError(f"roughness needs weights of at least 0, got {self.roughness!r}")
        if self.base not in ("uniform", "von-mises"):
            raise OrbiflowError(f'base must be "uniform" or "von-mises", got {self.base!r}')


def fit_density(
    space: Space,
    points: Tensor,
    settings: FitSettings | None = None,
    *,
    progress: Progress | None = None,
) -> tuple[SymmetricDensity, FitReport]:
    """Fit a flow of spline fields to canonical points by flow matching, then by likelihood.

    Points that share a small cell are merged, so the time hardly grows with their number.

    Args:
        space: of two dimensions; see `fit_neural` for tori of more.
        points: (N, d) in the chart, N >= 10 different ones.
        settings: default `FitSettings()`.
        progress: told how far it is.

    Returns:
        The density, float64, and the report.

    Raises:
        OrbiflowError: for too few points.
    """
    settings = settings or FitSettings()
    say = progress or (lambda _share, _what: None)
    generator = torch.Generator().manual_seed(settings.seed)
    points = space.project(points.double())
    train, validation, duplicates = split(points, settings.validation, generator)
    base: Base = UniformBase(space) if settings.base == "uniform" else VonMisesBase(space)
    dtype = torch.float32 if settings.single else torch.float64
    segments = [
        SplineField(
            space.group,
            max_frequency(space, settings.detail),
            smoothness=settings.smoothness,
            dtype=dtype,
        )
        for _ in range(settings.segments)
    ]
    say(0.0, "matching")
    chosen = train[:MOST_MATCHED]
    start, move = coupled(space, base.sample(len(chosen), generator), chosen)
    match_flow(
        segments,
        space,
        start.to(dtype),
        move.to(dtype),
        ridge=settings.ridge,
        generator=generator,
    )
    density = SymmetricDensity(space, Flow(segments, steps=settings.steps, warn=False), base)
    start_nll = mean_nll(density, validation.to(dtype))
    stages = _refined(density, train, validation, settings, say)
    density.flow.double()
    error, mass = settle(density, validation[:MOST_REPORTED], MOST_STEPS)
    notes = repeats_note(len(points), duplicates) + steps_note(density, error)
    shares = None
    if settings.kernels:
        say(1.0, "kernels")
        density = mix_kernels(density, train, validation)
        mass = None if mass is None else density.mixed_mass(mass)
        shares = tuple(density.shares.tolist())
        notes.append(
            "the density is a mixture: flow {:.1%}, kernels {:.1%}, uniform floor {:.1%}".format(
                *shares
            )
        )
    notes += _mass_note(space, mass)
    # after the shuffle the first are as good as any
    train_nll, validation_nll = (
        mean_nll(density, part[:MOST_REPORTED]) for part in (train, validation)
    )
    report = FitReport(
        points=len(points),
        duplicates=duplicates,
        train=len(train),
        validation=len(validation),
        start_nll=start_nll,
        train_nll=train_nll,
        validation_nll=validation_nll,
        stages=tuple(stages),
        steps=density.flow.steps,
        mass=mass,
        integration_error=error,
        shares=shares,
        notes=tuple(notes),
    )
    return density, report


def max_frequency(space: Space, detail: int) -> int:
    """Frequency index that reaches `detail` waves along a side of the square."""
    return round(detail * float(space.group.lattice.diagonal().max()))


def _refined(
    density: SymmetricDensity,
    train: Tensor,
    validation: Tensor,
    settings: FitSettings,
    say: Progress,
) -> list[Refinement]:
    stages: list[Refinement] = []
    if not settings.iterations:
        return stages
    dtype = next(density.flow.parameters()).dtype
    points, weights = (
        part.to(dtype)
        for part in merged(
            train,
            max(LEAST_CELLS, CELLS * settings.detail),
            crowd=math.ceil(CROWD * len(train) / MERGED),
        )
    )
    # never merged: means of cells would call overfitting to means of cells good
    held = validation[:MOST_HELD].to(dtype)
    count = len(settings.roughness)
    left = settings.seconds
    for number, roughness in enumerate(settings.roughness):

        def watch(iteration: int, nll: float, score: float, number: int = number) -> None:
            share = (number + iteration / settings.iterations) / count
            say(share, f"likelihood: train {nll:.4f}, validation {score:.4f}")

        stage = refine(
            density,
            points,
            held,
            weights=weights,
            iterations=settings.iterations,
            kinetic=settings.kinetic,
            roughness=roughness,
            seconds=left,
            watch=watch,
        )
        left -= stage.seconds
        stages.append(stage)
        unconverged = step_error(density, held) > MASS_TOLERANCE
        if unconverged and density.flow.steps < MOST_STEPS:
            density.flow = density.flow.with_steps(2 * density.flow.steps)
        elif left <= 0 or (number > 1 and stage.best == 0):
            break
    return stages


def _mass_note(space: Space, mass: float | None) -> list[str]:
    if mass is None or abs(mass - 1) <= MASS_TOLERANCE:
        return []
    return [f"the density integrates to {mass:.4f} over the {space.name}, not to 1"]


KNOWN = tuple(f.name for f in fields(FitSettings))
"""Names of the settings."""
