"""The rows of a cross-validation and their splits, as the bytes that travel to each fit."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.batch import code_of
from orbiflow.density.comparing import cross_validation_folds
from orbiflow.density.cross_validation.operations import CrossValidation
from orbiflow.density.fitting import LEAST_PLACES, places, weighed
from orbiflow.density.inference import chart_of_observed
from orbiflow.density.operations import COLUMNS
from orbiflow.density.spaces import Space, space_class
from orbiflow.density.tables import Table, TableRows, Unit, angle_unit, read_rows
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.runtime import Note, Sink

MOST_BYTES = 256 * 2**20
"""The largest size of a table, which travels once for each fit."""


@dataclass(frozen=True, eq=False)
class CvRows:
    """The rows of a table that count.

    - `table`: N rows, in the data's own units.
    - `weights`: How much each counts, (N,); None if all count the same.
    - `labels`: The group of each row, (N,); None if there are none.
    - `together`: A label for each row, (N,); rows of one label are on one side of every split.
    - `space`, `unit`: Those of the whole table, for its measure; no fit sees them.
    """

    table: Table
    weights: Array | None
    labels: NDArray[np.str_] | None
    together: NDArray[Any] | None
    space: Space
    unit: Unit

    @cached_property
    def whole(self) -> NDArray[np.bool_]:
        """Which rows lack nothing: the density of others is in another unit."""
        found = np.logical_and.reduce(np.isfinite(self.table.values), axis=1)
        return found if found.any() else np.ones_like(found)


@dataclass(frozen=True, eq=False)
class Split:
    """A table whose last column numbers the fold of each row, from 1: what all fits of a split read.

    Its columns are those that are fitted, the weights and groups if there are any, and the folds, as
    numbers: smaller than most files, and the same bytes whatever else the file says.

    - `fold`: The fold of each row, (N,), from 1.
    """

    rows: CvRows
    fold: NDArray[np.int64]
    name: str = "rows.npy"

    def read(self) -> bytes:
        """Return the bytes, made anew each time: many splits would be many tables."""
        parts = [self.rows.table.values]
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

    def code(self) -> str:
        """Return what the same rows in the same folds are known by."""
        return self._code

    @cached_property
    def _code(self) -> str:
        return code_of(self.read())


@dataclass(frozen=True)
class Fit:
    """One of many fits.

    - `split`, `fold`: Their numbers, from 1.
    - `setting`, `components`: The name of the setting, and its components.
    """

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
    width = COLUMNS.get(asked.where.space)
    rows = _counting(read_rows(asked.data, asked.rows, tell, width=width, group=asked.group))
    table = rows.table
    unit = angle_unit(asked.where.space, asked.where.unit, table, tell)
    space = space_class(asked.where.space).for_data(
        table.values, unit=unit, seed=asked.density.seed
    )
    marginalise = asked.rows.missing == "marginalise"
    points = chart_of_observed(space, table.values) if marginalise else space.to_chart(table.values)
    counts, place = places(points)
    if len(counts) <= LEAST_PLACES:
        raise OrbiflowError(
            f"{asked.data}: {len(counts)} different rows; a cross-validation needs more than the "
            f"{LEAST_PLACES} that a density needs"
        )
    labels = rows.labels()
    together: NDArray[Any] | None = labels
    if asked.density.repeats == "rounding" and labels is None:
        together = place.numpy()
    elif asked.density.repeats == "rounding":
        tell(Note("groups are kept together; equal rows of different groups may be on both sides"))
    return CvRows(table, rows.weights, labels, together, space, unit)


def _counting(rows: TableRows) -> TableRows:
    """The same without the rows of weight 0, which count for nothing."""
    table, weights = rows.table, rows.weights
    if weights is None:
        return rows
    weighed(torch.zeros(len(weights), 1), weights)  # refuses what is no weight
    kept = weights > 0
    kept_table = replace(
        table,
        values=table.values[kept],
        lines=table.lines[kept],
        dropped=table.dropped | frozenset(table.lines[~kept].tolist()),
    )
    return replace(rows, table=kept_table, weights=weights[kept])


def splits_of(asked: CrossValidation, rows: CvRows) -> list[Split]:
    """Return the splits."""
    count, seed = len(rows.table.values), asked.density.seed
    return [
        Split(
            rows,
            1
            + cross_validation_folds(
                count, asked.cv.folds, together=rows.together, seed=seed, split=number
            ),
        )
        for number in range(asked.cv.times)
    ]


def fits_of(asked: CrossValidation) -> Iterator[Fit]:
    """Yield all settings of a fold, then those of the next, so that the first pairs come early."""
    for split in range(1, asked.cv.times + 1):
        for fold in range(1, asked.cv.folds + 1):
            for setting, components in asked.settings.items():
                yield Fit(split, fold, setting, components)
