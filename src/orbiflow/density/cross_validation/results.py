"""What the fits found: log densities of rows that they had not seen, and what these say."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.batch import Entry
from orbiflow.density.comparing import ComparisonSettings, ModelComparison, compare_scores
from orbiflow.density.cross_validation.fold import SCORES
from orbiflow.density.cross_validation.operations import UNIFORM, CrossValidation
from orbiflow.density.cross_validation.splits import Fit, Split
from orbiflow.density.tables import read_table
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import one_blas_thread

COLUMNS = ("row", "log_prob")


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Log densities in nats and natural measure, each by a fit that had not seen the row.

    - `settings`: The names of S settings.
    - `scores`: By setting, split and row, (S, T, N); NaN where there is none yet.
    """

    settings: tuple[str, ...]
    scores: Array

    @property
    def common(self) -> NDArray[np.bool_]:
        """Where every setting has a score, (T, N), so that they are compared at the same rows."""
        return np.logical_and.reduce(np.isfinite(self.scores), axis=0)

    def means(self) -> Array:
        """Return the mean of each row over the splits where every setting has scored it, (S, N).

        It is NaN if there is none. More splits are no more rows: they take away the chance of one
        split, and the uncertainty is that of N rows.
        """
        counts = self.common.sum(axis=0)
        sums = np.where(self.common, self.scores, 0.0).sum(axis=1)
        return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)

    def fold_means(self, split: Split, number: int, rows: NDArray[np.bool_]) -> dict[int, Array]:
        """Return the weighted means (S,) of each fold of a split over the `rows` (N,) that count."""
        weights = np.ones(len(rows)) if split.rows.weights is None else split.rows.weights
        found: dict[int, Array] = {}
        for fold in range(1, int(split.fold.max()) + 1):
            chosen = (split.fold == fold) & self.common[number] & rows
            if chosen.any():
                found[fold] = (
                    self.scores[:, number, chosen] @ weights[chosen] / weights[chosen].sum()
                )
        return found


def held_out(
    folder: Path,
    entries: Mapping[str, Entry],
    fits: Sequence[Fit],
    splits: Sequence[Split],
    settings: Sequence[str],
) -> HeldOut:
    """Return what is in the folders of the fits that are done."""
    rows = splits[0].rows
    scores = np.full((len(settings), len(splits), len(rows.table.values)), np.nan)
    for fit in fits:
        entry = entries.get(fit.key)
        if entry is None or entry.state != "done":
            continue
        held = np.flatnonzero(splits[fit.split - 1].fold == fit.fold)
        found = _read(folder / entry.name / SCORES, held)
        scores[settings.index(fit.setting), fit.split - 1, held] = found
    if UNIFORM in settings:
        scores[settings.index(UNIFORM)] = -math.log(rows.space.volume)
    return HeldOut(tuple(settings), scores)


def _read(path: Path, held: NDArray[np.int64]) -> Array:
    """The log densities of the rows of these numbers, from 0."""
    table = read_table(path, columns=COLUMNS, width=2)
    if not np.array_equal(table.values[:, 0], held + 1):
        raise OrbiflowError(
            f"{path} is not of the rows that were held out: delete its folder, and the same command "
            "fits it again"
        )
    return table.values[:, 1]


@one_blas_thread()  # sums of several threads differ in their last digits
def compared(asked: CrossValidation, found: HeldOut, split: Split) -> ModelComparison | str:
    """Compare settings at all rows that every one of them has scored, or return why this cannot be."""
    means = found.means()
    chosen = ~np.isnan(means).any(axis=0) & split.rows.whole
    labels, weights = split.rows.labels, split.rows.weights
    try:
        made = compare_scores(
            {name: means[k, chosen] for k, name in enumerate(found.settings)},
            ComparisonSettings(
                bootstrap=asked.cv.bootstrap, level=asked.cv.level, seed=asked.density.seed
            ),
            groups=None if labels is None else labels[chosen],
            weights=None if weights is None else weights[chosen],
        )
    except OrbiflowError as error:
        return str(error)
    count, scored = int(split.rows.whole.sum()), int(chosen.sum())
    if scored == count:
        return made
    note = f"{scored} of {count} rows so far: fits are missing"
    return replace(made, notes=(note, *made.notes))


@dataclass(frozen=True)
class Spread:
    """How much a figure differs from fold to fold.

    - `deviation`: The standard deviation of the folds' means.
    - `folds`: The number of folds.
    """

    deviation: float
    folds: int

    @classmethod
    def of(cls, means: Sequence[float]) -> Spread | None:
        """Return the spread of means, None for fewer than two."""
        if len(means) < 2:
            return None
        return cls(float(np.std(means, ddof=1)), len(means))

    def to_json(self) -> dict[str, Any]:
        """Return the spread as JSON has it."""
        return {"deviation": self.deviation, "folds": self.folds}
