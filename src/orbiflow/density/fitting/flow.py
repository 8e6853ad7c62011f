"""Fitting a flow to points of the chart: split, match in closed form, refine, check."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from scipy.optimize import linear_sum_assignment
from torch import Tensor

from orbiflow.density.data import alongside
from orbiflow.density.fitting.likelihood import HopelessAt, Refinement, merged, refine, training
from orbiflow.density.fitting.report import (
    MASS_TOLERANCE,
    MOST_REPORTED,
    FitReport,
    Progress,
    mean_nll,
    own_points,
    settle,
    sides,
    silent,
    step_error,
    steps_note,
)
from orbiflow.density.fitting.rows import Rows, effective_rows, weighed, weights_note
from orbiflow.density.fitting.settings import DensitySettings, FlowSettings
from orbiflow.density.models import FlowDensity, UniformDensity, flow_obstacle
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError, SettingError
from orbiflow.fields import FourierField, InvariantField, SplineField, has_even_grid
from orbiflow.flows import Flow
from orbiflow.settings import as_instance

DTYPE = torch.float32
"""The dtype in which a flow is trained, about twice as fast; the result is float64."""

SMOOTHNESS = 2.0
"""Exponent s of the scaling (1 + |kappa|^2)^(-s/2) of the flow's parameters."""

MOST_TRAINING_STEPS = 16
"""Runge-Kutta steps a segment, to which they are doubled where the integrator has not converged: one
at first."""

MOST_HELD = 4096
"""Validation points that refinement is scored on, and at which the steps are checked."""

CELLS, LEAST_CELLS = 8, 64
"""Cells a wave, and a side at least, in which points are merged; where they crowd in smaller ones."""

MERGED_POINTS, CROWDED_SHARES = 4096, 2
"""Into how many points the data are merged, roughly; and of how many fair shares a cell is too full."""


Outdone = Callable[[FlowDensity, float], bool]
"""Whether a flow can be given up that may still gain so many nats."""


def refine_in_stages(
    density: FlowDensity,
    train: Rows,
    validation: Rows,
    settings: FlowSettings,
    say: Progress,
    outdone: Outdone | None = None,
) -> list[Refinement]:
    """Refine once for each roughness; the density's flow ends with the last one's parameters and steps.

    It may be given up if it is `outdone`, during the first stage or after it.

    A stage is scored at doubled steps. What is worse than before at twice as many again has gained
    from the integrator's errors alone: it is undone, and repeated at doubled steps.
    """
    stages: list[Refinement] = []
    if not settings.iterations:
        return stages
    train, held = _refined_on(train, validation, settings.max_frequency)
    count = len(settings.roughness)

    def hopeless(hope: float) -> bool:
        return outdone is not None and outdone(density, hope)

    while len(stages) < count and (left := settings.evaluations - spent_on(stages)) > 0:
        number = len(stages)
        stage = _stage(
            density, train, held, settings, number, say, left, None if number else hopeless
        )
        can_double = density.flow.steps < MOST_TRAINING_STEPS
        if stage is None and not can_double:
            break
        if stage is not None:
            stages.append(stage)
            if stage.stopped == "outdone" or (number == 0 and count > 1 and hopeless(0.0)):
                break
        if stage is None or (step_error(density, held.points) > MASS_TOLERANCE and can_double):
            density.flow = density.flow.with_steps(2 * density.flow.steps)
        elif number > 1 and stage.best == 0:
            break
    return stages


def spent_on(stages: Sequence[Refinement]) -> int:
    """Return how many evaluations stages of refinement took."""
    return sum(stage.evaluations for stage in stages)


def _stage(
    density: FlowDensity,
    train: Rows,
    held: Rows,
    settings: FlowSettings,
    number: int,
    say: Progress,
    evaluations: int,
    hopeless: HopelessAt | None,
) -> Refinement | None:
    """Refine at one roughness; undo what has only exploited the integrator, and return None."""

    def watch(iteration: int, nll: float, score: float) -> None:
        share = (number + iteration / settings.iterations) / len(settings.roughness)
        say(share, f"likelihood: train {nll:.4f}, validation {score:.4f}")

    before = [p.detach().clone() for p in density.flow.parameters()]
    stage = refine(
        density,
        train,
        held,
        iterations=settings.iterations,
        roughness=settings.roughness[number],
        evaluations=evaluations,
        watch=watch,
        hopeless=hopeless,
    )
    finer = density.with_steps(4 * density.flow.steps)
    honest = mean_nll(finer, held.points, held.weights) if stage.best else -math.inf
    if honest <= stage.validation[0] + MASS_TOLERANCE:
        return stage
    with torch.no_grad():
        for parameter, value in zip(density.flow.parameters(), before, strict=True):
            parameter.copy_(value)
    return None


