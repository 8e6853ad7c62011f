"""Groups of rows that belong together, bootstrap resamples of them, and folds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbiflow.arguments import as_whole
from orbiflow.arrays import Array
from orbiflow.density.fitting import group_numbers, lightest_folds
from orbiflow.errors import OrbiflowError

MIN_GROUPS = 5
"""Number of independent rows or groups that an uncertainty needs."""

FEW_GROUPS = 20
"""Number of rows or groups below which a note says that the uncertainty is rough itself."""

BLOCK_ENTRIES = 4_000_000
"""Entries of a block of resamples times groups, which bounds the memory."""


@dataclass(frozen=True, eq=False)
class Groups:
    """Rows in groups: those of one group (a protein, a station, an event) are not independent.

    - `index`: The group (N,) of each row, from 0. `count`: The number of groups.
    - `given`: Whether there are groups; otherwise each row is one.

    >>> Groups.of(["a", "b", "a"], 3).index.tolist()
    [0, 1, 0]
    """

    index: NDArray[np.int64]
    count: int
    given: bool

    @classmethod
    def of(cls, labels: ArrayLike | None, rows: int) -> Groups:
        """Return groups from a label for each row, of any kind; None means independent rows."""
        if labels is None:
            return cls(np.arange(rows), rows, False)
        index = group_numbers(labels, rows)
        return cls(index, int(index.max(initial=-1)) + 1, True)

    @property
    def what(self) -> str:
        """What is independent, in a word."""
        return "groups" if self.given else "rows"

    def require(self) -> None:
        """Check that there are enough for an uncertainty."""
        if self.count < MIN_GROUPS:
            raise OrbiflowError(
                f"{self.count} {self.what} are too few for an uncertainty: there must be at least "
                f"{MIN_GROUPS}"
            )

    def notes(self) -> list[str]:
        """Return what the user should know of them."""
        if self.count >= FEW_GROUPS:
            return []
        return [f"of only {self.count} {self.what} the uncertainties themselves are rough"]

    def sums(self, values: Array) -> Array:
        """Return sums (G, ...) over each group of values (N, ...)."""
        flat = values.reshape(len(values), -1)
        columns = [np.bincount(self.index, column, minlength=self.count) for column in flat.T]
        return np.stack(columns, axis=1).reshape(self.count, *values.shape[1:])


def resampled_sums(table: Array, resamples: int, rng: np.random.Generator) -> Array:
    """Return sums (B, k) of a table (G, k) over G rows drawn with replacement, `resamples` times."""
    count = len(table)
    size = max(1, BLOCK_ENTRIES // count)
    found: list[Array] = []
    for start in range(0, resamples, size):
        number = min(size, resamples - start)
        drawn = rng.integers(count, size=(number, count)) + count * np.arange(number)[:, None]
        weights = np.bincount(drawn.ravel(), minlength=number * count).reshape(number, count)
        found.append(weights.astype(np.float64) @ table)
    return np.concatenate(found)


MAX_FOLDS = 1000


def cross_validation_folds(
    rows: int, folds: int = 10, *, together: ArrayLike | None = None, seed: int = 0, split: int = 0
) -> NDArray[np.int64]:
    """Return the random fold (N,) of each row, from 0; each row is held out once.

    Groups are dealt out in random order, always to the fold that has the fewest rows so far. So the
    sizes of folds differ by at most one row, or by the size of the largest group.

    Args:
        rows: Number N of rows.
        folds: Number of folds, 2 or more.
        together: A label for each row; rows of one label are in one fold.
        seed: Seed of the folds.
        split: Number of the repetition; each is a split of its own, whatever others there are.

    Raises:
        OrbiflowError: If there is another number of labels than rows, or fewer groups than folds.

    >>> cross_validation_folds(6, 3, together=["a", "a", "b", "b", "c", "c"]).tolist()
    [1, 1, 2, 2, 0, 0]
    """
    folds = as_whole(folds, "folds", 2, MAX_FOLDS)
    units = Groups.of(together, rows)
    if units.count < folds:
        raise OrbiflowError(
            f"{folds} folds need as many {units.what}, there are {units.count}: ask for fewer folds"
        )
    order = np.random.default_rng([seed, split]).permutation(units.count)
    sizes = np.bincount(units.index, minlength=units.count)
    fold = np.empty(units.count, dtype=np.int64)
    fold[order] = lightest_folds(sizes[order], folds)
    return fold[units.index]
