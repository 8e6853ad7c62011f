"""The files of a cross-validation: a line for each fold and row, the comparison, the page."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from orbiflow import __version__
from orbiflow.arrays import Array
from orbiflow.batch import Entry, csv_bytes
from orbiflow.density.comparing import ModelComparison
from orbiflow.density.cross_validation.operations import CrossValidation
from orbiflow.density.cross_validation.page import cv_page
from orbiflow.density.cross_validation.results import HeldOut, Spread, compared, held_out
from orbiflow.density.cross_validation.splits import Fit, Split
from orbiflow.density.tables import append_columns
from orbiflow.errors import InputFileError

TABLE, ROWS, REPORT, PAGE = "cv.csv", "rows.csv", "report.json", "index.html"
FIGURES = ("rows", "fitted", "log_likelihood")


@dataclass(eq=False)
class CvOverview:
    """Files that are written anew as fits come; the comparison once nothing more comes.

    - `comparison`: The last comparison, or why there is none.
    """

    journal: ClassVar[str] = "cv.jsonl"
    what: ClassVar[str] = "cross-validation"

    asked: CrossValidation
    fits: Sequence[Fit]
    splits: Sequence[Split]
    comparison: ModelComparison | str = field(default="no fit is done yet", init=False)

    def __post_init__(self) -> None:
        self._stamp = _stamp(self.asked.data)

    def files(
        self,
        entries: Sequence[Entry],
        waiting: int,
        pictures: frozenset[str],  # noqa: ARG002
        *,
        last: bool,
    ) -> Mapping[str, bytes | None]:
        """Return `cv.csv` and `index.html`; with the last ones `rows.csv` and `report.json`."""
        by_key = {entry.file: entry for entry in entries}
        done = [(fit, by_key[fit.key]) for fit in self.fits if fit.key in by_key]
        found = held_out(self.asked.out, by_key, self.fits, self.splits, self.asked.names)
        if last:
            self.comparison = compared(self.asked, found, self.splits[0])
        elif not isinstance(self.comparison, str):
            self.comparison = "fits are missing"
        page = cv_page(self.asked, self.splits, found, self.comparison, done, waiting)
        files: dict[str, bytes | None] = {TABLE: _table(done), PAGE: page}
        if last:
            files[ROWS] = self._rows(found)
            files[REPORT] = self._report(found, done, waiting)
        return files

    def _rows(self, found: HeldOut) -> bytes | None:
        """The table with the fold of each row and its log density by each setting."""
        means, data = found.means(), self.asked.data
        if np.isnan(means).all():
            return None
        if _stamp(data) != self._stamp:
            raise InputFileError(
                f"{data} changed while it was cross-validated; run the same command again"
            )
        added: dict[str, Array] = {}
        for number, split in enumerate(self.splits, start=1):
            name = "fold" if len(self.splits) == 1 else f"fold_{number}"
            added[name] = split.fold.astype(np.float64)
        for name, column in zip(found.settings, means, strict=True):
            added[f"log_prob_{name}"] = column
        return append_columns(self.splits[0].rows.table, data, added)

    def _report(self, found: HeldOut, done: Sequence[tuple[Fit, Entry]], waiting: int) -> bytes:
        rows = self.splits[0].rows
        states = [entry.state for _, entry in done]
        comparison = self.comparison
        document: dict[str, Any] = {
            "kind": "cross-validation",
            "version": __version__,
            "data": str(self.asked.data),
            "space": {"name": rows.space.name, "unit": rows.space.unit},
            "columns": list(rows.table.columns),
            "settings": self._settings,
            "components": self.asked.settings,
            "rows": len(rows.table.values),
            "groups": None if rows.labels is None else len(np.unique(rows.labels)),
            "uniform": -math.log(rows.space.volume),
            "fits": {
                "all": len(self.fits),
                "done": states.count("done"),
                "failed": states.count("failed"),
                "left": waiting,
            },
            "comparison": None if isinstance(comparison, str) else comparison.to_json(),
            "why_no_comparison": comparison if isinstance(comparison, str) else None,
            "folds": self._spreads(found),
        }
        return json.dumps(document, allow_nan=False, indent=1).encode()

    @cached_property
    def _settings(self) -> dict[str, Any]:
        """What was asked for, as the report tells it."""
        cv, rows, density = self.asked.cv, self.asked.rows, self.asked.density
        return {
            "folds": cv.folds,
            "times": cv.times,
            "group": self.asked.group,
            "missing": rows.missing,
            "weights": rows.weights,
            "repeats": density.repeats,
            "level": cv.level,
            "bootstrap": cv.bootstrap,
            "seed": density.seed,
        }

    def _spreads(self, found: HeldOut) -> dict[str, Any]:
        """How much folds differ, by setting."""
        whole = self.splits[0].rows.whole
        means = [
            mean
            for number, split in enumerate(self.splits)
            for mean in found.fold_means(split, number, whole).values()
        ]
        spreads = {
            name: Spread.of([float(mean[k]) for mean in means])
            for k, name in enumerate(found.settings)
        }
        return {name: None if one is None else one.to_json() for name, one in spreads.items()}


def _table(done: Sequence[tuple[Fit, Entry]]) -> bytes:
    """A line for each fit that has finished."""
    heads = ["split", "fold", "setting", "state", *FIGURES, "seconds", "error", "folder"]
    return csv_bytes(heads, (list(_cells(fit, entry)) for fit, entry in done))


def _cells(fit: Fit, entry: Entry) -> Iterator[Any]:
    yield from (fit.split, fit.fold, fit.setting, entry.state)
    yield from ("" if (v := entry.best.get(name)) is None else repr(v) for name in FIGURES)
    yield "" if entry.seconds is None else f"{entry.seconds:.3f}"
    yield from (entry.reason, "" if entry.state == "failed" else entry.name)


def _stamp(path: Path) -> tuple[int, int] | None:
    """What a change of a file is noticed by."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_size, found.st_mtime_ns
