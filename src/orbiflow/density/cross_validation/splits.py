"""The rows of a cross-validation, their splits, and the scores of rows that fits had not seen."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.batch import Entry
from orbiflow.density import comparing, operations
from orbiflow.density.cross_validation.settings import SCORES, UNIFORM, CrossValidation
from orbiflow.density.data import TableRows
from orbiflow.density.fitting import LEAST_PLACES, places, weighed
from orbiflow.density.inference import chart_of_rows, uniform_logs
from orbiflow.density.spaces import Space
from orbiflow.density.tables import read_rows
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.runtime import Note, Sink, one_blas_thread

MOST_BYTES = 256 * 2**20
"""The largest size of a table, which travels once for each fit."""


@dataclass(frozen=True, eq=False)
class CvRows(TableRows):
    """The rows of a table that count.

    - `together`: A label for each row, (N,); rows of one label are on one side of every split.
    - `space`: That of the whole table, for its measure; no fit sees it.
    """

    together: NDArray[Any] | None = None
    space: Space = field(kw_only=True)


@dataclass(frozen=True, eq=False)
class Split:
    """A table whose last column numbers the fold of each row, from 1: what all fits of a split read.

    Its columns are those that are fitted, the weights and groups if there are any, and the folds, as
    numbers: smaller than most files, and the same bytes whatever else the file says.

    - `fold`: The fold of each row, (N,), from 1.
    """

    rows: CvRows
    fold: NDArray[np.int64]

    def read(self) -> bytes:
        """Return the bytes, made anew each time: many splits would be many tables."""
        parts = [self.rows.values]
        if self.rows.weights is not None:
            parts.append(self.rows.weights[:, None])
        if self.rows.labels is not None:
            numbers = np.unique(self.rows.labels, return_inverse=True)[1]
            parts.append(numbers.reshape(-1, 1).astype(np.float64))
        parts.append(self.fold[:, None].astype(np.float64))
        size = 8 * sum(part.size for part in parts)
        if size > MOST_BYTES:
            raise InputFileError(
                f"{len(self.fold)} rows are {size / 2**20:.0f} MB of numbers, more than the "
                f"{MOST_BYTES / 2**20:.0f} MB that travel to a worker: draw a sample of them"
            )
        file = io.BytesIO()
        np.save(file, np.concatenate(parts, axis=1), allow_pickle=False)
        return file.getvalue()


@dataclass(frozen=True)
class Fit:
    """One of many fits: its split and fold, from 1, and the components of its setting."""

    split: int
    fold: int
    setting: str
    components: tuple[str, ...] | None

    @property
    def key(self) -> str:
        """What the journal knows it by."""
        return f"{self.setting} {self.split}.{self.fold}"

    @property
    def name(self) -> str:
        """The name of its folder."""
        return f"folds/{self.setting}-{self.split}-{self.fold:02d}"


def cv_rows(asked: CrossValidation, tell: Sink) -> CvRows:
    """Return the rows of the table that count."""
    where = asked.density
    rows = read_rows(asked.data, asked.rows, tell, where=where)
    tell(Note(f"columns: {rows.declaration}"))
    if rows.weights is not None:
        weighed(torch.zeros(len(rows.weights), 1), rows.weights)  # refuses what is no weight
        rows = rows.only(rows.weights > 0)  # others count for nothing
    space = operations.columns_of(where, rows, asked.density.seed).of(rows)
    may_lack = asked.rows.missing == "marginalise"
    counts, place = places(chart_of_rows(space, rows.values, may_lack=may_lack))
    if len(counts) <= LEAST_PLACES:
        raise OrbiflowError(
            f"{asked.data}: {len(counts)} different rows; a cross-validation needs more than the "
            f"{LEAST_PLACES} that a density needs"
        )
    together: NDArray[Any] | None = rows.labels
    if together is None and len(np.unique(rows.numbers)) < len(rows.numbers):
        together = rows.numbers  # rows that were counted are one
    if asked.density.repeats == "rounding" and together is None:
        together = place.numpy()
    elif asked.density.repeats == "rounding":
        tell(Note("groups are kept together; equal rows of different groups may be on both sides"))
    parts = {field.name: getattr(rows, field.name) for field in fields(rows)}
    return CvRows(**parts, together=together, space=space)


def splits_of(asked: CrossValidation, rows: CvRows) -> list[Split]:
    """Return the splits."""
    count, folds, seed = len(rows.values), asked.cv.folds, asked.density.seed
    numbers = [
        comparing.cross_validation_folds(count, folds, together=rows.together, seed=seed, split=k)
        for k in range(asked.cv.times)
    ]
    return [Split(rows, 1 + fold) for fold in numbers]


def fits_of(asked: CrossValidation) -> Iterator[Fit]:
    """Yield all settings of a fold, then those of the next, so that the first pairs come early."""
    for split in range(1, asked.cv.times + 1):
        for fold in range(1, asked.cv.folds + 1):
            for setting, components in asked.settings.items():
                yield Fit(split, fold, setting, components)


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

    def fold_means(self, splits: Sequence[Split]) -> list[Array]:
        """Return the weighted means (S,) of the whole, common rows of each fold."""
        rows, common = splits[0].rows, self.common
        weights = np.ones(len(rows.whole)) if rows.weights is None else rows.weights
        means: list[Array] = []
        for number, split in enumerate(splits):
            for fold in range(1, int(split.fold.max()) + 1):
                chosen = (split.fold == fold) & common[number] & rows.whole
                if chosen.any():
                    sums = self.scores[:, number, chosen] @ weights[chosen]
                    means.append(sums / weights[chosen].sum())
        return means


def held_out(
    folder: Path,
    entries: Mapping[str, Entry],
    fits: Sequence[Fit],
    splits: Sequence[Split],
    settings: Sequence[str],
) -> HeldOut:
    """Return what is in the folders of the fits that are done."""
    rows = splits[0].rows
    scores = np.full((len(settings), len(splits), len(rows.values)), np.nan)
    for fit in fits:
        entry = entries.get(fit.key)
        if entry is None or entry.state != "done":
            continue
        held = np.flatnonzero(splits[fit.split - 1].fold == fit.fold)
        logs = _read(folder / entry.name / SCORES, held)
        scores[settings.index(fit.setting), fit.split - 1, held] = logs
    if UNIFORM in settings:
        scores[settings.index(UNIFORM)] = uniform_logs(rows.space, rows.values).numpy()
    return HeldOut(tuple(settings), scores)


def _read(path: Path, held: NDArray[np.int64]) -> Array:
    """Return the log densities of the rows of these numbers, from 0."""
    try:
        table = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
    except (OSError, ValueError) as error:
        raise InputFileError(
            f"cannot read {path} ({error}): delete its folder, and the same command fits it again"
        ) from error
    if table.shape[1:] != (2,) or not np.array_equal(table[:, 0], held + 1):
        raise OrbiflowError(
            f"{path} is not of the rows that were held out: delete its folder, and the same command "
            "fits it again"
        )
    return table[:, 1]


@one_blas_thread()  # sums of several threads differ in their last digits
def compared(
    asked: CrossValidation, found: HeldOut, split: Split
) -> comparing.ModelComparison | str:
    """Compare settings at all rows that every one of them has scored, or return why this cannot be."""
    means = found.means()
    chosen = ~np.isnan(means).any(axis=0) & split.rows.whole
    labels, weights = split.rows.labels, split.rows.weights
    try:
        made = comparing.compare_scores(
            {name: means[k, chosen] for k, name in enumerate(found.settings)},
            comparing.ComparisonSettings(
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
