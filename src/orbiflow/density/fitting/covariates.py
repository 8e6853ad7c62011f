"""Fitting p(data | covariates): held-out rows choose, by their conditional log densities."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.density.data import alongside, group_numbers
from orbiflow.density.fitting.automatic import ChosenFit, fit_chosen, fit_in_folds
from orbiflow.density.fitting.circular_regression import fit_regression
from orbiflow.density.fitting.conditional_kernels import fit_kernels
from orbiflow.density.fitting.held_out import Folds, folds_of, sparse_weights, stacked
from orbiflow.density.fitting.joint import for_conditionals
from orbiflow.density.fitting.neural_mixture import fit_networks
from orbiflow.density.fitting.report import FitReport, GivenReport, PartEvidence, Progress, silent
from orbiflow.density.fitting.rows import Rows, gain_of, weighed
from orbiflow.density.fitting.settings import DensitySettings
from orbiflow.density.models import (
    CircularRegression,
    ConditionalDensity,
    ConditionalKernels,
    ConditionalPart,
    Density,
    JointDensity,
    NeuralMixture,
    Unconditional,
    covariate_turns,
    is_joint_possible,
    joint_torus,
)
from orbiflow.density.spaces import Covariates, Space, Torus, Values
from orbiflow.errors import DataWarning, OrbiflowError, SettingError
from orbiflow.runtime import one_thread
from orbiflow.typed_torch import listed

LEAST_ROWS = 30
"""The fewest rows of which a tenth can be held out, and a tenth kept apart."""

NETWORKS = 2
"""Networks for each fold that is held out: the mean of several is better than each."""

MOST_CHAINED = 3
"""The most columns of joint densities with chains."""

MOST_JOINT_ROWS = 10_000
"""The most rows that a joint density is fitted to."""


@dataclass(frozen=True)
class _Task:
    """Rows in random order, their features, and their folds.

    - `number`: The number (m,) of the covariate of each feature.
    - `settings`: Those of joint densities.
    """

    space: Space
    folds: Folds
    x: Tensor
    number: Tensor
    settings: DensitySettings

    @property
    def rows(self) -> Rows:
        """All rows."""
        return self.folds.rows

    def where(self, fold: int) -> Tensor:
        """Return the numbers of the rows of a fold."""
        return torch.nonzero(self.folds.fold == fold)[:, 0]

    def held(self, fold: int) -> Tensor:
        """Return the numbers of the rows of a fold by which densities are judged."""
        return self.where(fold)[: len(self.folds.held(fold))]

    @torch.no_grad()
    def logs(self, part: ConditionalPart, fold: int) -> Tensor:
        """Return what a part says of the rows by which it is judged."""
        rows = self.held(fold)
        return part.log_prob(self.rows.points[rows], self.x[rows])


Fit = Callable[[Tensor, int | None], ConditionalPart]
"""What fits a part to some rows (N,), which lack a fold or are all."""


def check_complete(missing: str) -> None:
    """Refuse to fit rows that lack angles, of which no density is known where covariates are."""
    if missing != "refuse":
        raise SettingError(
            f"{{missing}} {missing} has no densities where covariates are known: leave out such rows"
        )


@one_thread()
def fit_conditional(
    pooled: ChosenFit,
    points: Tensor,
    cells: Mapping[str, Values],
    covariates: Covariates,
    settings: DensitySettings,
    *,
    weights: Any = None,
    groups: ArrayLike | None = None,
    progress: Progress | None = None,
) -> FitReport:
    """Fit the density of points where covariates are known, as what is `given` of that of all rows.

    Conditional kernels, a neural mixture, the density of all rows and, on tori, a linear-circular
    regression and, beside numbers, a joint density are fitted without a tenth of the rows, for the
    tenths by which the density of all rows was chosen, and weighed by the conditional log densities of
    what is held out (stacking). If all of them gain nothing sure on the density of all rows, that is
    what is left.

    Args:
        pooled: The fit of the density of all rows.
        points: Points (N, d) of its space's chart.
        cells: The cells (N,) of each covariate.
        covariates: What these are.
        settings: Those of the densities that are fitted without tenths; flows are left out.
        weights: How much each row counts (N,).
        groups: A label (N,) a row: rows of one are held out together.
        progress: Hears the share of the work done.

    Returns:
        The fit's report, with that of what is given.

    Raises:
        OrbiflowError: For fewer than `LEAST_ROWS` rows, and cells of another number of rows.
    """
    say = progress or silent
    x = covariates.features(cells, len(points))
    task, without = _task(pooled, points, x, covariates.number, settings, weights, groups)
    say(0.0, "conditional kernels")
    kernels = fit_kernels(task.space, task.rows, task.x, task.number)
    fits = _fits(task, without, kernels, lambda share: say(0.1 + 0.4 * share, "neural mixtures"))
    table: list[Tensor] = []
    used = range(task.folds.used)
    for fold in used:
        say(0.5 + 0.4 * fold / len(used), f"held-out part {fold + 1} of {len(used)}")
        rest = task.folds.fold != fold
        table.append(torch.stack([task.logs(fit(rest, fold), fold) for fit in fits.values()]))
    logs, held = torch.cat(table, dim=1), torch.cat([task.held(fold) for fold in used])
    counts = None if task.rows.weights is None else task.rows.weights[held]
    shares = _sure_shares(logs, counts)
    say(0.9, "putting together")
    every = torch.ones_like(task.folds.fold, dtype=torch.bool)
    some = [(kind, w) for kind, w in zip(fits, listed(shares), strict=True) if w > 0]
    parts = [fits[kind](every, None) for kind, _ in some]
    density = ConditionalDensity(covariates, parts, [w for _, w in some])
    pooled.density.given = density
    both = stacked(logs, shares)
    untried: list[str] = []
    if settings.is_fast:
        joint = is_joint_possible(task.space, task.number)
        untried = [NeuralMixture.kind, *[JointDensity.kind] * joint]
    report = GivenReport(
        covariates.declaration,
        len(held),
        *gain_of(both, logs[0], counts),
        tuple(
            PartEvidence(kind, share, *gain_of(scores, logs[0], counts))
            for kind, share, scores in zip(fits, listed(shares), logs, strict=True)
        ),
        tuple(untried),
    )
    return replace(pooled.report, given=report)


def _fits(
    task: _Task,
    without: Callable[[int | None], Density],
    kernels: ConditionalKernels,
    tell: Callable[[float], None],
) -> dict[str, Fit]:
    """Return by its kind how each part is fitted to rows (N,) that lack a fold, or to all."""
    space = task.space

    def about(rest: Tensor, fold: int | None) -> ConditionalPart:
        return (
            kernels
            if fold is None
            else kernels.with_rows(task.rows.points[rest], task.rows[rest].weights, task.x[rest])
        )

    fits: dict[str, Fit] = {
        Unconditional.kind: lambda _, fold: Unconditional(without(fold)),
        ConditionalKernels.kind: about,
    }
    if not task.settings.is_fast:
        networks = _networks(task, tell)
        fits[NeuralMixture.kind] = lambda _, fold: (
            networks if fold is None else networks.alone(NETWORKS * fold, NETWORKS)
        )
    if isinstance(space, Torus):
        fits[CircularRegression.kind] = lambda rest, _: fit_regression(
            space, task.rows[rest], task.x[rest]
        )
        if not task.settings.is_fast and is_joint_possible(space, task.number):
            joint = _joint(task)
            fits[JointDensity.kind] = lambda _, fold: JointDensity(
                space, joint.density if fold is None else joint.without(fold), task.number
            )
    return fits


def _task(
    pooled: ChosenFit,
    points: Tensor,
    x: Tensor,
    number: Tensor,
    settings: DensitySettings,
    weights: Any,
    groups: ArrayLike | None,
) -> tuple[_Task, Callable[[int | None], Density]]:
    """Return rows in the folds of their density, and what that is without a fold, or whole."""
    space = pooled.density.space
    if len(points) < LEAST_ROWS:
        raise OrbiflowError(
            f"a density where covariates are known needs {LEAST_ROWS} rows or more, got {len(points)}"
        )
    how: dict[str, Any] = {"weights": weights, "groups": groups}
    if not settings.parametric:
        chosen = [name for name in settings.allowed if name != "flow"] or ["kernels", "mixture"]
        allowed: dict[str, Any] = {"components": tuple(chosen), "effort": settings.effort}
        joint = DensitySettings(**allowed, repeats=settings.repeats, seed=settings.seed)
        plain = pooled
        if settings.flow_alone:
            plain = _quietly(lambda: fit_in_folds(space, points, joint, **how))
        folds, outside = plain.folds, plain.without
        settings = joint
    else:
        _, weights, groups = alongside(points=points, **how)
        labels = None if groups is None else torch.as_tensor(group_numbers(groups, len(points)))
        generator = torch.Generator().manual_seed(settings.seed)
        how: dict[str, Any] = {"generator": generator, "fast": settings.is_fast}
        folds = folds_of(weighed(points, weights, labels), together=False, **how)

        def outside(fold: int) -> Density:
            rest = folds.train(fold)
            counts = None if rest.weights is None else rest.weights.numpy()
            return _quietly(
                lambda: fit_chosen(space, rest.points, settings, weights=counts)
            ).density

    assert folds is not None
    assert folds.rows.numbers is not None
    task = _Task(space, folds, x[folds.rows.numbers], number, settings)
    return task, lambda fold: pooled.density if fold is None else outside(fold)


def _quietly(fit: Callable[[], ChosenFit]) -> ChosenFit:
    """Return what a fit returns, without the warnings that the fit to all rows has given."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        return fit()


