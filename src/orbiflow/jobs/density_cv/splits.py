"""The splits of a cross-validation: which rows a fit is given, as the bytes that travel to it."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orbiflow.density import cross_validation_folds
from orbiflow.errors import InputFileError
from orbiflow.jobs.batch.inputs import code_of
from orbiflow.jobs.batch.items import Item
from orbiflow.jobs.density_cv.rows import CvRows
from orbiflow.jobs.density_cv_requests import DensityCvRequest, DensityFoldRequest

MOST_BYTES = 256 * 2**20
"""Of a table that travels, once for each fit."""


@dataclass(frozen=True, eq=False)
class Split:
    """A table whose last column says the fold of each row, from 1: what all fits of a split read.

    The columns that are fitted to, the weights and groups if there are any, and the folds, as numbers:
    smaller than most files, read without a thought, and the same bytes whatever else the file says.

    - `fold`: (N,) from 1.
    """

    rows: CvRows
    fold: NDArray[np.int64]
    name: str = "rows.npy"

    def read(self) -> bytes:
        """Made anew each time: many splits would be many tables."""
        parts = [self.rows.table.values]
        if self.rows.weights is not None:
            parts.append(self.rows.weights[:, None])
        if self.rows.labels is not None:
            parts.append(
                np.unique(self.rows.labels, return_inverse=True)[1]
                .reshape(-1, 1)
                .astype(np.float64)
            )
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
        """By which the same rows in the same folds are known."""
        return self._code

    @cached_property
    def _code(self) -> str:
        return code_of(self.read())


@dataclass(frozen=True)
class Fit:
    """One of many.

    - `split`, `fold`: from 1. `setting`: its name.
    """

    split: int
    fold: int
    setting: str
    parts: tuple[str, ...] | None

    @property
    def key(self) -> str:
        """By which the journal knows it."""
        return f"{self.setting} {self.split}.{self.fold}"

    @property
    def name(self) -> str:
        """Of its folder."""
        return f"folds/{self.setting}-{self.split}-{self.fold:02d}"


def splits_of(request: DensityCvRequest, rows: CvRows) -> list[Split]:
    """
    Raises:
        OrbiflowError: if there are fewer rows or groups than folds.
    """
    return [
        Split(
            rows,
            1
            + cross_validation_folds(
                len(rows.table.values),
                request.folds,
                together=rows.together,
                seed=request.seed,
                split=number,
            ),
        )
        for number in range(request.times)
    ]


def fits_of(request: DensityCvRequest) -> Iterator[Fit]:
    """All settings of a fold, then the next fold: the first pairs come early."""
    for split in range(1, request.times + 1):
        for fold in range(1, request.folds + 1):
            for setting, parts in request.settings().items():
                yield Fit(split, fold, setting, parts)


def item_of(fit: Fit, request: DensityCvRequest, split: Split) -> Item:
    """A fit as the machinery of batches takes it."""
    angles = len(split.rows.table.columns)
    weighted = split.rows.weights is not None
    grouped = split.rows.labels is not None
    one = DensityFoldRequest(
        data=Path(split.name),
        space=request.space,
        fold=fit.fold,
        columns=tuple(str(k + 1) for k in range(angles)),
        held=str(angles + weighted + grouped + 1),
        weights=str(angles + 1) if weighted else None,
        # a flow alone has no parts to choose
        group=str(angles + weighted + 1) if grouped and fit.parts != ("flow",) else None,
        missing="marginalise" if request.missing == "marginalise" else "refuse",
        # said, so that it does not depend on the rows that a fit sees
        unit=split.rows.unit if request.space in ("torus", "klein-bottle") else None,
        parts=fit.parts,
        repeats=request.repeats,
        seed=request.seed,
    )
    return Item(fit.key, fit.name, one, split)
