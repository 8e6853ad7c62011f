"""Fit to all rows but those of one fold, score that fold: the job of a `DensityFoldRequest`."""

from __future__ import annotations

import json
import math
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.density import (
    DensityEstimator,
    Table,
    mean_of,
    read_labels,
    read_table,
    weighed,
)
from orbiflow.density.tables import RowSettings, angle_unit, read_rows
from orbiflow.errors import OrbiflowError
from orbiflow.jobs.density_cv_requests import DensityFoldRequest
from orbiflow.jobs.density_fit import (
    estimator_of,
    told_of,
)
from orbiflow.jobs.run import Sink
from orbiflow.runtime import (
    Cancel,
    Finished,
    Note,
    ResultFolder,
    Written,
    one_thread,
    write_atomic,
)

SCORES, REPORT = "scores.csv", "report.json"


@one_thread()
def density_fold(request: DensityFoldRequest, tell: Sink, cancel: Cancel) -> Finished:
    """Fit, score, and write the folder whole: `scores.csv`, a line a row held out, and `report.json`.

    Rows of the fold take no part in the fit, nor in where the space is turned for it.

    Returns:
        `summary`: `folder`; `rows` held out and `fitted`; `log_likelihood`, the mean log density of
        those held out in nats, in natural measure and weighted; `seconds`.

    Raises:
        OrbiflowError: for anything that the user can mend.
        Cancelled: if it was told to stop; nothing is written.
    """
    begin = time.perf_counter()
    reading = RowSettings(
        columns=request.columns,
        header=request.header,
        missing=request.missing,
        weights=request.weights,
    )
    rows = read_rows(request.data, reading, tell, width=len(request.columns), group=request.group)
    table, weights = rows.table, rows.weights
    held = _held(request, table)
    estimator = estimator_of(request.fit(), angle_unit(request.space, request.unit, table, tell))
    groups = None
    if request.group is not None:
        groups = read_labels(request.data, request.group, table, has_header=request.header)[~held]
    folder = ResultFolder(request.out, written_files)
    estimator.fit(
        table.values[~held],
        sample_weight=None if weights is None else weights[~held],
        groups=groups,
        progress=told_of(tell, cancel),
    )
    scores = estimator.score_samples(table.values[held])
    if not np.isfinite(scores).all():
        raise OrbiflowError(
            f"{(~np.isfinite(scores)).sum()} rows held out have no density: allow other --parts"
        )
    cancel.check()
    mean = _mean(scores, table.values[held], None if weights is None else weights[held])
    document = _document(request, estimator, held, mean, begin)
    with folder.replaced() as staged:
        write_atomic(staged / SCORES, scores_csv(table.lines[held], scores))
        write_atomic(staged / REPORT, json.dumps(document, allow_nan=False, indent=1))
    for name in (SCORES, REPORT):
        tell(Written(request.out / name))
    tell(Note(f"mean log density {mean:.4f} nats at {held.sum()} rows held out"))
    names = ("rows", "fitted", "log_likelihood", "seconds")
    summary = {name: document[name] for name in names}
    return Finished("done", {"folder": str(request.out), **summary})


def scores_csv(rows: NDArray[np.int64], scores: Array) -> str:
    """Numbers of rows (of lines, in text) and log densities, which are read back exactly.

    >>> scores_csv(np.array([2, 7]), np.array([-1.5, 0.1]))
    'row,log_prob\\n2,-1.5\\n7,0.1\\n'
    """
    pairs = zip(rows.tolist(), scores.tolist(), strict=True)
    return "row,log_prob\n" + "".join(f"{row},{score!r}\n" for row, score in pairs)


def written_files(folder: Path) -> set[str]:
    """What an earlier fold wrote into the folder."""
    return {SCORES, REPORT} if (folder / SCORES).is_file() else set()


def _held(request: DensityFoldRequest, table: Table) -> NDArray[np.bool_]:
    """Which rows (N,) are of the fold.

    Raises:
        OrbiflowError: for a column that numbers no folds, or has no such fold.
    """
    column = read_table(
        request.data, columns=[request.held], width=1, has_header=request.header, drop_missing=True
    )
    if not np.isin(table.lines, column.lines).all():
        raise OrbiflowError(f"{request.data}: some rows lack their fold in {column.columns[0]!r}")
    folds = column.values[np.isin(column.lines, table.lines), 0]
    held = folds == request.fold
    if not held.any() or held.all():
        raise OrbiflowError(
            f"{request.data}: {'all' if held.any() else 'none'} of its {len(held)} rows are of "
            f"fold {request.fold} by {column.columns[0]!r}; give one of "
            f"{', '.join(f'{fold:g}' for fold in np.unique(folds)[:20])}"
        )
    return held


def _mean(scores: Array, values: Array, weights: Array | None) -> float:
    """Of the rows that lack nothing: densities of fewer angles are in another unit."""
    import torch

    whole = ~np.isnan(values).any(axis=1)
    chosen = whole if whole.any() else np.ones_like(whole)
    rows = weighed(torch.tensor(scores[chosen, None]), None if weights is None else weights[chosen])
    return mean_of(rows.points[:, 0], rows.weights)


def _document(
    request: DensityFoldRequest,
    estimator: DensityEstimator,
    held: NDArray[np.bool_],
    mean: float,
    begin: float,
) -> dict[str, Any]:
    """Of report.json."""
    return {
        "space": {"name": estimator.space_.name, **estimator.space_.settings()},
        "fold": request.fold,
        "components": request.parts,
        "rows": int(held.sum()),
        "fitted": int((~held).sum()),
        "log_likelihood": mean,
        "uniform": -math.log(estimator.space_.volume),
        "report": estimator.report_.to_json(),
        "seconds": time.perf_counter() - begin,
    }
