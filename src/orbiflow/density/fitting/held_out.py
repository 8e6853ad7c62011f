"""Rows that are held out: their folds, and the weights of densities by what these give to them."""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from orbiflow.density.data import group_numbers
from orbiflow.density.fitting.repeats import places
from orbiflow.density.fitting.rows import Rows, gain_of, mean_of
from orbiflow.errors import OrbiflowError

FOLDS = 10
"""Number of folds: each holds out a tenth of the rows."""

LEAST_PLACES = 10
"""The fewest different points that a density needs."""

USED = ((600, 10), (2_000, 5), (10_000, 3))
"""The number of folds that are used, for up to so many rows; with more rows 2 are enough."""

FAST_USED = 5
"""The most folds that are used with effort "fast"."""

MOST_HELD = 2_000
"""The most rows of a fold that are scored."""


@dataclass(frozen=True)
class Folds:
    """Rows in random order, and the fold (N,) of each.

    - `used`: folds that are held out in turn, from the first.
    """

    rows: Rows
    fold: Tensor
    used: int

    def train(self, number: int) -> Rows:
        """Return all rows but those of a fold."""
        return self.rows[self.fold != number]

    def held(self, number: int) -> Rows:
        """Return the rows of a fold, `MOST_HELD` at most."""
        return self.rows[self.fold == number][:MOST_HELD]


def folds_of(
    rows: Rows, *, together: bool, generator: torch.Generator, fast: bool = False
) -> Folds:
    """Return random tenths of the rows, of which 10 or more are different.

    A new row of the same source repeats an old one as often as the old ones repeat each other, and so
    do rows held out at random. Where equal rows are an accident of rounding, that would reward peaks
    at the values that happened to be recorded: then they are kept `together`, in one fold. So are rows
    of one group, whatever they are: each of fewer than ten groups is a fold.
    """
    rows = rows[torch.randperm(len(rows), generator=generator)]
    folds = FOLDS
    if rows.groups is not None:
        # some may have lost all their rows
        groups = torch.as_tensor(group_numbers(rows.groups.numpy(), len(rows)))
        sizes = torch.bincount(groups)
        order = torch.randperm(len(sizes), generator=generator)
        folds = min(FOLDS, len(sizes))
        dealt = torch.empty_like(order)
        dealt[order] = torch.as_tensor(lightest_folds(sizes[order].numpy(), folds))
        group = dealt[groups]
    elif together:
        _, place = places(rows.points)
        group = torch.randperm(int(place.max()) + 1, generator=generator)[place]
    else:
        group = torch.arange(len(rows))
    used = next((count for most, count in USED if len(rows) <= most), 2)
    used = min(used, FAST_USED) if fast else used
    dealt_folds = Folds(rows, group % folds, min(used, folds))
    if rows.groups is None:
        return dealt_folds
    left = min(
        len(places(dealt_folds.train(number).points)[0]) for number in range(dealt_folds.used)
    )
    if left < LEAST_PLACES:
        raise OrbiflowError(
            f"groups: where whole groups are held out, {left} different rows are left to fit to, and "
            f"{LEAST_PLACES} are needed: more or smaller groups"
        )
    return dealt_folds


def lightest_folds(sizes: NDArray[np.int64], folds: int) -> NDArray[np.int64]:
    """Return the fold of each group, of these sizes, in order: the one with the fewest rows so far."""
    if bool((sizes == sizes[0]).all()):
        return np.arange(len(sizes)) % folds
    heap = [(0, k) for k in range(folds)]
    fold = np.empty(len(sizes), dtype=np.int64)
    for place, size in enumerate(sizes.tolist()):
        rows, fold[place] = heap[0]
        heapq.heapreplace(heap, (rows + size, int(fold[place])))
    return fold


TOLERANCE_NATS = 1e-4
"""Nats by which the weights may be worse than the best ones."""

MAX_ITERATIONS, ITERATIONS_PER_CHECK = 3_000, 25
"""Maximum iterations of EM, and iterations between checks of convergence."""

MIN_WEIGHT = 3e-3
"""Weights below this are dropped."""

LEAST_OF_BEST = 0.8
"""Share of the best candidate's gain that another must have by itself to need no proof in a mixture."""


def stacked(table: Tensor, weights: Tensor) -> Tensor:
    """Return log densities (N,) of the mixture in proportions (P,), from a table (P, N)."""
    return (table + weights.log()[:, None]).logsumexp(dim=0)


def stacking_weights(
    table: Tensor, row_weights: Tensor | None = None, start: Tensor | None = None
) -> Tensor:
    """Return proportions (P,) with the greatest mean log density of held-out rows, from a table (P, N).

    The problem is concave; EM finds its only optimum (Smyth and Wolpert, Linearly combining density
    estimators via stacking, 1999). The largest mean ratio of a density to the mixture, less 1, bounds
    what is missing. Rows may be weighted (N,), and EM may `start` from positive proportions (P,). Its
    thousands of small steps are sooner done in arrays.

    >>> table = torch.tensor([[0.0, 0.0], [-1.0, -1.0]])
    >>> stacking_weights(table).round(decimals=2)
    tensor([1., 0.])
    """
    first = torch.ones_like(table[:, 0]) if start is None else start.to(table)
    counts = torch.ones_like(table[0]) if row_weights is None else row_weights.to(table)
    relative, weights, shares = (
        own.detach().cpu().numpy()
        for own in ((table - table.amax(dim=0)).exp(), first / first.sum(), counts / counts.sum())
    )
    for iteration in range(MAX_ITERATIONS):
        ratio = relative @ (shares / (weights @ relative))
        if iteration % ITERATIONS_PER_CHECK == 0 and float(ratio.max()) - 1 < TOLERANCE_NATS:
            break
        weights = weights * ratio
        weights = weights / weights.sum()
    return torch.as_tensor(weights).to(table)


def supported_weights(table: Tensor, always: Tensor, row_weights: Tensor | None = None) -> Tensor:
    """Return weights as `sparse_weights` does, without spikes that only a few rows support.

    Two rows that happen to be close give kernels as narrow as that a weight of about two rows, and
    pictures a spike at every row. So candidates that gain by themselves, beyond what is `always` there,
    less than `LEAST_OF_BEST` of the best one's gain must gain more than chance, all together.
    """
    weights = sparse_weights(table, always, row_weights)
    means = torch.tensor([mean_of(row, row_weights) for row in table])
    least = means[always].max()
    spikes = ~always & (means < least + LEAST_OF_BEST * (means.max() - least).clamp_min(0.0))
    if not bool((weights[spikes] > 0).any()):
        return weights
    rest = ~spikes
    others = torch.zeros_like(weights)
    others[rest] = sparse_weights(table[rest], always[rest], row_weights)
    gain = gain_of(stacked(table, weights), stacked(table[rest], others[rest]), row_weights)
    return weights if gain.is_sure else others


def sparse_weights(table: Tensor, always: Tensor, row_weights: Tensor | None = None) -> Tensor:
    """Return weights as `stacking_weights` does, without `MIN_WEIGHT` ones; `always` (P,) has some.

    The least weight of what must be there is half a row's: nothing is impossible that as many rows
    could not rule out.
    """
    weights = stacking_weights(table, row_weights)
    kept = (weights >= MIN_WEIGHT) | always
    sparse = torch.zeros_like(weights)
    start = weights[kept].clamp_min(MIN_WEIGHT**2)
    sparse[kept] = stacking_weights(table[kept], row_weights, start)
    least = 0.5 / (table.shape[1] + 1)
    sparse[always] = sparse[always].clamp_min(least)
    return sparse / sparse.sum()
