"""The work of a cross-validation, and its files: folds, rows, the comparison, the page."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from orbiflow import __version__, batch, runtime
from orbiflow.arrays import Array
from orbiflow.density.comparing import ModelComparison
from orbiflow.density.cross_validation.fold import written_files
from orbiflow.density.cross_validation.operations import CrossValidation
from orbiflow.density.cross_validation.page import cv_page
from orbiflow.density.cross_validation.splits import (
    Fit,
    HeldOut,
    Split,
    compared,
    cv_rows,
    fits_of,
    held_out,
    splits_of,
)
from orbiflow.density.tables import append_columns
from orbiflow.errors import InputFileError

TABLE, ROWS, REPORT, PAGE = "cv.csv", "rows.csv", "report.json", "index.html"
FIGURES = ("rows", "fitted", "log_likelihood")


@dataclass(eq=False)
class CvOverview:
    """Files that are written anew as fits come; the comparison, or why there is none, at the end."""

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
        entries: Sequence[batch.Entry],
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

    def _report(
        self, found: HeldOut, done: Sequence[tuple[Fit, batch.Entry]], waiting: int
    ) -> bytes:
        rows, cv, density = self.splits[0].rows, self.asked.cv, self.asked.density
        states = [entry.state for _, entry in done]
        comparison = self.comparison
        document: dict[str, Any] = {
            "kind": "cross-validation",
            "version": __version__,
            "data": str(self.asked.data),
            "space": {"name": rows.space.name, "unit": rows.space.unit},
            "columns": list(rows.table.columns),
            "settings": {
                "folds": cv.folds,
                "times": cv.times,
                "group": self.asked.group,
                "missing": self.asked.rows.missing,
                "weights": self.asked.rows.weights,
                "repeats": density.repeats,
                "level": cv.level,
                "bootstrap": cv.bootstrap,
                "seed": density.seed,
            },
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

    def _spreads(self, found: HeldOut) -> dict[str, Any]:
        """How much folds differ, by setting."""
        means = [mean for *_, mean in found.fold_means(self.splits)]
        columns = {name: [mean[k] for mean in means] for k, name in enumerate(found.settings)}
        return {
            name: {"deviation": float(np.std(column, ddof=1)), "folds": len(column)}
            if len(column) > 1
            else None
            for name, column in columns.items()
        }


def _table(done: Sequence[tuple[Fit, batch.Entry]]) -> bytes:
    """A line for each fit that has finished."""
    heads = ["split", "fold", "setting", "state", *FIGURES, "seconds", "error", "folder"]
    return batch.csv_bytes(heads, (list(_cells(fit, entry)) for fit, entry in done))


def _cells(fit: Fit, entry: batch.Entry) -> Iterator[Any]:
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


def _figures(summary: batch.Summary) -> dict[str, Any]:
    return {name: summary[name] for name in ("rows", "fitted", "log_likelihood")}


FITS = batch.Kind(
    things="fits",
    items="fits",
    reads="data",
    writes="out",
    modules=("orbiflow.density.cross_validation.fold",),
    columns=(batch.Column("log_likelihood", "held out", ".4f"), batch.Column("rows", "rows", "d")),
    best=_figures,
    picture=lambda _summary: None,
    written=written_files,
)


def run(
    asked: CrossValidation, work: batch.WorkSettings, tell: runtime.Sink, cancel: runtime.Cancel
) -> runtime.Outcome:
    """Do the fits that have not been done, then compare what they say of unseen rows."""
    begin = time.perf_counter()
    out = asked.out
    runtime.check_outside_runs(out, asked.data)
    for name in (TABLE, ROWS, REPORT, PAGE):
        runtime.check_inputs_kept(out / name, asked.data)
    with runtime.one_thread():
        rows = cv_rows(asked, tell)
    splits = splits_of(asked, rows)
    fits = list(fits_of(asked))
    items = [_item(fit, asked, splits[fit.split - 1]) for fit in fits]
    overview = CvOverview(asked, fits, splits)
    with batch.BatchFolder(out, FITS, overview) as folder:
        counts = batch.run_items(
            items, work, folder, tell, cancel, gone="of other folds or settings"
        )
    found = overview.comparison
    words = [f"no comparison: {found}"] if isinstance(found, str) else found.words()
    notes = () if isinstance(found, str) else found.notes
    for text in (*words, *notes):
        tell(runtime.Note(text))
    summary = {
        "folder": str(out),
        "table": str(out / TABLE),
        "rows": str(out / ROWS),
        "report": str(out / REPORT),
        "page": str(out / PAGE),
        "fits": len(fits),
        "comparison": None if isinstance(found, str) else found.to_json(),
        "seconds": time.perf_counter() - begin,
    }
    return counts.outcome(len(fits), out / TABLE, out / PAGE, summary, tell)


def _item(fit: Fit, asked: CrossValidation, split: Split) -> batch.Item:
    """A fit as batches take it; all that decides it is said, so that the rows do not."""
    angles = len(split.rows.table.columns)
    weighted, grouped = split.rows.weights is not None, split.rows.labels is not None
    density, space = asked.density, asked.where.space
    given: dict[str, Any] = {
        "data": Path(split.name),
        "space": space,
        "fold": fit.fold,
        "columns": tuple(str(k + 1) for k in range(angles)),
        "held": str(angles + weighted + grouped + 1),
        "weights": str(angles + 1) if weighted else None,
        # a flow alone has no components to choose
        "group": str(angles + weighted + 1) if grouped and fit.components != ("flow",) else None,
        "missing": "marginalise" if asked.rows.missing == "marginalise" else "refuse",
        "unit": split.rows.unit if space in ("torus", "klein-bottle") else None,
        "components": fit.components,
        "repeats": density.repeats,
        "seed": density.seed,
    }
    call = runtime.find("density fold").call({k: v for k, v in given.items() if v is not None})
    return batch.Item(fit.key, fit.name, call, split)
