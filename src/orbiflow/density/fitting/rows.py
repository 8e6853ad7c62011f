"""Rows of data and what each weighs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from orbiflow.density.arguments import float_tensor
from orbiflow.errors import OrbiflowError


@dataclass(frozen=True)
class Rows:
    """Points (N, d) and their weights (N,), None where all weigh the same."""

    points: Tensor
    weights: Tensor | None = None

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, chosen: Tensor | slice) -> Rows:
        weights = None if self.weights is None else self.weights[chosen]
        return Rows(self.points[chosen], weights)

    def mean(self, values: Tensor) -> float:
        """The mean of values (N,), as the rows weigh."""
        return mean_of(values, self.weights)


def mean_of(values: Tensor, weights: Tensor | None) -> float:
    """The mean of values (N,), weighted.

    >>> mean_of(torch.tensor([1.0, 4.0]), torch.tensor([2.0, 1.0]))
    2.0
    """
    if weights is None:
        return float(values.mean())
    return float((weights.to(values) * values).sum() / weights.to(values).sum())


def effective_rows(weights: Tensor) -> float:
    """How many rows of equal weight say as much (Kish, Survey Sampling, 1965, 11.7).

    >>> effective_rows(torch.tensor([1.0, 1.0, 0.0, 0.0]))
    2.0
    """
    return float(weights.sum() ** 2 / weights.square().sum())


def weights_of(weights: Any, known: Tensor) -> Tensor:
    """Weights of the rows that are `known` (N,).

    Raises:
        OrbiflowError: for another number of weights than rows.
    """
    own = float_tensor(weights, "weights")
    if own.shape != known.shape:
        raise OrbiflowError(
            f"expected a weight for each of {len(known)} rows, got an array {tuple(own.shape)}"
        )
    return own[known]


def weighed(points: Tensor, weights: Any) -> Rows:
    """Rows with a weight, and their weights of mean 1: only their ratios count.

    Rows of weight 0 are left out; equal weights are none.

    Raises:
        OrbiflowError: for another number of weights than points, negative or infinite ones, NaN, or
            weights that are all 0.
    """
    if weights is None:
        return Rows(points)
    own = float_tensor(weights, "weights").detach().double().clone()
    if own.shape != points.shape[:1]:
        raise OrbiflowError(
            f"expected a weight for each of {len(points)} rows, got an array {tuple(own.shape)}"
        )
    bad = torch.nonzero(~(own.isfinite() & (own >= 0)))[:, 0]
    if len(bad):
        raise OrbiflowError(
            f"weights must be finite and at least 0; row {int(bad[0]) + 1} has {float(own[bad[0]]):g} "
            f"({len(bad)} such rows)"
        )
    if not bool((own > 0).any()):
        raise OrbiflowError("all weights are 0: no row is left to fit to")
    points, own = points[own > 0], own[own > 0]
    if bool((own == own[0]).all()):
        return Rows(points)
    return Rows(points, own / own.max() / (own / own.max()).mean())


def weights_note(rows: Rows) -> list[str]:
    """What to say of the weights of the rows."""
    if rows.weights is None:
        return []
    effective = effective_rows(rows.weights)
    ratio = float(rows.weights.max() / rows.weights.min())
    return [
        f"the rows are weighted, the largest weight {ratio:.3g} times the smallest: {len(rows)} rows "
        f"say as much as {effective:.1f} of equal weight"
    ]
