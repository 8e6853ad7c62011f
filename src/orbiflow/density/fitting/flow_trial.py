"""Whether a flow belongs beside other components: how it is fitted, and what it has to beat."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import torch
from torch import Tensor

from orbiflow.density.fitting.evidence import Candidates
from orbiflow.density.fitting.flow import Outdone, fit_density
from orbiflow.density.fitting.held_out import Folds, stacked, stacking_weights
from orbiflow.density.fitting.report import ComponentEvidence, FitReport
from orbiflow.density.fitting.rows import Gain, Rows, gain_of, mean_of
from orbiflow.density.fitting.settings import FlowSettings
from orbiflow.density.inference import at_observed
from orbiflow.density.models import MOST_DIM, Density, FlowDensity
from orbiflow.density.spaces import Space
from orbiflow.fields import has_even_grid
from orbiflow.runtime import Tell

FEW_ROWS, MANY_ROWS = 5_000, 20_000
"""With fewer a flow is fitted in one stage; from the latter on it may be finer."""

LIKELY_ERRORS = 1.5
"""Standard errors that a flow must gain over two tenths where one tenth is not sure of it."""


FIRST_TENTH_SHARE = 2 / 3
"""Of the work told, for the first tenth: there is seldom a second."""


class TriedFlow(NamedTuple):
    """A flow, its share and what came of it; without a share there is none."""

    flow: Density | None = None
    share: float = 0.0
    evidence: tuple[ComponentEvidence, ...] = ()
    report: FitReport | None = None


FittedFlow = tuple[Density, FitReport]


def flow_beside(
    space: Space,
    folds: Folds,
    number: int,
    chosen: FlowSettings,
    outdone: Outdone | None,
    say: Tell,
) -> FittedFlow:
    """Fit a flow without a tenth."""
    train = folds.train(number)
    begin, end = ((0.0, FIRST_TENTH_SHARE), (FIRST_TENTH_SHARE, 1.0))[number]
    return fit_density(
        space,
        train.points,
        chosen,
        weights=train.weights,
        progress=lambda done, what: say(begin + (end - begin) * done, f"flow: {what}"),
        outdone=outdone,
    )


def outdone_by(others: Tensor, uniform: Tensor, held: Rows) -> Outdone:
    """Return what says whether a flow can be given up beside candidates.

    It gains nothing beside them, and is more than so many nats below them. They have together the log
    densities `others` (N,), and the uniform one `uniform`, at `held` rows.
    """

    def outdone(flow: FlowDensity, hope: float) -> bool:
        logs = at_observed(flow.with_steps(2 * flow.flow.steps), held.points)
        worth = _worth([torch.stack([others, logs, uniform])], [held])
        assert worth.others is not None
        return not _is_worth_it(worth) and worth.others - worth.alone > hope

    return outdone


def try_flow(
    folds: Folds, candidates: Candidates, weights: Tensor, fitted: Callable[[int], FittedFlow]
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
            logs = density.log_prob(rows.points)
        tables.append(torch.stack([stacked(columns, weights), logs, columns[-1]]))
        held.append(rows)
        return _worth(tables, held)

    density, report = fitted(0)
    worth = worth_of(density, 0)
    kept = _is_worth_it(worth)
    sure = Gain(worth.gain, worth.error).is_sure
    if kept and not sure and folds.used > 1:
        worth = worth_of(fitted(1)[0], 1)
        kept = _is_worth_it(worth) and worth.gain >= LIKELY_ERRORS * worth.error
    if not kept:
        worth = replace(worth, share=0.0, gain=0.0, error=0.0)
    return TriedFlow(density if kept else None, worth.share, (worth,), report)


def _worth(tables: list[Tensor], held: list[Rows]) -> ComponentEvidence:
    """Judge a flow by log densities (3, N) at rows held out: the others', its own, the uniform one."""
    others, logs, uniform = torch.cat(tables, dim=1)
    counts = [rows.weights for rows in held if rows.weights is not None]
    row_weights = torch.cat(counts) if counts else None
    table = torch.stack([others, logs])
    both = stacking_weights(table, row_weights)
    gain = gain_of(stacked(table, both), others, row_weights)
    return ComponentEvidence(
        "flow",
        float(both[1]),
        mean_of(logs - uniform, row_weights),
        gain.nats,
        gain.error,
        len(logs),
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
