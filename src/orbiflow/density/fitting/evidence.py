"""What held-out rows say of families of densities and of a flow, and the mixture that they choose.

The weights of densities by what they give to rows that were held out: stacking.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import count
from typing import NamedTuple

import torch
from torch import Tensor

from orbiflow.density.fitting.families import Family
from orbiflow.density.fitting.flow import fit_density
from orbiflow.density.fitting.folds import Folds
from orbiflow.density.fitting.likelihood import Budget
from orbiflow.density.fitting.report import ComponentEvidence, FitReport, Progress
from orbiflow.density.fitting.rows import Gain, Rows, gain_of, mean_of
from orbiflow.density.fitting.settings import FlowSettings
from orbiflow.density.inference import at_observed
from orbiflow.density.models import MOST_DIM, Density, Mixture, UniformDensity, mixture_of
from orbiflow.density.spaces import Space
from orbiflow.fields import has_even_grid
from orbiflow.runtime import SideBySide, Tell
from orbiflow.typed_torch import listed

STEP = 0.85
"""The share of a fold's work that is left after each thing that is tried."""

FLOOR = "uniform"
"""The name of the component that is always there."""


@dataclass(frozen=True)
class Candidates:
    """Log densities of all candidates at all rows that were held out.

    - `keys`: family and name of each row of `table` (P, N); the last is the uniform floor.
    - `fitted`: of each family, what was fitted to each fold.
    - `row_weights`: of the rows (N,), None where all weigh the same.
    """

    keys: list[tuple[str, str]]
    table: Tensor
    fitted: dict[str, list[dict[str, Density]]]
    row_weights: Tensor | None = None

    @property
    def floor(self) -> Tensor:
        """A mask (P,) of the candidate that is the floor."""
        return torch.tensor([family == FLOOR for family, _ in self.keys])

    def of(self, *families: str) -> Tensor:
        """Return a mask (P,) of the floor and the candidates of these families."""
        return torch.tensor([family in (FLOOR, *families) for family, _ in self.keys])

    def mixed(self, chosen: Tensor) -> Tensor:
        """Return the best weights (P,) of those of a mask (P,)."""
        weights = torch.zeros(len(self.table), dtype=self.table.dtype)
        table, floor = self.table[chosen], self.floor[chosen]
        weights[chosen] = sparse_weights(table, floor, self.row_weights)
        return weights


class Course:
    """How much is done of several things, each of which has a weight among a `total`."""

    def __init__(self, say: Progress, total: float) -> None:
        self._say, self._total = say, total
        self._done: list[float] = []

    def part(self, weight: float) -> Progress:
        """Return what is told the share that is done of one more thing, and what is being done."""
        number = len(self._done)
        self._done.append(0.0)

        def tell(share: float, what: str) -> None:
            self._done[number] = weight * share
            self._say(sum(self._done) / self._total, what)

        return tell


class Fitted(NamedTuple):
    """What a family fitted to a fold, and the log densities of the rows held out, by name."""

    parts: dict[str, Density]
    logs: dict[str, Tensor]


FIRST_FOLD = 2.0
"""Work of a family in the first fold, which tries more, in that of another fold."""


def work_of(families: int, used: int) -> float:
    """Return the weight of all fits of families to the folds in a `Course`."""
    return families * (FIRST_FOLD + used - 1)


def candidates_of(
    space: Space,
    families: list[Family],
    folds: Folds,
    course: Course,
    budget: Budget,
    beside: SideBySide,
) -> Candidates:
    """Fit all families to all folds; after the first, only what may be of use.

    The families are fitted side by side; so are all folds after the first.
    """

    def begun(number: int) -> list[Callable[[], Fitted | None]]:
        return [
            beside.begin(
                partial(_fitted, family, folds, number, budget),
                course.part(1.0 if number else FIRST_FOLD),
            )
            for family in reversed(families)  # the longest first
        ][::-1]

    waiting = [begun(0)]
    blocks: list[dict[tuple[str, str], Tensor]] = []
    fitted: dict[str, list[dict[str, Density]]] = {family.name: [] for family in families}
    weights: list[Tensor | None] = []
    for number in range(folds.used):
        found = [result() for result in waiting[number]]
        whole = [one for one in found if one is not None]
        if len(whole) < len(families):
            break
        held = folds.held(number)
        block: dict[tuple[str, str], Tensor] = {}
        for family, (parts, logs) in zip(families, whole, strict=True):
            fitted[family.name].append(parts)
            block |= {(family.name, name): values for name, values in logs.items()}
        block[FLOOR, FLOOR] = at_observed(UniformDensity(space), held.points)
        blocks.append(block)
        weights.append(held.weights)
        if number == 0:
            _narrow(families, block, held)
            waiting += map(begun, range(1, folds.used))
    keys = [key for key in blocks[-1] if all(key in block for block in blocks)]
    table = torch.cat([torch.stack([block[key] for key in keys]) for block in blocks], dim=1)
    known = [own for own in weights if own is not None]
    return Candidates(keys, table, fitted, torch.cat(known) if known else None)