def _networks(task: _Task, tell: Callable[[float], None]) -> NeuralMixture:
    """Return neural mixtures without each fold and the next, by which their best step is chosen."""
    fold, count = task.folds.fold, int(task.folds.fold.max()) + 1
    used = [fold for fold in range(task.folds.used) for _ in range(NETWORKS)]
    apart = [(number + 1) % count for number in used]
    train = [
        torch.nonzero((fold != held) & (fold != apart_fold))[:, 0]
        for held, apart_fold in zip(used, apart, strict=True)
    ]
    stop = [task.where(apart_fold) for apart_fold in apart]
    return fit_networks(task.space, task.rows, task.x, train, stop, task.settings.seed, tell)


def _sure_shares(logs: Tensor, counts: Tensor | None) -> Tensor:
    """Return the shares (P,) of parts by their logs (P, n) at rows held out.

    They are those of the first alone, the density of all rows, unless others gain for sure.
    """
    first = torch.zeros(len(logs), dtype=torch.bool)
    first[0] = True
    shares = sparse_weights(logs, first, counts)
    if gain_of(stacked(logs, shares), logs[0], counts).is_sure:
        return shares
    return first.to(logs)


def _joint(task: _Task) -> ChosenFit:
    """Return the fit of the joint density of rows and their covariates, in the same folds.

    Integrals of chains over what is not a covariate take long where there are many angles, of networks
    they do not.
    """
    space = task.space
    assert isinstance(space, Torus)
    torus = joint_torus(space, int(task.number.max()) + 1)
    points = torch.cat([task.rows.points, covariate_turns(task.x, task.number)], dim=1)
    some = slice(MOST_JOINT_ROWS)
    folds = replace(task.folds, rows=task.rows[some], fold=task.folds.fold[some])
    without = "network" if torus.dim <= MOST_CHAINED else "chains"
    components = [name for name in task.settings.allowed if name != without]
    settings = task.settings.replace(components=tuple(components))
    fit = _quietly(lambda: fit_in_folds(torus, points[some], settings, folds=folds))
    evidence, folds = fit.evidence, fit.folds
    assert evidence is not None
    assert folds is not None
    evidence = for_conditionals(evidence, folds, space.dim)
    return replace(fit, density=evidence.assembled(), evidence=evidence)
