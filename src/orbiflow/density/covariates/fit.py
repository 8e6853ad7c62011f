"""Fitting p(data | covariates): held-out rows choose, by their conditional log densities."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.density.covariates.columns import Covariates
from orbiflow.density.covariates.density import ConditionalDensity, Unconditional
from orbiflow.density.covariates.joint import (
    JointDensity,
    covariate_turns,
    is_joint_possible,
    joint_torus,
)
from orbiflow.density.covariates.kernels import ConditionalKernels, fit_kernels
from orbiflow.density.covariates.network import NeuralMixture, fit_networks
from orbiflow.density.covariates.parts import Part
from orbiflow.density.covariates.regression import CircularRegression, fit_regression
from orbiflow.density.data import alongside, group_numbers
from orbiflow.density.fitting import (
    DensitySettings,
    Folds,
    Progress,
    Rows,
    fit_chosen,
    folds_of,
    gain_of,
    repeats_of,
    silent,
    sparse_weights,
    spread_evenly,
    stacked,
    weighed,
)
from orbiflow.density.models import Density
from orbiflow.density.spaces import Space, Torus
from orbiflow.errors import DataWarning, OrbiflowError, SettingError
from orbiflow.runtime import one_thread
from orbiflow.typed_torch import listed

LEAST_ROWS = 30
"""The fewest rows of which a tenth can be held out, and a tenth kept apart."""

USED = ((600, 5), (10**9, 3))
"""The number of tenths that are held out in turn, for up to so many rows."""

NETWORKS = 2
"""Networks for each tenth that is held out: the mean of several is better than each."""

MOST_CHAINED = 3
"""The most columns of joint densities with chains."""

MOST_JOINT_ROWS = 10_000
"""The most rows that a joint density is fitted to."""


@dataclass(frozen=True)
class PartEvidence:
    """What a part of a conditional density is worth at rows held out.

    - `kind`: "all" (the density of all rows), "kernels", "network", "regression" or "joint".
    - `share`: Its weight in the density.
    - `gain`, `error`: Mean nats by which it alone is better than the density of all rows, with the
      standard error.
    """

    kind: str
    share: float
    gain: float
    error: float


@dataclass(frozen=True)
class ConditionalReport:
    """How a conditional density was chosen.

    - `rows`: Rows that were held out.
    - `gain`, `error`: Mean nats by which they are likelier where the covariates are known than by the
      density of all rows, with the standard error.
    - `parts`: What it is made of, and what was tried.
    - `held`: The number of each row held out (n,) and its own gain (n,), for gains of some of them.
    """

    rows: int
    gain: float
    error: float
    parts: tuple[PartEvidence, ...]
    held: tuple[Tensor, Tensor]

    def to_json(self) -> dict[str, Any]:
        """Return the report without its rows, ready for JSON."""
        return {
            "rows": self.rows,
            "gain": self.gain,
            "error": self.error,
            "parts": [asdict(one) for one in self.parts],
        }

    def words(self) -> list[str]:
        """Return what a user should know."""
        found = [
            f"{self.rows} rows held out are {self.gain:.4f} ± {self.error:.4f} nats likelier where the "
            "covariates are known"
        ]
        for one in self.parts:
            alone = f"alone {one.gain:+.4f} ± {one.error:.4f} nats"
            share = f"{one.kind}: {one.share:.1%}"
            found.append(share if one.kind == Unconditional.kind else f"{share}, {alone}")
        if not self.gain:
            found.append(
                "the covariates say nothing about the data that is no accident of few rows"
            )
        return found


@dataclass(frozen=True)
class _Task:
    """Rows in random order, their features, and their folds.

    - `order`: The numbers (N,) that they had.
    - `number`: The number (m,) of the covariate of each feature.
    - `settings`: Those of densities of all rows but some.
    """

    space: Space
    folds: Folds
    x: Tensor
    order: Tensor
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
    def logs(self, part: Part, fold: int) -> Tensor:
        """Return what a part says of the rows by which it is judged."""
        own = self.held(fold)
        return part.log_prob(self.rows.points[own], self.x[own])

    def fitted(
        self, space: Space, points: Tensor, chosen: Tensor, settings: DensitySettings | None = None
    ) -> Density:
        """Return what suits some of the points (N, d), of all rows, in a space."""
        counts = None if self.rows.weights is None else self.rows.weights[chosen].numpy()
        labels = None if self.rows.groups is None else self.rows.groups[chosen].numpy()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DataWarning)  # the fit to all rows has said them
            how: dict[str, Any] = {"weights": counts, "groups": labels}
            return fit_chosen(space, points[chosen], settings or self.settings, **how)[0]


def check_complete(missing: str) -> None:
    """Refuse to fit rows that lack angles, of which no density is known where covariates are."""
    if missing != "refuse":
        raise SettingError(
            f"{{missing}} {missing} has no densities where covariates are known: leave out such rows"
        )


@one_thread()
def fit_conditional(
    pooled: Density,
    points: Tensor,
    x: Tensor,
    covariates: Covariates,
    settings: DensitySettings,
    *,
    weights: Any = None,
    groups: ArrayLike | None = None,
    progress: Progress | None = None,
) -> tuple[ConditionalDensity, ConditionalReport]:
    """Fit a density of points where the features of covariates are known.

    Conditional kernels, a neural mixture, the density of all rows and, on tori, a linear-circular
    regression and, beside numbers, a joint density are fitted without a tenth of the rows, for several
    tenths in turn, and weighed by the conditional log densities of what is held out (stacking). If all
    of them gain nothing sure on the density of all rows, that is what is left.

    Args:
        pooled: The density of all rows.
        points: Points (N, d) of its space's chart.
        x: Features (N, m) of the covariates.
        covariates: What these are.
        settings: Those of the densities that are fitted without tenths; flows are left out.
        weights: How much each row counts (N,).
        groups: A label (N,) a row: rows of one are held out together.
        progress: Hears the share of the work done.

    Raises:
        OrbiflowError: For fewer than `LEAST_ROWS` rows.
    """
    say = progress or silent
    task = _task(pooled.space, points, x, covariates.number, settings, weights, groups)
    say(0.0, "conditional kernels")
    kernels = fit_kernels(task.space, task.rows, task.x, task.number)
    networks = _networks(task, lambda share: say(0.1 + 0.4 * share, "neural mixtures"))
    fits = _fits(task, kernels, networks)
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
    done: dict[str, Part] = {
        Unconditional.kind: Unconditional(pooled), kernels.kind: kernels, networks.kind: networks
    }  # fmt: skip
    some = [(kind, w) for kind, w in zip(fits, listed(shares), strict=True) if w > 0]
    parts = [done.get(kind) or fits[kind](every, 0) for kind, _ in some]
    density = ConditionalDensity(covariates, parts, [w for _, w in some])
    return density, _report(list(fits), logs, shares, task.order[held], counts)


def _fits(
    task: _Task, kernels: ConditionalKernels, networks: NeuralMixture
) -> dict[str, Callable[[Tensor, int], Part]]:
    """Return by its kind how each part is fitted to some rows (N,), without a fold."""
    space = task.space
    found: dict[str, Callable[[Tensor, int], Part]] = {
        Unconditional.kind: lambda rest, _: Unconditional(
            task.fitted(space, task.rows.points, rest)
        ),
        ConditionalKernels.kind: lambda rest, _: kernels.with_rows(task.rows[rest], task.x[rest]),
        NeuralMixture.kind: lambda _, fold: networks.alone(NETWORKS * fold, NETWORKS),
    }
    if isinstance(space, Torus):
        found[CircularRegression.kind] = lambda rest, _: fit_regression(
            space, task.rows[rest], task.x[rest]
        )
    if is_joint_possible(space, task.number):
        found[JointDensity.kind] = lambda rest, _: _joint(task, rest)
    return found


def _task(
    space: Space,
    points: Tensor,
    x: Tensor,
    number: Tensor,
    settings: DensitySettings,
    weights: Any,
    groups: ArrayLike | None,
) -> _Task:
    if len(points) < LEAST_ROWS:
        raise OrbiflowError(
            f"a density where covariates are known needs {LEAST_ROWS} rows or more, got {len(points)}"
        )
    found = repeats_of(space, points)
    if found.taken_for(settings.repeats) == "rounding" and found.can_be_undone:
        noise = torch.Generator().manual_seed(settings.seed)
        points = spread_evenly(space, points, found, noise)
    weights, groups = alongside(weights=weights, groups=groups)
    labels = None if groups is None else torch.as_tensor(group_numbers(groups, len(points)))
    place = torch.arange(len(points), dtype=torch.float64)[:, None]
    rows = weighed(torch.cat([points, x, place], dim=1), weights, labels)
    generator = torch.Generator().manual_seed(settings.seed)
    folds = folds_of(rows, together=False, generator=generator)
    own, seen, order = folds.rows.points.split([points.shape[1], x.shape[1], 1], dim=1)
    most = next(count for rows, count in USED if len(points) <= rows)
    folds = replace(folds, rows=replace(folds.rows, points=own), used=min(folds.used, most))
    if not settings.parametric:
        chosen = [name for name in settings.allowed if name != "flow"] or ["kernels", "mixture"]
        how: dict[str, Any] = {"components": tuple(chosen), "repeats": settings.repeats}
        settings = DensitySettings(**how, seed=settings.seed)
    return _Task(space, folds, seen, order[:, 0].long(), number, settings)


def _networks(task: _Task, tell: Callable[[float], None]) -> NeuralMixture:
    """Return neural mixtures without each tenth and the next, by which their best step is chosen."""
    fold, count = task.folds.fold, int(task.folds.fold.max()) + 1
    used = [fold for fold in range(task.folds.used) for _ in range(NETWORKS)]
    apart = [(number + 1) % count for number in used]
    train = [
        torch.nonzero((fold != held) & (fold != kept))[:, 0]
        for held, kept in zip(used, apart, strict=True)
    ]
    stop = [task.where(kept) for kept in apart]
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


def _joint(task: _Task, chosen: Tensor) -> JointDensity:
    """Return the joint density of some rows (N,) and their covariates.

    Integrals of chains over what is not a covariate take long where there are many angles, of networks
    they do not.
    """
    space = task.space
    assert isinstance(space, Torus)
    torus = joint_torus(space, int(task.number.max()) + 1)
    points = torch.cat([task.rows.points, covariate_turns(task.x, task.number)], dim=1)
    some = torch.nonzero(chosen)[:MOST_JOINT_ROWS, 0]
    without = "network" if torus.dim <= MOST_CHAINED else "chains"
    components = [name for name in task.settings.allowed if name != without]
    settings = task.settings.replace(components=tuple(components))
    return JointDensity(space, task.fitted(torus, points, some, settings), task.number)


def _report(
    kinds: list[str], logs: Tensor, shares: Tensor, held: Tensor, counts: Tensor | None
) -> ConditionalReport:
    """Return what parts of these shares are worth, by logs (P, n) at rows held out."""
    parts = [
        PartEvidence(kind, share, *gain_of(own, logs[0], counts))
        for kind, share, own in zip(kinds, listed(shares), logs, strict=True)
    ]
    both = stacked(logs, shares)
    gain = gain_of(both, logs[0], counts)
    return ConditionalReport(len(held), *gain, tuple(parts), (held, both - logs[0]))