def _fitted(family: Family, folds: Folds, number: int, budget: Budget, say: Tell) -> Fitted | None:
    """Fit a family to a fold; None if the time is over before one after the first begins."""
    if number and budget.is_spent:
        return None
    tried = count()

    def tell(what: str, share: float | None = None) -> None:
        # how much there is to try is not known beforehand
        done = 1 - STEP ** next(tried) if share is None else share
        say(done, f"held-out part {number + 1} of {folds.used}: {what}")

    held = folds.held(number)
    parts = family.fitted(number, folds.train(number), held, tell)
    tell(family.name, 1.0)
    return Fitted(parts, {name: at_observed(part, held.points) for name, part in parts.items()})


def _narrow(families: list[Family], block: dict[tuple[str, str], Tensor], held: Rows) -> None:
    """Keep of each family what has most weight in the first fold, or may have, and the best alone."""
    keys = list(block)
    table = torch.stack([block[key] for key in keys])
    weights: list[float] = listed(stacking_weights(table, held.weights))
    for family in families:
        own = {name: w for (f, name), w in zip(keys, weights, strict=True) if f == family.name}
        if own:
            best = max(own, key=lambda name, f=family.name: held.mean(block[f, name]))
            some = [name for name, w in own.items() if w >= family.negligible]
            if family.kept is not None:
                some = sorted(some, key=lambda name, w=own: -w[name])[: family.kept]
            family.keep({best, *some})


def without_idle(candidates: Candidates, weights: Tensor) -> Tensor:
    """Return the weights (P,) without families that gain nothing on held-out rows."""
    while True:
        live = (weights > 0) | candidates.floor
        idle = [p for p in judged(candidates, weights, live) if p.share and p.gain <= 0]
        if not idle:
            return weights
        worst = min(idle, key=lambda part: part.gain).name
        weights = candidates.mixed(live & (~candidates.of(worst) | candidates.floor))


def judged(
    candidates: Candidates, weights: Tensor, among: Tensor | None = None
) -> list[ComponentEvidence]:
    """Return what each family contributes to the mixture of these weights (P,).

    It is compared with the best mixture of all others, or of those `among` (P,) the candidates.
    """
    table, own_weights = candidates.table, candidates.row_weights
    whole, uniform = stacked(table, weights), table[-1]
    found: list[ComponentEvidence] = []
    names = dict.fromkeys(family for family, _ in candidates.keys if family != FLOOR)
    for name in names:
        own = candidates.of(name)
        alone = stacked(table, candidates.mixed(own))
        share = float(weights[own & ~candidates.floor].sum())
        gain = Gain(0.0, 0.0)
        if share:
            others = ~own if among is None else among & ~own
            without = stacked(table, candidates.mixed(others | candidates.floor))
            gain = gain_of(whole, without, own_weights)
        above = mean_of(alone - uniform, own_weights)
        found.append(ComponentEvidence(name, share, above, gain.nats, gain.error, table.shape[1]))
    return found


