"""The weights of densities by what they give to rows that were held out: stacking."""

from __future__ import annotations

import torch
from torch import Tensor

from orbiflow.density.fitting.rows import gain_of, mean_of

TOLERANCE_NATS = 1e-4
"""Nats by which the weights may be worse than the best ones."""

MAX_ITERATIONS, ITERATIONS_PER_CHECK = 3_000, 25
"""Maximum iterations of EM, and iterations between checks of convergence."""

MIN_WEIGHT = 3e-3
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
    for iteration in range(MAX_ITERATIONS):
        ratio = relative @ (shares / (weights @ relative))
        if iteration % ITERATIONS_PER_CHECK == 0 and float(ratio.max()) - 1 < TOLERANCE_NATS:
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
    """Return weights as `stacking_weights` does, without `MIN_WEIGHT` ones; `always` (P,) has some.

    The least weight of what must be there is half a row's: nothing is impossible that as many rows
    could not rule out.
    """
    weights = stacking_weights(table, row_weights)
    kept = (weights >= MIN_WEIGHT) | always
    found = torch.zeros_like(weights)
    found[kept] = stacking_weights(table[kept], row_weights)
    least = 0.5 / (table.shape[1] + 1)
    found[always] = found[always].clamp_min(least)
    return found / found.sum()
