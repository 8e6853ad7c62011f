"""The work of a cross-validation, and its files: folds, rows, the comparison."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from orbiflow import __version__, batch, runtime
from orbiflow.arrays import Array
from orbiflow.density.comparing import ModelComparison
from orbiflow.density.cross_validation.settings import CrossValidation, written_files
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
from orbiflow.density.inference import uniform_logs
from orbiflow.density.tables import append_columns
from orbiflow.errors import InputFileError

TABLE, ROWS, REPORT = "cv.csv", "rows.csv", "report.json"
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
        """Return `cv.csv`; at the end `rows.csv` and `report.json`, too."""
        by_key = {entry.file: entry for entry in entries}
        done = [(fit, by_key[fit.key]) for fit in self.fits if fit.key in by_key]
        files: dict[str, bytes | None] = {TABLE: _table(done)}
        if last:
            scores = held_out(self.asked.out, by_key, self.fits, self.splits, self.asked.names)
            self.comparison = compared(self.asked, scores, self.splits[0])
            files[ROWS] = self._rows(scores)
            files[REPORT] = self._report(scores, done, waiting)
        return files

    def _rows(self, found: HeldOut) -> bytes | None:
        """Return the table with the fold of each row and its log density by each setting."""
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
        return append_columns(self.splits[0].rows, added)

    def _report(
        self, found: HeldOut, done: Sequence[tuple[Fit, batch.Entry]], waiting: int
    ) -> bytes:
        task, rows, cv = self.asked, self.splits[0].rows, self.asked.cv
        states = [entry.state for _, entry in done]
        comparison = self.comparison
        document: dict[str, Any] = {
            "kind": "cross-validation",
            "version": __version__,
            "data": str(task.data),
            "space": {"name": rows.space.name, "unit": rows.space.unit},
            "columns": list(rows.columns),
            "settings": {
                **{name: getattr(cv, name) for name in ("folds", "times", "level", "bootstrap")},
                "missing": task.rows.missing,
                "columns": rows.declaration,
                **{name: getattr(task.density, name) for name in ("repeats", "effort", "seed")},
            },
            "components": task.settings,
            "rows": len(rows.values),
            "groups": None if rows.labels is None else len(np.unique(rows.labels)),
            "uniform": float(uniform_logs(rows.space, rows.values).mean()),
            "fits": {
                "all": len(self.fits),
                "done": states.count("done"),
                "failed": states.count("failed"),
                "left": waiting,
            },
            "comparison": None if isinstance(comparison, str) else runtime.to_json(comparison),
            "why_no_comparison": comparison if isinstance(comparison, str) else None,
            "folds": self._spreads(found),
        }
        return json.dumps(document, allow_nan=False, indent=1).encode()

    def _spreads(self, found: HeldOut) -> dict[str, Any]:
        """Return how much folds differ, by setting."""
        means = found.fold_means(self.splits)
        if len(means) < 2:
            return dict.fromkeys(found.settings)
        spreads = np.std(means, axis=0, ddof=1).tolist()
        return {
            name: {"deviation": spread, "folds": len(means)}
            for name, spread in zip(found.settings, spreads, strict=True)
        }


def _table(done: Sequence[tuple[Fit, batch.Entry]]) -> bytes:
    """Return a CSV with a line for each fit that has finished."""
    heads = ["split", "fold", "setting", "state", *FIGURES, "seconds", "error", "folder"]
    rows: list[list[Any]] = []
    for fit, entry in done:
        figures = [entry.best.get(name) for name in FIGURES]
        seconds = "" if entry.seconds is None else f"{entry.seconds:.3f}"
        folder = "" if entry.state == "failed" else entry.name
        rows.append([fit.split, fit.fold, fit.setting, entry.state, *figures, seconds])
        rows[-1] += [entry.reason, folder]
    return runtime.csv_bytes(heads, rows)


def _stamp(path: Path) -> tuple[int, int] | None:
    """Return what a change of a file is noticed by."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_size, status.st_mtime_ns


FITS = batch.BatchKind(
    things="fits",
    items="fits",
    reads="data",
    writes="out",
    modules=("orbiflow.density.estimator",),
    columns=(batch.Column("log_likelihood", "held out", ".4f"), batch.Column("rows", "rows", "d")),
    best=lambda summary: {name: summary[name] for name in FIGURES},
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
    files = {"table": TABLE, "rows": ROWS, "report": REPORT}
    for name in files.values():
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
    comparison = overview.comparison
    failed = isinstance(comparison, str)
    for text in [f"no comparison: {comparison}"] if failed else comparison.words():
        tell(runtime.Note(text))
    summary = {
        "folder": str(out),
        **{key: str(out / name) for key, name in files.items()},
        "fits": len(fits),
        "comparison": None if failed else runtime.to_json(comparison),
        "seconds": time.perf_counter() - begin,
    }
    return counts.outcome(len(fits), out / TABLE, out / REPORT, summary, tell)


def _item(fit: Fit, asked: CrossValidation, split: Split) -> batch.Item:
    """Return a fit as batches take it, with all that decides its result besides the rows."""
    rows, density = split.rows, asked.density
    width = len(rows.columns)
    names = rows.own_names
    columns = [
        str(k) if role is None else f"{k}={role}" for k, role in enumerate(rows.roles, start=1)
    ]
    if rows.weights is not None:
        width += 1
        columns.append(f"{width}=weight")
    if rows.labels is not None:
        width += 1
        # a flow alone has no components to choose
        columns.append(f"{width}={'ignore' if fit.components == ('flow',) else 'group'}")
    arguments: dict[str, Any] = {
        "data": Path("rows.npy"),
        "space": asked.density.space,
        "cell": asked.density.cell,
        "fractional": asked.density.fractional or None,
        "fold": fit.fold,
        "columns": tuple(columns),
        "held": str(width + 1),
        "missing": asked.rows.kept_missing,
        "unit": rows.unit if names else None,
        "form": asked.density.rotation_form(names),
        "crystal": asked.density.crystal,
        "specimen": asked.density.specimen,
        "passive": asked.density.passive or None,
        "components": fit.components,
        "repeats": density.repeats,
        "effort": density.effort,
        "seed": density.seed,
    }
    call = runtime.find("density fold").call({k: v for k, v in arguments.items() if v is not None})
    return batch.Item(fit.key, fit.name, call, split.read)
