"""A grid of a function's values that is fine only where the function crosses certain levels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array

Function = Callable[[Array], Array]
"""A function from points (N, 2) to values (N,)."""

Flags = NDArray[np.bool_]

MAX_ROUNDS = 200
"""Rounds of evaluating what lies beside a crossing, at most, for each size of cells."""


@dataclass(frozen=True, eq=False)
class Seeds:
    """Points (S, 2) at which the function is known, so that islands between the nodes are found."""

    points: Array
    values: Array


class LevelGrid:
    """Values (n + 1, m + 1) at the nodes of n x m even cells between `low` and `high`.

    They are evaluated everywhere on `cells`, which are then halved, `doublings` times or until `budget`
    evaluations, where a level is crossed. Values are exact at both ends of every side of a cell whose
    ends are on different sides of one of the levels (T,); elsewhere they are interpolated from coarser
    cells.

    - `evaluations`: Number of evaluations of the function.
    """

    def __init__(
        self,
        function: Function,
        low: Array,
        high: Array,
        cells: tuple[int, int],
        levels: Array,
        seeds: Seeds,
        doublings: int,
        budget: int,
    ) -> None:
        self.function, self.low, self.high = function, low, high
        self.levels, self.seeds = levels, seeds
        self.values = np.zeros((cells[0] + 1, cells[1] + 1))
        self.known = np.zeros(self.values.shape, dtype=bool)
        self.evaluations = 0
        self._evaluate(~self.known)
        for _ in range(doublings):
            if self.evaluations >= budget:
                break
            self._double()

    @property
    def step(self) -> Array:
        """The sides of a cell."""
        return (self.high - self.low) / (np.array(self.values.shape) - 1)

    def _double(self) -> None:
        """Halve the cells, and evaluate around crossings and where seeds were missed."""
        wanted = self._missed()
        known = np.zeros(2 * np.array(self.known.shape) - 1, dtype=bool)
        known[::2, ::2] = self.known
        self.values, self.known = _doubled(self.values), known
        self._evaluate(_corners(np.repeat(np.repeat(wanted, 2, axis=0), 2, axis=1)))
        for _ in range(MAX_ROUNDS):
            if not self._evaluate(_corners(self._mixed())):
                return

    def cells_of(self, points: Array) -> NDArray[np.int64]:
        """Return the cells (N, 2) that hold points (N, 2)."""
        most = np.array(self.values.shape) - 2
        return np.clip(np.floor((points - self.low) / self.step).astype(np.int64), 0, most)

    def _missed(self) -> Flags:
        """Return the cells (n, m) with a seed on the other side of a level than all their nodes."""
        i, j = self.cells_of(self.seeds.points).T
        found = np.zeros(np.array(self.values.shape) - 1, dtype=bool)
        for level in self.levels:
            least, most = _extremes(self.values >= level)
            lost = np.where(self.seeds.values >= level, ~most[i, j], least[i, j])
            found[i[lost], j[lost]] = True
        return found

    def _mixed(self) -> Flags:
        """Return the cells (n, m) that cross a level."""
        found = np.zeros(np.array(self.values.shape) - 1, dtype=bool)
        for level in self.levels:
            least, most = _extremes(self.values >= level)
            found |= most & ~least
        return found

    def _evaluate(self, wanted: Flags) -> int:
        """Evaluate at wanted nodes that are not known, and return their number."""
        index = np.argwhere(wanted & ~self.known)
        if len(index):
            found = self.function(self.low + index * self.step)
            self.values[tuple(index.T)] = found
            self.known[tuple(index.T)] = True
            self.evaluations += len(index)
        return len(index)


def _extremes(above: Flags) -> tuple[Flags, Flags]:
    """Return whether all, and whether any, of a cell's four nodes are above a level."""
    four = (above[:-1, :-1], above[1:, :-1], above[:-1, 1:], above[1:, 1:])
    return np.logical_and.reduce(four), np.logical_or.reduce(four)


def _corners(cells: Flags) -> Flags:
    """Return the nodes of cells."""
    found = np.zeros(np.array(cells.shape) + 1, dtype=bool)
    for i in (0, 1):
        for j in (0, 1):
            found[i : i + cells.shape[0], j : j + cells.shape[1]] |= cells
    return found


def _doubled(values: Array) -> Array:
    """Return values interpolated on cells of half the size."""
    found = np.empty(2 * np.array(values.shape) - 1)
    found[::2, ::2] = values
    found[1::2, ::2] = (values[1:] + values[:-1]) / 2
    found[:, 1::2] = (found[:, 2::2] + found[:, :-2:2]) / 2
    return found
