"""The fits of a cross-validation, done once each by whoever is free, and what they say."""

from __future__ import annotations

import time
from typing import Any

from orbiflow.jobs.batch.folder import BatchFolder
from orbiflow.jobs.batch.kind import Column, Kind, Summary
from orbiflow.jobs.batch.work import go_through
from orbiflow.jobs.density_cv.overview import (
    PAGE,
    REPORT,
    ROWS,
    TABLE,
    CvOverview,
)
from orbiflow.jobs.density_cv.rows import read_rows
from orbiflow.jobs.density_cv.splits import (
    fits_of,
    item_of,
    splits_of,
)
from orbiflow.jobs.density_cv_requests import DensityCvRequest
from orbiflow.jobs.density_fold import written_files
from orbiflow.jobs.place import keep_apart, keep_inputs
from orbiflow.jobs.run import Sink
from orbiflow.runtime import Cancel, Finished, Note, one_thread


def _figures(summary: Summary) -> dict[str, Any]:
    return {name: summary[name] for name in ("rows", "fitted", "log_likelihood")}


FITS = Kind(
    things="fits",
    items="fits",
    reads="data",
    writes="out",
    modules=("orbiflow.jobs.density_fold",),
    columns=(Column("log_likelihood", "held out", ".4f"), Column("rows", "rows", "d")),
    best=_figures,
    picture=lambda _summary: None,
    earlier=written_files,
)


def density_cv(request: DensityCvRequest, tell: Sink, cancel: Cancel) -> Finished:
    """Do the fits that have not been done, then compare what they say of rows that they had not seen.

    Returns:
        `summary`: `folder`, `table`, `rows`, `report` and `page`, the files; `fits`, and how many of
        them are `done`, gave `nothing`, have `failed` or are `left`; how many were `kept` from before;
        `comparison`, as in report.json; `seconds`.

    Raises:
        OrbiflowError: for anything that the user can mend; what was finished is kept.
    """
    begin = time.perf_counter()
    keep_apart(request.out, request.data)
    for name in (TABLE, ROWS, REPORT, PAGE):
        keep_inputs(request.out / name, request.data)
    with one_thread():
        rows = read_rows(request, tell)
    splits = splits_of(request, rows)
    fits = list(fits_of(request))
    items = [item_of(fit, request, splits[fit.split - 1]) for fit in fits]
    overview = CvOverview(request, fits, splits)
    with BatchFolder(request.out, FITS, overview) as folder:
        gone = "of other folds or settings"
        outcome = go_through(items, request, folder, tell, cancel, gone=gone)
    found = overview.comparison
    for line in [f"no comparison: {found}"] if isinstance(found, str) else found.words():
        tell(Note(line))
    for note in () if isinstance(found, str) else found.notes:
        tell(Note(note))
    out = request.out
    summary = {
        "folder": str(out),
        "table": str(out / TABLE),
        "rows": str(out / ROWS),
        "report": str(out / REPORT),
        "page": str(out / PAGE),
        "fits": len(fits),
        **outcome.summary(),
        "comparison": None if isinstance(found, str) else found.to_json(),
        "seconds": time.perf_counter() - begin,
    }
    return Finished(outcome.state, summary)
