"""Groups of rows that belong together, and bootstrap resamples of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbiflow.density.fitting.rows import group_numbers
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry.isometry import Array

LEAST_GROUPS = 5
"""Independent rows or groups that an uncertainty needs."""

FEW_GROUPS = 20
"""Below which it is said that an uncertainty is rough itself."""

BLOCK_ENTRIES = 4_000_000
"""Of a block of resamples times groups: bounds the memory."""


@dataclass(frozen=True, eq=False)
class Groups:
    """Rows in groups: those of one group (a protein, a station, an event) are not independent.

    - `index`: (N,) the group of each row, from 0. `count`: of the groups.
    - `given`: whether there are groups; else each row is one.

    >>> Groups.of(["a", "b", "a"], 3).index.tolist()
    [0, 1, 0]
    """

    index: NDArray[np.int64]
    count: int
    given: bool

    @classmethod
    def of(cls, labels: ArrayLike | None, rows: int) -> Groups:
        """From a label a row, of any kind; None for rows that are independent.

        Raises:
            OrbiflowError: for another number of labels.
        """
        if labels is None:
            return cls(np.arange(rows), rows, False)
        index = group_numbers(labels, rows)
        return cls(index, int(index.max(initial=-1)) + 1, True)

    @property
    def what(self) -> str:
        """What is independent, in a word."""
        return "groups" if self.given else "rows"

    def require(self) -> None:
        """
        Raises:
            OrbiflowError: if there are too few for an uncertainty.
        """
        if self.count < LEAST_GROUPS:
            raise OrbiflowError(
                f"{self.count} {self.what} are too few to tell an uncertainty from: there must be "
                f"{LEAST_GROUPS}"
            )

    def notes(self) -> list[str]:
        """What should be said of them."""
        if self.count >= FEW_GROUPS:
            return []
        return [f"of only {self.count} {self.what} the uncertainties themselves are rough"]

    def sums(self, values: Array) -> Array:
        """Sums (G, ...) over each group of values (N, ...)."""
        flat = values.reshape(len(values), -1)
        columns = [np.bincount(self.index, column, minlength=self.count) for column in flat.T]
        return np.stack(columns, axis=1).reshape(self.count, *values.shape[1:])


def resampled_sums(table: Array, resamples: int, rng: np.random.Generator) -> Array:
    """Sums (B, k) of a table (G, k) over G rows drawn with replacement, `resamples` times."""
    return np.concatenate([w @ table for w in _weights(len(table), resamples, rng)])


def _weights(count: int, resamples: int, rng: np.random.Generator) -> Iterator[Array]:
    """How often each of `count` is drawn: blocks (b, count)."""
    size = max(1, BLOCK_ENTRIES // count)
    for start in range(0, resamples, size):
        number = min(size, resamples - start)
        drawn = rng.integers(count, size=(number, count)) + count * np.arange(number)[:, None]
        found = np.bincount(drawn.ravel(), minlength=number * count)
        yield found.reshape(number, count).astype(np.float64)
