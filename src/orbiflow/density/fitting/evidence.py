"""What held-out rows say of families of densities and of a flow, and the mixture that they choose."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from typing import NamedTuple

import torch
from torch import Tensor

from orbiflow.density.fitting.families import Family
from orbiflow.density.fitting.held_out import Folds, sparse_weights, stacked, stacking_weights
from orbiflow.density.fitting.report import ComponentEvidence, Progress
from orbiflow.density.fitting.rows import Gain, Rows, gain_of, mean_of
from orbiflow.density.inference import at_observed
from orbiflow.density.models import Density, Mixture, UniformDensity, mixture_of
from orbiflow.density.spaces import Space
from orbiflow.runtime import SideBySide, Tell
from orbiflow.typed_torch import listed

SHARE_LEFT_PER_TRY = 0.85
"""The share of a fold's work that is left after each thing that is tried."""

FLOOR = "uniform"
"""The name of the component that is always there."""


@dataclass(frozen=True)
class Candidates:
    """Log densities of all candidates at all rows that were held out.

    - `keys`: family and name of each row of `table` (P, N); the last is the uniform floor.
    - `fitted`: of each family, what was fitted to each fold.
    - `sizes`: how many of the rows are of each fold, one after the other.
    - `row_weights`: of the rows (N,), None where all weigh the same.
    """

    keys: list[tuple[str, str]]
    table: Tensor
    fitted: dict[str, list[dict[str, Density]]]
    sizes: tuple[int, ...] = ()
    row_weights: Tensor | None = None
    _best: dict[tuple[bool, ...], Tensor] = field(default_factory=dict[tuple[bool, ...], Tensor])

    @property
    def fold(self) -> Tensor:
        """The fold (N,) of each row."""
        return torch.arange(len(self.sizes)).repeat_interleave(torch.tensor(self.sizes))

    @property
    def floor(self) -> Tensor:
        """A mask (P,) of the candidate that is the floor."""
        return torch.tensor([family == FLOOR for family, _ in self.keys])

    def of(self, *families: str) -> Tensor:
        """Return a mask (P,) of the floor and the candidates of these families."""
        return torch.tensor([family in (FLOOR, *families) for family, _ in self.keys])

    def mixed(self, chosen: Tensor) -> Tensor:
        """Return the best weights (P,) of those of a mask (P,); asked again, they are known."""
        key = tuple(listed(chosen))
        if key not in self._best:
            weights = torch.zeros(len(self.table), dtype=self.table.dtype)
            table, floor = self.table[chosen], self.floor[chosen]
            weights[chosen] = sparse_weights(table, floor, self.row_weights)
            self._best[key] = weights
        return self._best[key]


class Course:
    """How much is done of several things, each of which has a weight among a `total`."""

    def __init__(self, say: Progress, total: float) -> None:
        self._say, self._total = say, total
        self._done: list[float] = []

    def part(self, weight: float) -> Progress:
        """Return a function to call with the share that is done of one more thing, and what it is."""
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


FIRST_FOLD_WORK = 2.0
"""Work of a family in the first fold, which tries more, in that of another fold."""


def work_of(families: int, used: int) -> float:
    """Return the weight of all fits of families to the folds in a `Course`."""
    return families * (FIRST_FOLD_WORK + used - 1)


def candidates_of(
    space: Space,
    families: list[Family],
    folds: Folds,
    course: Course,
    beside: SideBySide,
    meet: Callable[[Tensor, Tensor, Rows], None],
) -> Candidates:
    """Fit all families to all folds; after the first, only what may be of use.

    The families are fitted side by side; so are all folds after the first. `meet` is told the log
    densities (N,) of all candidates together and the uniform one, at the first rows held out, before
    the other folds begin.
    """

    def begun(number: int) -> list[Callable[[], Fitted]]:
        return [
            beside.begin(
                partial(_fitted, family, folds, number),
                course.part(1.0 if number else FIRST_FOLD_WORK),
            )
            for family in reversed(families)  # the longest first
        ][::-1]

    waiting = [begun(0)]
    blocks: list[dict[tuple[str, str], Tensor]] = []
    fitted: dict[str, list[dict[str, Density]]] = {family.name: [] for family in families}
    weights: list[Tensor | None] = []
    for number in range(folds.used):
        whole = [result() for result in waiting[number]]
        held = folds.held(number)
        block: dict[tuple[str, str], Tensor] = {}
        for family, (parts, logs) in zip(families, whole, strict=True):
            fitted[family.name].append(parts)
            block |= {(family.name, name): values for name, values in logs.items()}
        block[FLOOR, FLOOR] = at_observed(UniformDensity(space), held.points)
        blocks.append(block)
        weights.append(held.weights)
        if number == 0:
            meet(_narrow(families, block, held), block[FLOOR, FLOOR], held)
            waiting += map(begun, range(1, folds.used))
    keys = [key for key in blocks[-1] if all(key in block for block in blocks)]
    table = torch.cat([torch.stack([block[key] for key in keys]) for block in blocks], dim=1)
    counts = [count_of_rows for count_of_rows in weights if count_of_rows is not None]
    sizes = tuple(len(block[FLOOR, FLOOR]) for block in blocks)
    return Candidates(keys, table, fitted, sizes, torch.cat(counts) if counts else None)


