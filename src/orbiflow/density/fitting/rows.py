"""Rows of data and what each weighs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor

from orbiflow.arguments import described
from orbiflow.density.arguments import float_tensor
from orbiflow.density.spaces.space import such_rows
from orbiflow.errors import OrbiflowError


@dataclass(frozen=True)
class Rows:
    """Points (N, d) and their weights (N,), None where all weigh the same.

    - `groups`: whole numbers (N,), from 0; rows of one are held out together. None: each by itself.
    """

    points: Tensor
    weights: Tensor | None = None
    groups: Tensor | None = None

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, chosen: Tensor | slice) -> Rows:
        weights = None if self.weights is None else self.weights[chosen]
        groups = None if self.groups is None else self.groups[chosen]
        return Rows(self.points[chosen], weights, groups)

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


def group_numbers(labels: ArrayLike, rows: int) -> NDArray[np.int64]:
    """The group (N,) of each row as a whole number from 0, from a label a row, of any kind.

    Raises:
        OrbiflowError: for another number of labels.

    >>> group_numbers(["a", "b", "a"], 3).tolist()
    [0, 1, 0]
    """
    array = np.asarray(labels)
    if array.shape != (rows,):
        raise OrbiflowError(
            f"groups: expected a label for each of {rows} rows, got {described(labels)}"
        )
    if array.dtype.kind == "O":
        array = array.astype(str)
    return np.unique(array, return_inverse=True)[1].astype(np.int64)


def weighed(points: Tensor, weights: Any, groups: Tensor | None = None) -> Rows:
    """Rows with a weight, and their weights of mean 1: only their ratios count.

    Rows of weight 0 are left out; equal weights are none.

    Raises:
        OrbiflowError: for another number of weights than points, negative or infinite ones, NaN, or
            weights that are all 0.
    """
    if weights is None:
        return Rows(points, None, groups)
    own = float_tensor(weights, "weights").detach().double().clone()
    if own.shape != points.shape[:1]:
        raise OrbiflowError(
            f"expected a weight for each of {len(points)} rows, got an array {tuple(own.shape)}"
        )
    bad = torch.nonzero(~(own.isfinite() & (own >= 0)))[:, 0]
    if len(bad):
        raise OrbiflowError(
            f"weights must be finite and at least 0; row {int(bad[0]) + 1} has {float(own[bad[0]]):g}"
            f"{such_rows(len(bad))}"
        )
    if not bool((own > 0).any()):
        raise OrbiflowError("all weights are 0: no row is left to fit to")
    kept = Rows(points, own, groups)[own > 0]
    assert kept.weights is not None
    own = kept.weights / kept.weights.max()
    return replace(kept, weights=None if bool((own == own[0]).all()) else own / own.mean())


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
