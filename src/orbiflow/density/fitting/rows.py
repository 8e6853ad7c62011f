"""Rows of data, their weights, and angles that they lack."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from orbiflow.density.data import as_numbers, cells_of
from orbiflow.density.inference import check_torus, observed_rows
from orbiflow.density.models import AdaptiveKernels
from orbiflow.density.spaces import Space, row_count
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_choice, as_instance, is_tensor
from orbiflow.typed_torch import listed, unique


@dataclass(frozen=True)
class Rows:
    """Points (N, d) and their weights (N,), None where all weigh the same.

    - `groups`: Whole numbers (N,), from 0; rows of one group are held out together. None: each row is a
      group.
    - `numbers`: The places (N,) that they had among all rows, if these are known.
    """

    points: Tensor
    weights: Tensor | None = None
    groups: Tensor | None = None
    numbers: Tensor | None = None

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, chosen: Tensor | slice) -> Rows:
        beside = (self.weights, self.groups, self.numbers)
        return Rows(self.points[chosen], *(None if c is None else c[chosen] for c in beside))

    def to(self, dtype: torch.dtype) -> Rows:
        """Return the rows with points and weights in a dtype."""
        weights = None if self.weights is None else self.weights.to(dtype)
        return Rows(self.points.to(dtype), weights, self.groups, self.numbers)

    def mean(self, values: Tensor) -> float:
        """Return the mean of values (N,), weighted as the rows are."""
        return mean_of(values, self.weights)


def mean_of(values: Tensor, weights: Tensor | None) -> float:
    """Return the weighted mean of values (N,).

    >>> mean_of(torch.tensor([1.0, 4.0]), torch.tensor([2.0, 1.0]))
    2.0
    """
    if weights is None:
        return float(values.mean())
    return float((weights.to(values) * values).sum() / weights.to(values).sum())


def weighted_mean(values: Any, weights: Any) -> float:
    """Return the mean of values (N,) at rows with weights (N,), which are checked, or None."""
    rows = weighed(torch.as_tensor(values)[:, None], weights)
    return mean_of(rows.points[:, 0], rows.weights)


def effective_rows(weights: Tensor) -> float:
    """Return the number of rows of equal weight that say as much (Kish, 1965, section 11.7).

    >>> effective_rows(torch.tensor([1.0, 1.0, 0.0, 0.0]))
    2.0
    """
    return float(weights.sum() ** 2 / weights.square().sum())


SURE_ERRORS = 2.0
"""Standard errors by which a gain must exceed 0 to be no accident."""


class Gain(NamedTuple):
    """A mean difference of log densities in nats, and its standard error over the rows."""

    nats: float
    error: float

    @property
    def is_sure(self) -> bool:
        """Whether it is no accident of few rows."""
        return self.nats >= SURE_ERRORS * self.error


def gain_of(better: Tensor, worse: Tensor, row_weights: Tensor | None = None) -> Gain:
    """Return the gain of one log density (N,) over another at the same rows, which may be weighted."""
    difference = better - worse
    if row_weights is not None:
        mean = mean_of(difference, row_weights)
        rows = effective_rows(row_weights)
        variance = mean_of((difference - mean) ** 2, row_weights)
        return Gain(mean, math.sqrt(variance / (rows - 1)) if rows > 1 else math.nan)
    spread = float(difference.std()) if len(difference) > 1 else math.nan
    return Gain(float(difference.mean()), spread / math.sqrt(len(difference)))


def weights_of(weights: Any, rows: int) -> Tensor:
    """Return the weights of so many rows, as they were given."""
    cells = cells_of(weights)
    if is_tensor(cells):
        cells = cells.double()
    elif np.asarray(cells).dtype.kind == "b":  # which rows count
        cells = np.asarray(cells, dtype=np.float64)
    counts = torch.tensor(as_numbers(cells, "weights"))
    if counts.shape != (rows,):
        raise OrbiflowError(
            f"expected a weight for each of {rows} rows, got an array {tuple(counts.shape)}"
        )
    return counts


def lone_groups_note(groups: Tensor | None) -> list[str]:
    """Return a note if there are group numbers (N,) and no two rows have the same.

    >>> len(lone_groups_note(torch.tensor([0, 1, 2]))), lone_groups_note(torch.tensor([0, 1, 0]))
    (1, [])
    """
    if groups is None or len(unique(groups)) < len(groups):
        return []
    return [
        "each row has a group of its own, as if there were no groups: does the column say what rows "
        "have in common?"
    ]


def weighed(points: Tensor, weights: Any, groups: Tensor | None = None) -> Rows:
    """Return the rows that have a weight, with weights of mean 1: only their ratios count.

    Rows of weight 0 are left out; equal weights are none.
    """
    numbers = torch.arange(len(points))
    if weights is None:
        return Rows(points, None, groups, numbers)
    mass = weights_of(weights, len(points))
    bad = torch.nonzero(~(mass.isfinite() & (mass >= 0)))[:, 0]
    if len(bad):
        raise OrbiflowError(
            f"weights must be finite and at least 0; row {int(bad[0]) + 1} has {float(mass[bad[0]]):g}"
            f"{row_count(len(bad))}"
        )
    if not bool((mass > 0).any()):
        raise OrbiflowError("all weights are 0: no row is left to fit to")
    kept = Rows(points, mass, groups, numbers)[mass > 0]
    assert kept.weights is not None
    mass = kept.weights / kept.weights.max()
    return replace(kept, weights=None if bool((mass == mass[0]).all()) else mass / mass.mean())


def weights_note(rows: Rows) -> list[str]:
    """Return what the report says about the weights of the rows."""
    if rows.weights is None:
        return []
    effective = effective_rows(rows.weights)
    ratio = float(rows.weights.max() / rows.weights.min())
    return [
        f"the rows are weighted, the largest weight {ratio:.3g} times the smallest: {len(rows)} rows "
        f"say as much as {effective:.1f} of equal weight"
    ]


MISSING = ("refuse", "marginalise")
"""What can be done with rows that lack an angle."""

MARGINAL_PARTS = ("kernels", "mixture")
"""Components that can be fitted to such rows."""

MOST_SPREAD = 4_000
"""The most rows that lack angles whose weights are spread over kernels."""

BLOCK_ENTRIES = 2_000_000
"""Entries of a table of rows against kernels worked on at a time."""


def check_missing(missing: Any) -> str:
    """Return what is done with rows that lack an angle."""
    return as_choice(missing, MISSING, "missing")


def observed_points(space: Space, points: Any) -> tuple[Tensor, Tensor]:
    """Return canonical points (N, d) of a torus, and which rows have an angle at all."""
    as_instance(space, Space, "space", "see `make_space`")
    check_torus(space, "densities of rows that lack angles")
    canonical = observed_rows(points, "points", space).detach().clone()
    has_any = ~canonical.isnan().all(dim=1)
    return space.project(canonical[has_any]), has_any


def is_whole(rows: Rows) -> Tensor:
    """Return which rows (N,) lack nothing."""
    return ~rows.points.isnan().any(dim=1)


def missing_notes(rows: Rows, empty: int) -> list[str]:
    """Return what the report says about rows that lack angles, and `empty` ones that were left out."""
    lacking = len(rows) - int(is_whole(rows).sum())
    some = (
        f"{lacking} of {len(rows)} rows lack some angles and count by the density of those that "
        "they have; kernels are about the whole rows alone; chains, networks and flows were not "
        "tried, as they need whole rows"
    )
    were = (
        "1 row lacks all angles and was" if empty == 1 else f"{empty} rows lack all angles and were"
    )
    return [*([some] if lacking else []), *([f"{were} left out"] if empty else [])]


def with_incomplete(kernels: AdaptiveKernels, rows: Rows, total: float) -> AdaptiveKernels:
    """Return kernels about whole rows whose weights follow the rows that lack angles, too.

    Each such row shares its weight out among the kernels as they explain the angles that it has: one
    step of EM, from kernels of the whole rows' weights, of which there are `total`.
    """
    some = rows[:MOST_SPREAD]
    lacking = float(len(rows)) if rows.weights is None else float(rows.weights.sum())
    gained = torch.zeros_like(kernels.weights)
    logs = kernels.weights.log()
    size = max(1, BLOCK_ENTRIES // len(logs))
    # one pattern of angles that are there after the other
    kinds, number = unique(~some.points.isnan(), dim=0, return_inverse=True)
    for k, kind in enumerate(kinds):
        observed, part = listed(torch.nonzero(kind)[:, 0]), some[number == k]
        for start in range(0, len(part), size):
            block = part[start : start + size]
            share = torch.softmax(kernels.log_each(block.points[:, observed], observed) + logs, 1)
            gained += share.sum(dim=0) if block.weights is None else block.weights @ share
    weights = total * kernels.weights + lacking * gained / gained.sum()
    return AdaptiveKernels(
        kernels.space, kernels.centers, kernels.concentrations, weights / weights.sum()
    )