def _fitted(family: Family, folds: Folds, number: int, say: Tell) -> Fitted:
    """Fit a family to a fold."""
    tried = count()

    def tell(what: str, share: float | None = None) -> None:
        # how much there is to try is not known beforehand
        done = 1 - SHARE_LEFT_PER_TRY ** next(tried) if share is None else share
        say(done, f"held-out part {number + 1} of {folds.used}: {what}")

    held = folds.held(number)
    parts = family.fitted(number, folds.train(number), held, tell)
    tell(family.name, 1.0)
    return Fitted(parts, {name: at_observed(part, held.points) for name, part in parts.items()})


def _narrow(families: list[Family], block: dict[tuple[str, str], Tensor], held: Rows) -> Tensor:
    """Keep of each family what has most weight in the first fold, or may have, and the best alone.

    Return the log densities (N,) of all of them together.
    """
    keys = list(block)
    table = torch.stack([block[key] for key in keys])
    best_weights = stacking_weights(table, held.weights)
    weights: list[float] = listed(best_weights)
    for family in families:
        shares = {name: w for (f, name), w in zip(keys, weights, strict=True) if f == family.name}
        if shares:
            best = max(shares, key=lambda name, f=family.name: held.mean(block[f, name]))
            some = [name for name, w in shares.items() if w >= family.negligible]
            if family.kept is not None:
                some = sorted(some, key=lambda name, w=shares: -w[name])[: family.kept]
            family.keep({best, *some})
    return stacked(table, best_weights)


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
    evidence: list[ComponentEvidence] = []
    names = dict.fromkeys(family for family, _ in candidates.keys if family != FLOOR)
    for name in names:
        of_family = candidates.of(name)
        alone = stacked(table, candidates.mixed(of_family))
        share = float(weights[of_family & ~candidates.floor].sum())
        gain = Gain(0.0, 0.0)
        if share:
            others = ~of_family if among is None else among & ~of_family
            without = stacked(table, candidates.mixed(others | candidates.floor))
            gain = gain_of(whole, without, own_weights)
        above = mean_of(alone - uniform, own_weights)
        evidence.append(
            ComponentEvidence(name, share, above, gain.nats, gain.error, table.shape[1])
        )
    return evidence


@dataclass(frozen=True)
class Evidence:
    """Candidates and their shares of a density of all rows, which are in random order.

    - `shares`: Of all candidates (P,).
    - `apart`: For each fold the shares (P,) by the rows held out with the others: those by its own rows
      would be too good to judge by these.
    """

    space: Space
    families: Sequence[Family]
    candidates: Candidates
    rows: Rows
    shares: Tensor
    apart: Sequence[Tensor]

    @classmethod
    def of(
        cls,
        space: Space,
        families: Sequence[Family],
        candidates: Candidates,
        rows: Rows,
        shares: Tensor,
    ) -> Evidence:
        """Return the evidence for shares (P,), with what other folds say of the same candidates."""
        live = shares > 0
        apart: list[Tensor] = []
        for fold in range(len(candidates.sizes)):
            rest = candidates.fold != fold
            counts = None if candidates.row_weights is None else candidates.row_weights[rest]
            of_fold = torch.zeros_like(shares)
            of_fold[live] = shares[live]
            if bool(rest.any()):
                table, floor = candidates.table[live][:, rest], candidates.floor[live]
                of_fold[live] = sparse_weights(table, floor, counts)
            apart.append(of_fold)
        return cls(space, families, candidates, rows, shares, apart)

    @property
    def chosen(self) -> Tensor:
        """The numbers of the candidates that have a share."""
        return torch.nonzero(self.shares > 0)[:, 0]

    def parts(self, fold: int) -> list[Density]:
        """Return those that have a share, as they were fitted to all rows but those of a fold."""
        numbers: list[int] = listed(self.chosen)
        keys = [self.candidates.keys[k] for k in numbers]
        return [
            UniformDensity(self.space)
            if family == FLOOR
            else self.candidates.fitted[family][fold][name]
            for family, name in keys
        ]

    def without(self, fold: int) -> Mixture:
        """Return the density of all rows but those of a fold."""
        shares: list[float] = listed(self.apart[fold][self.chosen])
        return mixture_of(list(zip(shares, self.parts(fold), strict=True)))

    def assembled(self, flow: Density | None = None, share: float = 0.0) -> Mixture:
        """Return the candidates in their shares, made final with all rows, beside a flow's share."""
        before: list[tuple[float, Density]] = []
        after: list[tuple[float, Density]] = []
        for family in self.families:
            chosen = [
                (name, float(weight))
                for (kind, name), weight in zip(self.candidates.keys, self.shares, strict=True)
                if kind == family.name and weight > 0
            ]
            fitted = self.candidates.fitted[family.name]
            final = family.final(self.rows, fitted, [name for name, _ in chosen])
            parts = before if family.precedes_floor else after
            parts += [(weight, part) for (_, weight), part in zip(chosen, final, strict=True)]
        floor = float(self.shares[self.candidates.floor].sum())
        parts = [*before, (floor, UniformDensity(self.space)), *after]
        total = sum(weight for weight, _ in parts)
        others = [((1 - share) * weight / total, part) for weight, part in parts]
        return mixture_of(others if flow is None else [(share, flow), *others])