def assembled(
    space: Space,
    families: list[Family],
    candidates: Candidates,
    weights: Tensor,
    rows: Rows,
    flow: Density | None,
    share: float,
) -> Mixture:
    """Return the candidates in proportions (P,), made final with all rows, beside a flow's share."""
    found: list[tuple[float, Density]] = []
    for family in families:
        chosen = [
            (name, float(weight))
            for (own, name), weight in zip(candidates.keys, weights, strict=True)
            if own == family.name and weight > 0
        ]
        final = family.final(rows, candidates.fitted[family.name], [name for name, _ in chosen])
        found += [(weight, part) for (_, weight), part in zip(chosen, final, strict=True)]
    floor = float(weights[candidates.floor].sum())
    # the order of components is that in which samples are drawn: kernels before the floor
    found.sort(key=lambda part: part[1].kernel_part is None)
    kernels = sum(part.kernel_part is not None for _, part in found)
    found.insert(kernels, (floor, UniformDensity(space)))
    total = sum(weight for weight, _ in found)
    others = [((1 - share) * weight / total, part) for weight, part in found]
    return mixture_of(others if flow is None else [(share, flow), *others])


FEW_ROWS, MANY_ROWS = 5_000, 20_000
"""With fewer a flow is fitted in one stage; from the latter on it may be finer."""

LIKELY = 1.5
"""Standard errors that a flow must gain over two tenths where one tenth is not sure of it."""


FIRST = 2 / 3
"""Of the work told, for the first tenth: there is seldom a second."""


class TriedFlow(NamedTuple):
    """A flow, its share and what came of it; without a share there is none."""

    flow: Density | None = None
    share: float = 0.0
    evidence: tuple[ComponentEvidence, ...] = ()
    report: FitReport | None = None


FittedFlow = tuple[Density, FitReport]


def flow_beside(
    space: Space, folds: Folds, number: int, chosen: FlowSettings, budget: Budget, say: Tell
) -> FittedFlow | None:
    """Fit a flow without a tenth; None if the time is over before it begins."""
    if budget.is_spent:
        return None
    train = folds.train(number)
    begin, end = ((0.0, FIRST), (FIRST, 1.0))[number]
    return fit_density(
        space,
        train.points,
        chosen.replace(seconds=budget.seconds_left),
        weights=train.weights,
        progress=lambda done, what: say(begin + (end - begin) * done, f"flow: {what}"),
    )


def try_flow(
    folds: Folds,
    candidates: Candidates,
    weights: Tensor,
    fitted: Callable[[int], FittedFlow | None],
) -> TriedFlow:
    """A flow fitted without the first tenth, and the share that this tenth gives it.

    Where that tenth is for it, but not surely, a flow fitted without the second is asked, too: what few
    rows speak for has streaks that are not in the data. The candidates beside it have `weights` (P,).
    """

    tables: list[Tensor] = []
    held: list[Rows] = []

    def worth_of(density: Density, number: int) -> ComponentEvidence:
        rows, start = folds.held(number), sum(map(len, held))
        columns = candidates.table[:, start : start + len(rows)]
        with torch.no_grad():
            own = density.log_prob(rows.points)
        tables.append(torch.stack([stacked(columns, weights), own, columns[-1]]))
        held.append(rows)
        return _worth(tables, held)

    if (first := fitted(0)) is None:
        return TriedFlow()
    density, report = first
    worth = worth_of(density, 0)
    kept = _is_worth_it(worth)
    sure = Gain(worth.gain, worth.error).is_sure
    if kept and not sure and folds.used > 1 and (second := fitted(1)) is not None:
        worth = worth_of(second[0], 1)
        kept = _is_worth_it(worth) and worth.gain >= LIKELY * worth.error
    if not kept:
        worth = replace(worth, share=0.0, gain=0.0, error=0.0)
    return TriedFlow(density if kept else None, worth.share, (worth,), report)


def _worth(tables: list[Tensor], held: list[Rows]) -> ComponentEvidence:
    """Judge a flow by log densities (3, N) at rows held out: the others', its own, the uniform one."""
    others, own, uniform = torch.cat(tables, dim=1)
    known = [rows.weights for rows in held if rows.weights is not None]
    row_weights = torch.cat(known) if known else None
    table = torch.stack([others, own])
    both = stacking_weights(table, row_weights)
    gain = gain_of(stacked(table, both), others, row_weights)
    return ComponentEvidence(
        "flow",
        float(both[1]),
        mean_of(own - uniform, row_weights),
        gain.nats,
        gain.error,
        len(own),
        mean_of(others - uniform, row_weights),
    )


def _is_worth_it(worth: ComponentEvidence) -> bool:
    # a weight chosen on these rows gains one nat among all of them by chance
    return worth.gain * worth.rows >= 1


