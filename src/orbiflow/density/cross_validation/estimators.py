"""Cross-validation of an estimator in Python: log densities of rows that its fits have not seen."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbiflow.arrays import Array
from orbiflow.density.comparing import cross_validation_folds
from orbiflow.density.data import asked_roles, is_declared
from orbiflow.density.estimator import DensityEstimator
from orbiflow.density.given_covariates import columns_given


@dataclass(frozen=True, eq=False)
class CrossValidatedRows:
    """Rows, each scored by a fit that had not seen it.

    - `log_prob`: Their log densities (N,) in nats, in natural measure.
    - `fold`: The fold (N,) of each, from 0.
    - `weights`: How much each counts (N,); None where all count the same.
    """

    log_prob: Array
    fold: NDArray[np.int64]
    weights: Array | None = None

    @property
    def mean(self) -> float:
        """The mean log density."""
        return float(np.average(self.log_prob, weights=self.weights))


def cross_validate(
    estimator: DensityEstimator,
    rows: Any,
    given: Any = None,
    *,
    folds: int = 10,
    sample_weight: ArrayLike | None = None,
    groups: ArrayLike | None = None,
    seed: int = 0,
) -> CrossValidatedRows:
    """Return the log density of each row by a fit to the rows of other folds.

    `compare_scores` compares the log densities of several estimators at the same folds.

    Args:
        estimator: A `DensityEstimator`; it is not changed.
        rows: Data as for its `fit`.
        given: What is known of them, as for `DensityEstimator.fit`.
        folds: The number of folds.
        sample_weight: How much each row counts (N,).
        groups: A label (N,) a row: rows of one are held out together. Default: those of a column that
            is declared as group.
        seed: Seed of the folds.

    Raises:
        OrbiflowError: As `fit` and `cross_validation_folds`.

    >>> from orbiflow import DensityEstimator
    >>> angles = np.random.default_rng(0).vonmises(0, 4, (60, 1))
    >>> found = cross_validate(DensityEstimator(components="kernels"), angles, folds=2)
    >>> bool(-1.5 < found.mean < 0)
    True
    """
    declared = is_declared(given)
    cells = {} if declared or given is None else columns_given(given)
    names = [str(name) for name in asked_roles(given)] if declared else list(cells)
    first = DensityEstimator(**estimator.get_params())
    read = first.read_rows(rows, others=names if declared else (), apart=names)
    weights, labels = read.beside(sample_weight, groups)
    read = replace(
        read,
        weights=None if weights is None else np.asarray(weights, dtype=np.float64),
        labels=None if labels is None else np.asarray(labels),
        given=cells or read.given,
    )
    fold = cross_validation_folds(len(read.values), folds, together=read.labels, seed=seed)
    scores = np.full(len(fold), np.nan)
    for number in range(folds):
        seen, unseen = read.only(fold != number), read.only(fold == number)
        fit = DensityEstimator(**estimator.get_params())
        fit.fit(seen, given=given if declared or given is None else seen.given)
        cells_unseen = None if given is None else unseen.given
        scores[fold == number] = fit.score_samples(unseen.values, given=cells_unseen)
    return CrossValidatedRows(scores, fold, read.weights)