def _refined_on(train: Rows, validation: Rows, max_frequency: int) -> tuple[Rows, Rows]:
    """Return the merged rows that refinement trains on, and those that it is scored on."""
    cells = max(LEAST_CELLS, CELLS * max_frequency)
    train = merged(train, cells, crowd=math.ceil(CROWDED_SHARES * len(train) / MERGED_POINTS))
    # never merged: means of cells would call overfitting to means of cells good
    held = validation[:MOST_HELD]
    if held.weights is not None:
        held = replace(held, weights=held.weights / held.weights.sum())
    return train.to(DTYPE), held.to(DTYPE)


MOST_STEPS = 256
"""Runge-Kutta steps a segment to which they are doubled, in the end, until the integral is right."""

MOST_MATCHED = 6_000
"""Points that the closed-form start looks at."""


@training()
def fit_density(
    space: Space,
    points: Tensor,
    settings: FlowSettings | None = None,
    *,
    weights: Any = None,
    progress: Progress | None = None,
    outdone: Outdone | None = None,
) -> tuple[FlowDensity, FitReport]:
    """Fit a flow of spline fields to canonical points by flow matching, then by likelihood.

    Points (N, d) are in the chart of a space of three dimensions at most; of `weights` (N,) only the
    ratios count. Points that share a small cell are merged, so the time hardly grows with their number.
    The density is float64. A flow that is `outdone` is refined no further.
    """
    settings = as_instance(
        FlowSettings() if settings is None else settings, FlowSettings, "settings"
    )
    obstacle = flow_obstacle(as_instance(space, Space, "space", "see `make_space`"))
    if obstacle:
        others = "kernels,mixture,chains,network" if space.has_chart else "kernels,mixture"
        raise OrbiflowError(f'{obstacle}: fit other components, such as "{others}"')
    say = progress or silent
    generator = torch.Generator().manual_seed(settings.seed)
    points, weights = alongside(points=points, weights=weights)
    rows = weighed(own_points(space, points), weights)
    order, out, duplicates = sides(rows.points, settings.validation, generator)
    train, validation = (rows[order[side]] for side in (~out, out))
    say(0.0, "matching")
    density = _start(space, train, settings, generator)
    start_nll = mean_nll(density, validation.points.to(DTYPE), validation.weights)
    stages = refine_in_stages(density, train, validation, settings, say, outdone)
    density.flow.double()
    error, mass = settle(density, validation.points[:MOST_HELD], MOST_STEPS)
    notes = [*weights_note(rows)]
    if duplicates:
        notes.append(
            f"{duplicates} of {len(rows)} points repeat another: they count as often as they come, and "
            "equal points were kept on the same side of the validation split"
        )
    if spent_on(stages) >= settings.evaluations:
        notes.append(f"stopped by the budget of {settings.evaluations} evaluations")
    notes += steps_note(density.flow.steps, error)
    if mass is not None and abs(mass - 1) > MASS_TOLERANCE:
        notes.append(f"the density integrates to {mass:.4f} over the {space.name}, not to 1")
    train_nll, validation_nll = (
        mean_nll(density, some.points, some.weights)
        for some in (train[:MOST_REPORTED], validation[:MOST_REPORTED])
    )
    report = FitReport(
        points=len(rows),
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
        effective=None if rows.weights is None else effective_rows(rows.weights),
        notes=tuple(notes),
    )
    return density, report


def _start(
    space: Space, train: Rows, settings: FlowSettings, generator: torch.Generator
) -> FlowDensity:
    """The closed-form start, by flow matching."""
    # the frequency index that reaches so many waves along a side of the square
    longest = float(np.linalg.norm(space.group.lattice, axis=0).max())
    frequency = round(settings.max_frequency * longest)
    kind = SplineField if has_even_grid(space.group) else FourierField
    segments = [
        kind(space.group, frequency, smoothness=SMOOTHNESS, dtype=DTYPE)
        for _ in range(settings.segments)
    ]
    chosen = _matched(train, generator)
    start, move = coupled(space, UniformDensity(space).sample(len(chosen), generator), chosen)
    match_flow(segments, space, start.to(DTYPE), move.to(DTYPE), generator=generator)
    return FlowDensity(space, Flow(segments, steps=1, warn=False))


def _matched(train: Rows, generator: torch.Generator) -> Tensor:
    """Points that are matched: base points have one weight, so heavy rows come more often."""
    if train.weights is None:
        return train.points[:MOST_MATCHED]
    count = min(len(train), MOST_MATCHED)
    ends = train.weights.cumsum(0) / train.weights.sum()
    even = (
        torch.arange(count) + torch.rand(count, dtype=torch.float64, generator=generator)
    ) / count
    rows = torch.searchsorted(ends, even).clamp_max(len(train) - 1)
    # in random order, as pairs are sought among neighbours in it
    return train.points[rows[torch.randperm(count, generator=generator)]]


