"""Which rows are held out together in a cross-validation."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbiflow.arguments import whole
from orbiflow.density.comparing.resampling import Groups
from orbiflow.density.fitting.folds import lightest_folds
from orbiflow.errors import OrbiflowError

MOST_FOLDS = 1000


def cross_validation_folds(
    rows: int,
    folds: int = 10,
    *,
    together: ArrayLike | None = None,
    seed: int = 0,
    split: int = 0,
) -> NDArray[np.int64]:
    """The fold (N,) from 0 of each row, at random: each is held out once.

    What belongs together is dealt out in random order, always to the fold that has the fewest rows
    by then. So folds of single rows differ by one row at most, others by the largest group at most.

    Args:
        rows: N.
        folds: 2 or more.
        together: a label (N,) a row; rows of one label are in one fold. None: each row is by itself.
        seed: the same one, the same folds.
        split: number of the repetition; each is a split of its own, whatever others there are.

    Raises:
        OrbiflowError: for another number of labels than rows, or fewer of them than folds.

    >>> cross_validation_folds(6, 3, together=["a", "a", "b", "b", "c", "c"]).tolist()
    [1, 1, 2, 2, 0, 0]
    """
    folds = whole(folds, "folds", 2, MOST_FOLDS)
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