def flow_settings(space: Space, rows: int, seed: int) -> FlowSettings:
    """Of a flow beside other parts: those have the clusters, it has what is smooth."""
    if space.dim == MOST_DIM and not has_even_grid(space.group):
        # each point costs a sum over all waves: as many as of splines would take minutes
        return FlowSettings(
            max_frequency=2, segments=2, roughness=(1e-3,), iterations=30, seed=seed
        )
    if space.dim == MOST_DIM:
        return FlowSettings(
            max_frequency=5, segments=3, roughness=(1e-3,), iterations=60, seed=seed
        )
    if rows >= MANY_ROWS:
        return FlowSettings(roughness=(1e-3, 1e-4), seed=seed)
    if rows >= FEW_ROWS:
        return FlowSettings(
            max_frequency=6, segments=4, roughness=(1e-3, 1e-4), iterations=60, seed=seed
        )
    return FlowSettings(max_frequency=6, segments=4, roughness=(1e-3,), iterations=40, seed=seed)


TOLERANCE = 1e-4
"""Nats by which the weights may be worse than the best ones."""

ITERATIONS, EVERY = 3_000, 25
"""Maximum iterations of EM, and iterations between checks of convergence."""

NEGLIGIBLE = 3e-3
"""Weights below this are dropped."""


def stacked(table: Tensor, weights: Tensor) -> Tensor:
    """Return log densities (N,) of the mixture in proportions (P,), from a table (P, N)."""
    return (table + weights.log()[:, None]).logsumexp(dim=0)


def stacking_weights(table: Tensor, row_weights: Tensor | None = None) -> Tensor:
    """Return proportions (P,) with the greatest mean log density of held-out rows, from a table (P, N).

    The problem is concave; EM finds its only optimum (Smyth and Wolpert, Linearly combining density
    estimators via stacking, 1999). The largest mean ratio of a density to the mixture, less 1, bounds
    what is missing. Rows may be weighted (N,).

    >>> table = torch.tensor([[0.0, 0.0], [-1.0, -1.0]])
    >>> stacking_weights(table).round(decimals=2)
    tensor([1., 0.])
    """
    relative = (table - table.amax(dim=0)).exp()
    weights = torch.full_like(table[:, 0], 1 / len(table))
    own = torch.ones_like(table[0]) if row_weights is None else row_weights.to(table)
    shares = own / own.sum()
    for iteration in range(ITERATIONS):
        ratio = relative @ (shares / (weights @ relative))
        if iteration % EVERY == 0 and float(ratio.max()) - 1 < TOLERANCE:
            break
        weights = weights * ratio
        weights = weights / weights.sum()
    return weights


def supported_weights(table: Tensor, always: Tensor, row_weights: Tensor | None = None) -> Tensor:
    """Return weights as `sparse_weights` does, without spikes that only a few rows support.

    Two rows that happen to be close give kernels as narrow as that a weight of about two rows, and
    pictures a spike at every row. So what is worse by itself than what is `always` there must gain
    more than chance.
    """
    weights = sparse_weights(table, always, row_weights)
    means = torch.tensor([mean_of(row, row_weights) for row in table])
    spikes = ~always & (means < means[always].max())
    if not bool((weights[spikes] > 0).any()):
        return weights
    rest = ~spikes
    others = torch.zeros_like(weights)
    others[rest] = sparse_weights(table[rest], always[rest], row_weights)
    gain = gain_of(stacked(table, weights), stacked(table[rest], others[rest]), row_weights)
    return weights if gain.is_sure else others


def sparse_weights(table: Tensor, always: Tensor, row_weights: Tensor | None = None) -> Tensor:
    """Return weights as `stacking_weights` does, without `NEGLIGIBLE` ones; `always` (P,) has some.

    The least weight of what must be there is half a row's: nothing is impossible that as many rows
    could not rule out.
    """
    weights = stacking_weights(table, row_weights)
    kept = (weights >= NEGLIGIBLE) | always
    found = torch.zeros_like(weights)
    found[kept] = stacking_weights(table[kept], row_weights)
    least = 0.5 / (table.shape[1] + 1)
    found[always] = found[always].clamp_min(least)
    return found / found.sum()
