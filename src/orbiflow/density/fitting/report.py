"""What every fit does before and after its training: split, settle the steps, report."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import torch
from torch import Tensor

from orbiflow.density.fitting.held_out import LEAST_PLACES
from orbiflow.density.fitting.likelihood import Refinement
from orbiflow.density.fitting.parameters import ParametricFit
from orbiflow.density.fitting.repeats import Repeats, places
from orbiflow.density.fitting.rows import mean_of
from orbiflow.density.inference import at_observed
from orbiflow.density.models import Density, FlowDensity
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import Event
from orbiflow.settings import as_instance, as_points

MASS_TOLERANCE = 1e-3
"""Of the integral over the square, and of the log-likelihood at doubled steps."""

MOST_REPORTED = 20_000
"""Points over which the report's mean log densities are taken; after the shuffle the first are as good
as any."""

Progress = Callable[[float, str], None]
"""Told the share of the work done and what is being done."""


def silent(_share: float, _what: str) -> None:
    """Show no progress."""


@dataclass(frozen=True)
class ComponentEvidence:
    """What a component of a density is worth, by `rows` that were held out.

    - `name`: One of `KNOWN`; `share`: Its weight in the density.
    - `alone`: Its mean log density at held-out rows, in nats above the uniform one.
    - `gain`, `error`: Nats that the density would lose without it, and their standard error.
    - `others`: As `alone`, of all other components together; None where the rows are those of all. A
      flow is tried on fewer: compare `alone` with this.
    """

    name: str
    share: float
    alone: float
    gain: float
    error: float
    rows: int
    others: float | None = None

    def __str__(self) -> str:
        worth = f"worth {self.gain:.4f} ± {self.error:.4f} nats"
        words = (
            f"{self.name}: {self.share:.1%}, {worth if self.share else 'would add nothing'}; alone "
            f"{self.alone:.4f} over uniform"
        )
        if self.others is None:
            return words
        return f"{words} at {self.rows} of these rows, where the others have {self.others:.4f}"


@dataclass(frozen=True)
class PartEvidence:
    """What a part of a density where covariates are known is worth at rows held out.

    - `kind`: "all" (the density of all rows), "kernels", "network", "regression" or "joint".
    - `share`: Its weight in the density.
    - `gain`, `error`: Mean nats by which it alone is better than the density of all rows, with the
      standard error.
    """

    kind: str
    share: float
    gain: float
    error: float

    def __str__(self) -> str:
        alone = "" if self.kind == "all" else f", alone {self.gain:+.4f} ± {self.error:.4f} nats"
        return f"{self.kind}: {self.share:.1%}{alone}"


@dataclass(frozen=True)
class GivenReport:
    """How the density where covariates are known was chosen.

    - `declaration`: What the covariates are, in the words of the command line.
    - `rows`: Rows that were held out.
    - `gain`, `error`: Mean nats by which they are likelier where the covariates are known than by the
      density of all rows, with the standard error.
    - `parts`: What it is made of, and what was tried.
    - `untried`: The kinds of parts that were left out to save time.
    """

    declaration: str
    rows: int
    gain: float
    error: float
    parts: tuple[PartEvidence, ...]
    untried: tuple[str, ...] = ()

    def words(self) -> Iterator[str]:
        """Yield what was found, in lines of text."""
        yield (
            f"{self.rows} rows held out are {self.gain:.4f} ± {self.error:.4f} nats likelier where the "
            "covariates are known"
        )
        yield from map(str, self.parts)
        if not self.gain:
            yield "the covariates say nothing about the data that is no accident of few rows"
        if self.untried:
            yield f"effort fast: {' and '.join(self.untried)} not tried"


@dataclass(frozen=True)
class FitReport:
    """What a fit did; log-likelihoods in nats with respect to the square.

    In a fit by evidence (`fit_automatic`) all rows are trained on in the end: `validation` counts those
    that were held out in turn, `validation_nll` is their mean before that, `start_nll` that of the
    uniform density; `stages`, `steps` and `integration_error` are the flow's, if it has a share.

    - `points`, `duplicates`: data points, and those that equal an earlier one.
    - `train_nll`, `validation_nll`: mean negative log density at the end, of `MOST_REPORTED` points
      at most; `start_nll`: on the validation points, of the closed-form start.
    - `stages`: one for each roughness, without those that were undone.
    - `steps`: RK4 steps a segment, in the end.
    - `mass`: integral over the square, see `FlowDensity.mass`; None above two dimensions.
    - `integration_error`: change of the flow's mean validation log density at doubled steps.
    - `weights`: of each kind of component; None for a flow alone.
    - `components`: of a fit by evidence, what each component is worth.
    - `repeats`: of a fit by evidence, what was found of rows that repeat another.
    - `effective`: rows of equal weight that say as much (Kish); None where all weigh the same.
    - `parametric`: of a parametric family alone, its parameters. No rows are held out then:
      `validation` is 0, and `validation_nll` is Akaike's estimate for new rows.
    - `given`: of a fit with covariates, how the density where they are known was chosen.
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
    weights: dict[str, float] | None = None
    components: tuple[ComponentEvidence, ...] = ()
    repeats: Repeats | None = None
    effective: float | None = None
    parametric: ParametricFit | None = None
    given: GivenReport | None = None
    notes: tuple[str, ...] = field(default=())

    def words(self) -> Iterator[str | Event]:
        """Yield what the user is told: tables, and lines of text."""
        if self.given is not None:
            yield from self.given.words()
        if self.parametric is not None:
            yield from self.parametric.words()
        yield from self.notes


