"""The files of a cross-validation: a line a fold, a line a row, the comparison, the page."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from orbiflow import __version__
from orbiflow.arrays import Array
from orbiflow.density import ModelComparison, append_columns
from orbiflow.errors import InputFileError
from orbiflow.jobs.batch.journal import Entry
from orbiflow.jobs.density_cv.page import PageOf, cv_page
from orbiflow.jobs.density_cv.results import (
    HeldOut,
    Spread,
    compared,
    held_out,
)
from orbiflow.jobs.density_cv.splits import Fit, Split
from orbiflow.jobs.density_cv_requests import UNIFORM, DensityCvRequest

TABLE, ROWS, REPORT, PAGE = "cv.csv", "rows.csv", "report.json", "index.html"

SAID = (
    "folds",
    "times",
    "group",
    "missing",
    "weights",
    "repeats",
    "level",
    "bootstrap",
    "seed",
)
"""Of a request, told in the report."""


@dataclass(eq=False)
class CvOverview:
    """Files that are written anew as fits come; the comparison once nothing more comes.

    - `comparison`: the last one, or why there is none.
    """

    journal: ClassVar[str] = "cv.jsonl"
    what: ClassVar[str] = "cross-validation"

    request: DensityCvRequest
    fits: Sequence[Fit]
    splits: Sequence[Split]
    comparison: ModelComparison | str = field(default="no fit is done yet", init=False)

    def __post_init__(self) -> None:
        self._stamp = _stamp(self.request.data)

    @property
    def names(self) -> list[str]:
        """Of what is compared, the setting in question first."""
        extra = [UNIFORM] if self.request.beside_uniform else []
        return [*self.request.settings(), *extra]

    def files(
        self,
        entries: Sequence[Entry],
        waiting: int,
        pictures: frozenset[str],  # noqa: ARG002
        *,
        last: bool,
    ) -> Mapping[str, bytes | None]:
        """`cv.csv` and `index.html`; with the last ones `rows.csv` and `report.json`."""
        by_key = {entry.file: entry for entry in entries}
        found = held_out(self.request.out, by_key, self.fits, self.splits, self.names)
        if last:
            self.comparison = compared(self.request, found, self.splits[0])
        elif not isinstance(self.comparison, str):
            self.comparison = "fits are missing"
        page = cv_page(
            PageOf(
                self.request,
                self.splits,
                found,
                self.comparison,
                [(fit, by_key[fit.key]) for fit in self.fits if fit.key in by_key],
                waiting,
            )
        )
        files: dict[str, bytes | None] = {TABLE: self._table(by_key), PAGE: page}
        if last:
            files[ROWS] = self._rows(found)
            files[REPORT] = self._report(found, by_key, waiting)
        return files

    def _table(self, entries: Mapping[str, Entry]) -> bytes:
        """A line a fit that is done with."""
        text = io.StringIO(newline="")
        writer = csv.writer(text, lineterminator="\n")
        figures = ("rows", "fitted", "log_likelihood")
        writer.writerow(
            ["split", "fold", "setting", "state", *figures, "seconds", "error", "folder"]
        )
        for fit in self.fits:
            if (entry := entries.get(fit.key)) is None:
                continue
            cells = ["" if (v := entry.best.get(name)) is None else repr(v) for name in figures]
            seconds = "" if entry.seconds is None else f"{entry.seconds:.3f}"
            folder = "" if entry.state == "failed" else entry.name
            head = [fit.split, fit.fold, fit.setting, entry.state]
            writer.writerow([*head, *cells, seconds, entry.reason, folder])
        return text.getvalue().encode("utf-8", "replace")

    def _rows(self, found: HeldOut) -> bytes | None:
        """The table with the fold of each row and its log density by each setting.

        Raises:
            InputFileError: if the table has changed in the meantime.
        """
        means = found.means()
        if np.isnan(means).all():
            return None
        if _stamp(self.request.data) != self._stamp:
            raise InputFileError(
                f"{self.request.data} changed while it was cross-validated; run the same command again"
            )
        added: dict[str, Array] = {}
        for number, split in enumerate(self.splits, start=1):
            name = "fold" if len(self.splits) == 1 else f"fold_{number}"
            added[name] = split.fold.astype(np.float64)
        for name, column in zip(found.settings, means, strict=True):
            added[f"log_prob_{name}"] = column
        return append_columns(self.splits[0].rows.table, self.request.data, added)

    def _report(self, found: HeldOut, entries: Mapping[str, Entry], waiting: int) -> bytes:
        rows = self.splits[0].rows
        states = [entry.state for entry in entries.values()]
        comparison = self.comparison
        document: dict[str, Any] = {
            "kind": "cross-validation",
            "version": __version__,
            "data": str(self.request.data),
            "space": {"name": rows.space.name, "unit": rows.space.unit},
            "columns": list(rows.table.columns),
            "settings": {name: getattr(self.request, name) for name in SAID},
            "parts": dict(self.request.settings()),
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


def _stamp(path: Path) -> tuple[int, int] | None:
    """By which a change of a file is noticed."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_size, found.st_mtime_ns
