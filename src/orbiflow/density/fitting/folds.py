"""Folds of rows that are held out, and rows that repeat another."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.fitting.rows import Rows, group_numbers
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError
from orbiflow.typed_torch import unique

FOLDS = 10
"""Number of folds: each holds out a tenth of the rows."""

LEAST_PLACES = 10
"""The fewest different points that a density needs."""

USED = ((600, 10), (2_000, 5), (10_000, 3))
"""The number of folds that are used, for up to so many rows; with more rows 2 are enough."""

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

    def __iter__(self) -> Iterator[tuple[Rows, Rows]]:
        for number in range(self.used):
            yield self.train(number), self.held(number)


def folds_of(rows: Rows, *, together: bool, generator: torch.Generator) -> Folds:
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
    found = Folds(rows, group % folds, min(used, folds))
    if rows.groups is None:
        return found
    left = min(len(places(train.points)[0]) for train, _ in found)
    if left < LEAST_PLACES:
        raise OrbiflowError(
            f"groups: where whole groups are held out, {left} different rows are left to fit to, and "
            f"{LEAST_PLACES} are needed: more or smaller groups"
        )
    return found


def lightest_folds(sizes: NDArray[np.int64], folds: int) -> NDArray[np.int64]:
    """Return the fold of each group, of these sizes, in order: the one with the fewest rows so far."""
    if bool((sizes == sizes[0]).all()):
        return np.arange(len(sizes)) % folds
    heap = [(0, k) for k in range(folds)]
    found = np.empty(len(sizes), dtype=np.int64)
    for place, size in enumerate(sizes.tolist()):
        rows, found[place] = heap[0]
        heapq.heapreplace(heap, (rows + size, int(found[place])))
    return found


SAME = 1e-13
"""Difference of chart coordinates within which points are the same: far below what kernels resolve."""


def places(points: Tensor) -> tuple[Tensor, Tensor]:
    """Return the number of points (N, d) at each different place (M,), and the place (N,) of each."""
    # rounding keeps together what differs by the projection's last digits
    _, place, counts = unique(
        (points / SAME).round(), dim=0, return_inverse=True, return_counts=True
    )
    return counts, place


STEPS = tuple(m * 10.0**e for e in range(2, -7, -1) for m in (5, 2, 1))
"""Steps of rounding that are looked for."""

MANY = 2.0
"""If there are more than so many times the repeats that rounding explains, they are real."""


@dataclass(frozen=True)
class Repeats:
    """Rows that repeat another, and how far rounding explains them.

    - `rows`: The number of rows that repeat an earlier one.
    - `places`: The number of different ones.
    - `step`: The step to which all values are rounded, in the data's unit; None if there is none.
    - `explained`: The share of pairs of equal rows that rounding explains; None if values are not
      rounded or nothing repeats.
    """

    rows: int
    places: int
    step: float | None
    explained: float | None

    @property
    def is_rounding(self) -> bool:
        """Whether rounding explains the repeats."""
        return self.explained is not None and self.explained * MANY >= 1

    def notes(self, taken_for: str) -> list[str]:
        """Return what was found and assumed, in words; `taken_for` is "places" or "rounding"."""
        if not self.rows:
            return []
        total = self.rows + self.places
        found = f"{self.rows} of {total} rows repeat an earlier one"
        if self.is_rounding:
            found += f", as many as rounding to {self.step:g} brings about"
        elif self.step is not None:
            found += f", far more than rounding to {self.step:g} brings about"
        else:
            found += ", and the values are not rounded: they are places of their own"
        if taken_for == "places":
            assumed = "new rows are taken to repeat them as often (--repeats rounding: not to)"
        else:
            assumed = "they are taken for an accident: equal rows were held out together"
        return [f"{found}; {assumed}"]


def repeats_of(space: Space, points: Tensor) -> Repeats:
    """Return what repeats among points (N, d).

    Where values are rounded and the density is even over a few steps, as many pairs of rows are equal
    as are exactly one step apart in one direction.
    """
    counts, _ = places(points)
    rows = len(points) - len(counts)
    data = space.from_chart(points)
    step = _step(data) if rows else None
    explained = None if step is None else _explained(data, step, counts)
    return Repeats(rows, len(counts), step, explained)


def _step(data: Array) -> float | None:
    """Return the largest of `STEPS` of which all values are multiples, within rounding errors."""
    scale = max(1.0, float(abs(data).max()))
    for step in STEPS:
        tolerance = 1e-9 * scale / step
        if tolerance > 1e-3:
            break
        multiples = data / step
        if bool((abs(multiples - np.round(multiples)) < tolerance).all()):
            return step
    return None


def _explained(data: Array, step: float, counts: Tensor) -> float | None:
    """Return the ratio of pairs that are one step apart to pairs that are equal."""
    equal = float((counts.double() * (counts - 1) / 2).sum())
    cells, number = np.unique(np.round(data / step).astype(np.int64), axis=0, return_counts=True)
    of = {tuple(cell): int(n) for cell, n in zip(cells.tolist(), number, strict=True)}
    apart = 0.0
    for shift in np.eye(data.shape[1], dtype=np.int64):
        beside = (cells + shift).tolist()
        apart += sum(n * of.get(tuple(m), 0) for n, m in zip(of.values(), beside, strict=True))
    # of n rows in a cell n (n - 1) / 2 pairs are equal, and n m with the m of a cell beside it
    return apart / data.shape[1] / 2 / equal if equal else None
