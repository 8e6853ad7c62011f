"""Folds of rows that are held out."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from orbiflow.density.fitting.repeats import places
from orbiflow.density.fitting.rows import Rows, group_numbers
from orbiflow.errors import OrbiflowError

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
