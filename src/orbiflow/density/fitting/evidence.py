"""What held-out rows say of families of densities, and the mixture that they choose."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from typing import Any

import torch
from torch import Tensor

from orbiflow.density.fitting.budget import Budget
from orbiflow.density.fitting.families import Family
from orbiflow.density.fitting.folds import Folds
from orbiflow.density.fitting.report import ComponentEvidence, Progress
from orbiflow.density.fitting.rows import Rows, log_prob_of_rows, mean_of
from orbiflow.density.fitting.weights import (
    NEGLIGIBLE,
    Gain,
    gain_of,
    sparse_weights,
    stacked,
    stacking_weights,
)
from orbiflow.density.models import Density, Mixture, UniformDensity, mixture_of
from orbiflow.density.spaces import Space
from orbiflow.typed_torch import listed

KEPT = 2
"""Sizes of a family that are fitted to all folds, besides the best alone."""

STEP = 0.85
"""The share of a fold's work that is left after each thing that is tried."""

FLOOR = "uniform"
"""The name of the component that is always there."""


@dataclass(frozen=True)
class Candidates:
    """Log densities of all candidates at all rows that were held out.

    - `families`, `names`: of each row of `table` (P, N); the last is the uniform floor.
    - `fitted`: of each family, what was fitted to each fold.
    - `row_weights`: of the rows (N,), None where all weigh the same.
    """

    families: list[str]
    names: list[str]
    table: Tensor
    fitted: dict[str, list[dict[str, Density]]]
    row_weights: Tensor | None = None

    @property
    def floor(self) -> Tensor:
        """A mask (P,) of the candidate that is the floor."""
        return torch.tensor([family == FLOOR for family in self.families])

    def of(self, *families: str) -> Tensor:
        """Return a mask (P,) of the floor and the candidates of these families."""
        return torch.tensor([family in (FLOOR, *families) for family in self.families])


def candidates_of(
    space: Space, families: list[Family[Any]], folds: Folds, say: Progress, budget: Budget
) -> Candidates:
    """Fit all families to all folds; after the first, only what may be of use."""
    blocks: list[dict[tuple[str, str], Tensor]] = []
    weights: list[Tensor | None] = []
    fitted: dict[str, list[dict[str, Density]]] = {family.name: [] for family in families}
    for number, (train, held) in enumerate(folds):
        if number and budget.is_spent:
            break

        tell = _teller(number, folds.used, say)

        block: dict[tuple[str, str], Tensor] = {}
        for family in families:
            found = family.fitted(number, train, held, tell)
            fitted[family.name].append(found)
            with torch.no_grad():
                for name, part in found.items():
                    block[family.name, name] = log_prob_of_rows(part, held.points)
        block[FLOOR, FLOOR] = log_prob_of_rows(UniformDensity(space), held.points)
        blocks.append(block)
        weights.append(held.weights)
        if number == 0:
            _narrow(families, block, held)
    keys = [key for key in blocks[-1] if all(key in block for block in blocks)]
    table = torch.cat([torch.stack([block[key] for key in keys]) for block in blocks], dim=1)
    return Candidates(
        [family for family, _ in keys],
        [name for _, name in keys],
        table,
        fitted,
        None if weights[0] is None else torch.cat([own for own in weights if own is not None]),
    )


def _teller(number: int, used: int, say: Progress) -> Callable[[str], None]:
    """Return what tells the progress in a fold, whose amount of work is not known beforehand."""
    begin, size = (number + 1, 1) if number else (0, 2)  # the first fold tries more
    tried = count()

    def tell(what: str) -> None:
        share = 1 - STEP ** next(tried)
        say((begin + share * size) / (used + 1), f"held-out part {number + 1} of {used}: {what}")

    return tell


def _narrow(families: list[Family[Any]], block: dict[tuple[str, str], Tensor], held: Rows) -> None:
    """Keep of each family what has most weight in the first fold, and the best alone."""
    keys = list(block)
    table = torch.stack([block[key] for key in keys])
    weights: list[float] = listed(stacking_weights(table, held.weights))
    for family in families:
        own = {name: w for (f, name), w in zip(keys, weights, strict=True) if f == family.name}
        if own:
            best = max(own, key=lambda name, f=family.name: held.mean(block[f, name]))
            weighty = [name for name, w in own.items() if w >= NEGLIGIBLE]
            family.keep({best, *sorted(weighty, key=lambda name, w=own: -w[name])[:KEPT]})


def without_idle(candidates: Candidates, weights: Tensor) -> Tensor:
    """Return the weights (P,) without families that gain nothing on held-out rows."""
    while True:
        idle = [part for part in judged(candidates, weights) if part.share and part.gain <= 0]
        if not idle:
            return weights
        worst = min(idle, key=lambda part: part.gain).name
        rest = torch.tensor([family != worst for family in candidates.families]) & (
            (weights > 0) | candidates.floor
        )
        weights = torch.zeros_like(weights)
        weights[rest] = sparse_weights(
            candidates.table[rest], candidates.floor[rest], candidates.row_weights
        )


def judged(candidates: Candidates, weights: Tensor) -> list[ComponentEvidence]:
    """Return what each family contributes to the mixture of these weights (P,)."""
    table, own_weights = candidates.table, candidates.row_weights
    whole, uniform = stacked(table, weights), table[-1]
    found: list[ComponentEvidence] = []
    names = [name for name in dict.fromkeys(candidates.families) if name != FLOOR]
    for name in names:
        own = candidates.of(name)
        alone = stacked(table[own], sparse_weights(table[own], candidates.floor[own], own_weights))
        share = float(weights[own & ~candidates.floor].sum())
        gain = Gain(0.0, 0.0)
        if share:
            rest = ~own | candidates.floor
            others = sparse_weights(table[rest], candidates.floor[rest], own_weights)
            without = stacked(table[rest], others)
            gain = gain_of(whole, without, own_weights)
        above = mean_of(alone - uniform, own_weights)
        found.append(ComponentEvidence(name, share, above, gain.nats, gain.error, table.shape[1]))
    return found


def assembled(
    space: Space,
    families: list[Family[Any]],
    candidates: Candidates,
    weights: Tensor,
    rows: Rows,
    flow: Density | None,
    share: float,
) -> Mixture:
    """Return the candidates in proportions (P,), made final with all rows, beside a flow.

    Args:
        space: The space of all.
        families: The families that the candidates belong to.
        candidates: The candidates.
        weights: Their proportions.
        rows: All rows.
        flow: A flow's density; None for none.
        share: The weight of the flow.
    """
    found: list[tuple[float, Density]] = []
    for family in families:
        chosen = [
            (name, float(weight))
            for own, name, weight in zip(
                candidates.families, candidates.names, weights, strict=True
            )
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