def own_points(space: Space, points: Any) -> Tensor:
    """Canonical points (N, d), float64: a copy, for those of `torch.inference_mode` cannot be used."""
    as_instance(space, Space, "space", "see `make_space`")
    return space.project(as_points(points, space.chart_dim, flat=True).detach().double().clone())


def sides(points: Tensor, share: float, generator: torch.Generator) -> tuple[Tensor, Tensor, int]:
    """An order of points (N, d), which of them (N,) are held out in it, how many repeat another."""
    counts, where = places(points)
    if len(counts) < LEAST_PLACES:
        raise OrbiflowError(
            f"a density needs at least {LEAST_PLACES} different points, got {len(counts)} among "
            f"{len(points)}"
        )
    chosen = torch.randperm(len(counts), generator=generator)
    held = torch.zeros(len(counts), dtype=torch.bool)
    held[chosen[: max(1, round(share * len(counts)))]] = True
    order = torch.randperm(len(points), generator=generator)
    return order, held[where][order], len(points) - len(counts)


@torch.no_grad()
def mean_nll(density: Density, points: Tensor, weights: Tensor | None = None) -> float:
    """Mean negative log density at `points` (N, d), weighted, per area of the square."""
    return -mean_of(at_observed(density, points), weights)


def step_error(density: FlowDensity, points: Tensor) -> float:
    """Change of the mean log density at `points` when the steps are doubled."""
    finer = density.with_steps(2 * density.flow.steps)
    return abs(mean_nll(finer, points) - mean_nll(density, points))


def settle(density: FlowDensity, points: Tensor, most: int) -> tuple[float, float | None]:
    """Double the steps until the mean log density has settled and, in two dimensions, the mass is 1.

    Return by how much the mean at `points` (N, d) still changes, and the mass, None in other
    dimensions. The density's flow is given up to `most` steps a segment.
    """
    now = mean_nll(density, points)
    while True:
        finer = mean_nll(density.with_steps(2 * density.flow.steps), points)
        error = abs(finer - now)
        last = density.flow.steps >= most
        if last or error <= MASS_TOLERANCE / 2:
            mass = density.mass() if density.space.dim == 2 else None
            if last or mass is None or abs(mass - 1) <= MASS_TOLERANCE / 2:
                return error, mass
        density.flow, now = density.flow.with_steps(2 * density.flow.steps), finer


def steps_note(steps: int, error: float) -> list[str]:
    """What to say of the error that `settle` left."""
    note = (
        f"the integrator has not converged at {steps} steps a segment: the mean log "
        f"density changes by {error:.1e} when they are doubled"
    )
    return [note] if error > MASS_TOLERANCE else []
