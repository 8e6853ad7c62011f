"""The fits of a cross-validation, done once each by whoever is free, and what they say."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from orbiflow.batch import BatchFolder, Column, Item, Kind, Summary, WorkSettings, run_items
from orbiflow.density.cross_validation.fold import written_files
from orbiflow.density.cross_validation.operations import CrossValidation
from orbiflow.density.cross_validation.overview import PAGE, REPORT, ROWS, TABLE, CvOverview
from orbiflow.density.cross_validation.splits import Fit, Split, cv_rows, fits_of, splits_of
from orbiflow.runtime import (
    Cancel,
    Note,
    Outcome,
    Sink,
    check_inputs_kept,
    check_outside_runs,
    find,
    one_thread,
)


def _figures(summary: Summary) -> dict[str, Any]:
    return {name: summary[name] for name in ("rows", "fitted", "log_likelihood")}


FITS = Kind(
    things="fits",
    items="fits",
    reads="data",
    writes="out",
    modules=("orbiflow.density.cross_validation.fold",),
    columns=(Column("log_likelihood", "held out", ".4f"), Column("rows", "rows", "d")),
    best=_figures,
    picture=lambda _summary: None,
    written=written_files,
)


def run(asked: CrossValidation, work: WorkSettings, tell: Sink, cancel: Cancel) -> Outcome:
    """Do the fits that have not been done, then compare what they say of unseen rows."""
    begin = time.perf_counter()
    out = asked.out
    check_outside_runs(out, asked.data)
    for name in (TABLE, ROWS, REPORT, PAGE):
        check_inputs_kept(out / name, asked.data)
    with one_thread():
        rows = cv_rows(asked, tell)
    splits = splits_of(asked, rows)
    fits = list(fits_of(asked))
    items = [_item(fit, asked, splits[fit.split - 1]) for fit in fits]
    overview = CvOverview(asked, fits, splits)
    with BatchFolder(out, FITS, overview) as folder:
        counts = run_items(items, work, folder, tell, cancel, gone="of other folds or settings")
    found = overview.comparison
    words = [f"no comparison: {found}"] if isinstance(found, str) else found.words()
    notes = () if isinstance(found, str) else found.notes
    for text in (*words, *notes):
        tell(Note(text))
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


def _item(fit: Fit, asked: CrossValidation, split: Split) -> Item:
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
    call = find("density fold").call({k: v for k, v in given.items() if v is not None})
    return Item(fit.key, fit.name, call, split)