RIDGE_ORDER = 3
"""Of the derivatives that the ridge holds small: the displacements are smooth, their noise is not."""

RIDGE_WEIGHT = 1e-4
"""Weight of E|V|^2 + E|grad^3 V|^2, lengths in wavelengths, beside the data's 1."""

TIMES_PER_GEODESIC = 2
"""Times at each geodesic and segment."""

MATCHED_AT_ONCE = 400
"""Points matched optimally at a time: the cost of an assignment grows with the cube."""


def coupled(
    space: Space, start: Tensor, end: Tensor, *, group: int = MATCHED_AT_ONCE
) -> tuple[Tensor, Tensor]:
    """Pair base points with data points so that their geodesics are short.

    Within groups of `group` points the sum of squared distances over group images is least
    (minibatch optimal transport: Tong et al., 2024; Pooladian et al., 2023). Of canonical points
    (N, d), return starts and shortest displacements, both (N, d), in the order of `end`.
    """
    order: list[Tensor] = []
    for first in range(0, len(end), group):
        cost = space.squared_distances(start[first : first + group], end[first : first + group])
        rows, columns = linear_sum_assignment(cost.cpu().numpy())
        order.append(first + torch.as_tensor(rows[np.argsort(columns)]))
    paired = start[torch.cat(order)]
    return paired, space.displacement(paired, end)


@torch.no_grad()
def match_flow(
    fields: Sequence[InvariantField],
    space: Space,
    start: Tensor,
    move: Tensor,
    *,
    ridge: float = RIDGE_WEIGHT,
    iterations: int = 15,
    generator: torch.Generator | None = None,
) -> None:
    """Set the parameters of `fields`, the equal segments of a flow, by ridge regression.

    Segment k of K regresses the displacements at points on the geodesics at times in [k / K, (k + 1) /
    K] (Lipman et al., Flow Matching for Generative Modeling, 2023). A segment of duration 1 carries
    what takes time 1 / K, hence the factor. At each geodesic and segment there are
    `TIMES_PER_GEODESIC` times. `iterations` are those of conjugate gradients at most.
    """
    count = len(fields)
    for k, field in enumerate(fields):
        shape = (TIMES_PER_GEODESIC, len(start), 1)
        time = torch.rand(shape, dtype=start.dtype, generator=generator)
        points = (start + (k + time) / count * move).reshape(-1, space.dim)
        values = (move / count).expand(TIMES_PER_GEODESIC, -1, -1).reshape(-1, space.dim)
        field.parameters_.copy_(_least_squares(field, points, values, ridge, iterations))


def _least_squares(
    field: InvariantField, points: Tensor, values: Tensor, ridge: float, iterations: int
) -> Tensor:
    size = len(points)
    magnitude = torch.as_tensor(field.basis.magnitude).to(points)
    weight = ridge * (1 + magnitude ** (2 * RIDGE_ORDER)) * field.scale**2

    def normal(c: Tensor) -> Tensor:
        field.parameters_.copy_(c)
        return field.adjoint(points, field(points)) / size + weight * c

    right = field.adjoint(points, values) / size
    # the columns are orthonormal for even points, so this is nearly the diagonal
    return conjugate_gradients(normal, right, field.scale**2 + weight, iterations)


def conjugate_gradients(
    apply: Callable[[Tensor], Tensor],
    right: Tensor,
    diagonal: Tensor,
    iterations: int,
    tolerance: float = 1e-4,
) -> Tensor:
    """Solve a positive definite system, preconditioned by its approximate diagonal."""
    x, residual = torch.zeros_like(right), right.clone()
    z = residual / diagonal
    direction, old = z.clone(), residual @ z
    stop = tolerance**2 * old
    for _ in range(iterations):
        if old <= stop:
            break
        image = apply(direction)
        step = old / (direction @ image)
        x = x + step * direction
        residual = residual - step * image
        z = residual / diagonal
        new = residual @ z
        direction, old = z + new / old * direction, new
    return x


def refuse_flow_settings(settings: DensitySettings, space: Space) -> None:
    """Refuse settings of a flow on a space that has none."""
    chosen = list(settings.of_flow)
    if chosen:
        where = f"a torus of {space.dim} angles" if space.is_torus else f"the {space.name}"
        names = ", ".join(f"{{{name}}}" for name in chosen)
        raise SettingError(
            f"{names} would have no effect on {where}, where there is no flow; leave "
            f"{'it' if len(chosen) == 1 else 'them'} out"
        )
