"""Whether a flow belongs beside the other parts of a density: asked of rows held out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import torch
from torch import Tensor

from orbiflow.density.fitting.budget import Budget
from orbiflow.density.fitting.evidence import Candidates
from orbiflow.density.fitting.flow import fit_density
from orbiflow.density.fitting.folds import Folds
from orbiflow.density.fitting.report import ComponentEvidence, FitReport
from orbiflow.density.fitting.rows import Rows, mean_of
from orbiflow.density.fitting.settings import FlowSettings
from orbiflow.density.fitting.weights import Gain, gain_of, stacked, stacking_weights
from orbiflow.density.models import MOST_DIM, Density
from orbiflow.density.spaces import Space

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


def try_flow(
    space: Space,
    folds: Folds,
    candidates: Candidates,
    weights: Tensor,
    chosen: FlowSettings,
    budget: Budget,
    told: Callable[[float, str], None],
) -> TriedFlow:
    """A flow fitted without the first tenth, and the share that this tenth gives it.

    Where that tenth is for it, but not surely, a flow fitted without the second is asked, too: what few
    rows speak for has streaks that are not in the data.

    Args:
        weights: (P,) of the candidates that it is to be beside.
    """

    def fitted(number: int) -> tuple[Density, FitReport]:
        train = folds.train(number)
        begin, end = ((0.0, FIRST), (FIRST, 1.0))[number]
        return fit_density(
            space,
            train.points,
            chosen.replace(seconds=budget.seconds_left),
            weights=train.weights,
            progress=lambda done, what: told(begin + (end - begin) * done, f"flow: {what}"),
        )

    density, report = fitted(0)
    held = [folds.held(0)]
    tables = [_beside(density, held[0], candidates.table[:, : len(held[0])], weights)]
    worth = _worth(tables, held)
    kept = _is_worth_it(worth)
    sure = Gain(worth.gain, worth.error).is_sure
    if kept and not sure and folds.used > 1 and not budget.is_spent:
        held.append(folds.held(1))
        columns = candidates.table[:, len(held[0]) : len(held[0]) + len(held[1])]
        tables.append(_beside(fitted(1)[0], held[1], columns, weights))
        worth = _worth(tables, held)
        kept = _is_worth_it(worth) and worth.gain >= LIKELY * worth.error
    if not kept:
        worth = replace(worth, share=0.0, gain=0.0, error=0.0)
    return TriedFlow(density if kept else None, worth.share, (worth,), report)


def _beside(density: Density, held: Rows, columns: Tensor, weights: Tensor) -> Tensor:
    """Log densities (3, N) at rows held out: of the other parts, the flow, and the uniform one."""
    with torch.no_grad():
        own = density.log_prob(held.points)
    return torch.stack([stacked(columns, weights), own, columns[-1]])


def _worth(tables: list[Tensor], held: list[Rows]) -> ComponentEvidence:
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
