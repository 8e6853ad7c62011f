"""Shares of a joint density's parts that suit what is known of the other columns."""

from __future__ import annotations

from dataclasses import replace

import torch
from scipy import optimize
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.fitting.evidence import Evidence
from orbiflow.density.fitting.held_out import Folds
from orbiflow.density.models import log_of_covariates

SHARE_RIDGE = 1e-3
"""Weight of the mean square of the logarithms by which shares are changed for what is asked."""


def for_conditionals(evidence: Evidence, folds: Folds, dim: int) -> Evidence:
    """Return evidence with shares that suit the first `dim` columns best where the others are known.

    Those of a joint density make all columns likeliest, and how covariates are spread does not count.
    """
    tables: list[Tensor] = []
    for fold in range(folds.used):
        whole, parts = folds.held(fold).points, evidence.parts(fold)
        both = torch.stack([part.log_prob(whole) for part in parts])
        alone = torch.stack([log_of_covariates(part, whole, dim) for part in parts])
        tables.append(torch.stack([both, alone]))
    table, candidates = torch.cat(tables, dim=2), evidence.candidates
    counts = candidates.row_weights
    counts = torch.ones_like(table[0, 0]) if counts is None else counts
    folds_of_rows = candidates.fold

    def shares(some: Tensor) -> Tensor:
        every = torch.zeros_like(evidence.shares)
        chosen = evidence.chosen
        every[chosen] = _conditional_shares(
            table[:, :, some], counts[some], evidence.shares[chosen], candidates.floor[chosen]
        )
        return every

    apart = [shares(folds_of_rows != fold) for fold in range(folds.used)]
    return replace(evidence, shares=shares(folds_of_rows >= 0), apart=apart)


def _conditional_shares(table: Tensor, counts: Tensor, start: Tensor, floor: Tensor) -> Tensor:
    """Return shares (P,) by log densities (2, P, n) of whole rows and of covariates alone.

    The search begins at a start, and a ridge holds what few rows decide. Those of the `floor` (P,) do
    not fall: nothing is impossible.
    """
    both, alone = table
    row_shares = counts / counts.sum()

    def loss(values: Array) -> tuple[float, Array]:
        logits = torch.tensor(values, requires_grad=True)
        weights = torch.log_softmax(logits, dim=0)[:, None]
        gains = (both + weights).logsumexp(dim=0) - (alone + weights).logsumexp(dim=0)
        value = SHARE_RIDGE * (logits - start.log()).square().mean() - row_shares @ gains
        (gradient,) = torch.autograd.grad(value, logits)
        return float(value.detach()), gradient.numpy()

    logits_found = optimize.minimize(loss, start.log().numpy(), jac=True, method="L-BFGS-B").x
    best = torch.softmax(torch.tensor(logits_found), dim=0)
    best[floor] = best[floor].maximum(start[floor])
    return best / best.sum()
