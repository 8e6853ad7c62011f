"""Densities of the data for each word of a column: p(angles | residue), which share what is common."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor

from orbiflow.arguments import described
from orbiflow.density.estimator import DensityEstimator
from orbiflow.density.fitting import (
    Progress,
    fit_chosen,
    group_numbers,
    mean_of,
    silent,
    stacked,
    stacking_weights,
)
from orbiflow.density.inference import at_observed
from orbiflow.density.models import Density, Mixture
from orbiflow.errors import DataWarning, OrbiflowError

FOLDS = 5
"""Parts of the rows that are held out in turn."""

ENOUGH_HELD = 300
"""Rows of a category that are held out, with which no further part is."""

MOST_CATEGORIES = 1_000
"""Each is a fit of its own."""


@dataclass(frozen=True)
class CategoryDensity:
    """The density of the data where the category is known.

    - `estimator`: A fitted estimator. Its density is `weight` times that of the category's rows alone
      and 1 - `weight` times that of all rows.
    - `rows`: How many rows there are of it.
    - `gain`, `gain_error`: Mean nats by which rows held out are likelier than by the density of all
      rows, with its standard error; None where no density could be fitted to the category alone.
    - `note`: Why none could.
    """

    estimator: DensityEstimator
    rows: int
    weight: float
    gain: float | None = None
    gain_error: float | None = None
    note: str = ""


def fit_categories(
    pooled: DensityEstimator,
    X: ArrayLike,
    categories: ArrayLike,
    *,
    sample_weight: ArrayLike | None = None,
    groups: ArrayLike | None = None,
    progress: Progress | None = None,
) -> dict[str, CategoryDensity]:
    """Fit a density of the data for each category, in the order of their names.

    Each is a mixture of a density fitted to the category's rows and that of all rows, so that rare
    categories borrow what they lack. The weight between them maximises the likelihood of rows of the
    category that neither has seen, and of one row more for either side, so that it is never 0 or 1.
    A category whose rows no density can be fitted to has the density of all rows.

    Args:
        pooled: An estimator that was fitted to the same rows; its settings are those of all fits.
        X: The data (N, k).
        categories: The category (N,) of each row, words or numbers.
        sample_weight: How much each row counts (N,), as in `DensityEstimator.fit`.
        groups: A label (N,) a row: rows of one are held out together.

    Raises:
        OrbiflowError: For an estimator before its fit, and for fewer than two categories or more than
            `MOST_CATEGORIES`.

    >>> rng = np.random.default_rng(0)
    >>> which = np.repeat(["a", "b"], 60)
    >>> angles = rng.vonmises(np.where(which == "a", 0.0, 2.0), 4.0)[:, None]
    >>> pooled = DensityEstimator("torus", unit="radians", components="mixture").fit(angles)
    >>> found = fit_categories(pooled, angles, which)
    >>> [bool(found[name].estimator.score([[2.0]]) > pooled.score([[2.0]])) for name in found]
    [False, True]
    """
    points = pooled.points_of(X)
    labels = _labels(categories, len(points))
    names = np.unique(labels).tolist()
    rows = _Rows(pooled, points, labels, sample_weight, groups)
    tell = progress or silent
    total, done = FOLDS + sum(rows.folds_of(name) + 1 for name in names), 0

    def step(what: str) -> None:
        nonlocal done
        tell(done / total, what)
        done += 1

    found: dict[str, CategoryDensity] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)  # the fit to all rows has said them
        for name in names:
            found[name] = rows.category(name, step)
    return found


def _labels(categories: ArrayLike, rows: int) -> NDArray[np.str_]:
    """Return the category (N,) of each row as a word."""
    found = np.asarray(categories)
    if found.shape != (rows,):
        raise OrbiflowError(
            f"categories: expected one for each of {rows} rows, got {described(categories)}"
        )
    found = found.astype(str)
    count = len(np.unique(found))
    if not 2 <= count <= MOST_CATEGORIES:
        raise OrbiflowError(
            f"categories: expected 2 to {MOST_CATEGORIES} different ones, got {count}; choose a column "
            "whose words say what kind a row is of"
        )
    return found


class _Rows:
    """Rows, what each is of, and the densities of all of them, each without a part of the rows."""

    def __init__(
        self,
        pooled: DensityEstimator,
        points: Tensor,
        labels: NDArray[np.str_],
        weights: ArrayLike | None,
        groups: ArrayLike | None,
    ) -> None:
        self.pooled, self.points, self.labels = pooled, points, labels
        self.settings = pooled.settings()
        self.weights = None if weights is None else np.asarray(weights, dtype=np.float64)
        self.groups = None if groups is None else group_numbers(groups, len(labels))
        self.fold = self._folds()
        self.without: dict[int, Density] = {}

    def _folds(self) -> NDArray[np.int64]:
        """Return the part (N,) in which each row is held out, whole groups in one."""
        rng = np.random.default_rng(self.settings.seed)
        if self.groups is not None:
            return rng.permutation(int(self.groups.max()) + 1)[self.groups] % FOLDS
        fold = np.empty(len(self.labels), dtype=np.int64)
        for name in np.unique(self.labels):
            own = np.flatnonzero(self.labels == name)
            fold[own] = rng.permutation(len(own)) % FOLDS
        return fold

    def folds_of(self, name: str) -> int:
        """Return how many parts are held out in turn to judge a category."""
        return min(FOLDS, math.ceil(ENOUGH_HELD * FOLDS / int((self.labels == name).sum())))

    def fit(self, chosen: NDArray[np.bool_]) -> Density:
        """Return the density of some rows (N,)."""
        how: dict[str, Any] = {"missing": self.pooled.missing}
        how["weights"] = None if self.weights is None else self.weights[chosen]
        how["groups"] = None if self.groups is None else self.groups[chosen]
        kept = self.points[torch.as_tensor(chosen)]
        return fit_chosen(self.pooled.space_, kept, self.settings, **how)[0]

    def pooled_without(self, fold: int, step: Callable[[str], None]) -> Density:
        """Return the density of all rows but those of a part."""
        if fold not in self.without:
            step(f"all without part {fold + 1} of {FOLDS}")
            self.without[fold] = self.fit(self.fold != fold)
        return self.without[fold]

    def category(self, name: str, step: Callable[[str], None]) -> CategoryDensity:
        """Return the density of a category; each fit is a `step`."""
        own = self.labels == name
        tables: list[Tensor] = []
        held: list[int] = []
        rest = [self.pooled_without(fold, step) for fold in range(self.folds_of(name))]
        try:
            for fold, pooled in enumerate(rest):
                step(f"{name} without part {fold + 1} of {len(rest)}")
                chosen = np.flatnonzero(own & (self.fold == fold))
                if not len(chosen):
                    continue
                alone = self.fit(own & (self.fold != fold))
                points = self.points[torch.as_tensor(chosen)]
                with torch.no_grad():
                    logs = [at_observed(one, points) for one in (alone, pooled)]
                tables.append(torch.stack(logs).double())
                held.extend(chosen.tolist())
            step(name)
            if not held or (self.weights is not None and not self.weights[held].any()):
                raise OrbiflowError("none of its rows can be held out")
            alone = self.fit(own)
        except OrbiflowError as error:
            estimator = self._estimator(Mixture([self.pooled.density_], [1.0]))
            return CategoryDensity(estimator, int(own.sum()), 0.0, note=str(error))
        table = torch.cat(tables, dim=1)
        counts = None if self.weights is None else torch.as_tensor(self.weights[held])
        weight = shared_weight(table, counts)
        both = torch.tensor([weight, 1 - weight], dtype=torch.float64)
        gains = stacked(table, both) - table[1]
        gain = mean_of(gains, counts)
        error = float(gains.std()) / math.sqrt(len(gains)) if len(gains) > 1 else None
        density = Mixture([alone, self.pooled.density_], both)
        return CategoryDensity(self._estimator(density), int(own.sum()), weight, gain, error)

    def _estimator(self, density: Density) -> DensityEstimator:
        """Return an estimator of a density with the names and settings of that of all rows."""
        names = getattr(self.pooled, "feature_names_in_", None)
        params = {key: v for key, v in self.pooled.get_params().items() if key != "space"}
        columns = None if names is None else [str(one) for one in names]
        return DensityEstimator.fitted(density, columns=columns, **params)


def shared_weight(table: Tensor, counts: Tensor | None = None) -> float:
    """Return the weight of the first of two densities, by their logs (2, N) at rows held out.

    One row more that only the first explains, and one that only the second does, keep it from 0 and
    1: the mode under a Beta(2, 2) prior.

    >>> shared_weight(torch.zeros(2, 5)), round(shared_weight(torch.tensor([[0.0], [-99.0]])), 3)
    (0.5, 0.667)
    """
    ends = torch.tensor([[0.0, -math.inf], [-math.inf, 0.0]], dtype=torch.float64)
    rows = None
    if counts is not None:
        rows = torch.cat([counts / counts.mean(), torch.ones(2, dtype=torch.float64)])
    weights = stacking_weights(torch.cat([table.double(), ends], dim=1), rows)
    return float(weights[0])
