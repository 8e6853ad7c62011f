"""Read, fit, check, write: the job of a `DensityFitRequest`."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.density import (
    MODEL,
    REPORT,
    THUMBNAIL,
    DensityEstimator,
    FitReport,
    FitSettings,
    RowSketch,
    Table,
    density_to_bytes,
    read_labels,
)
from orbiflow.density.tables import angle_unit
from orbiflow.errors import OrbiflowError
from orbiflow.jobs.density_data import read_beside_groups
from orbiflow.jobs.density_folder import written_files
from orbiflow.jobs.density_requests import DensityFitRequest
from orbiflow.jobs.place import check_folder
from orbiflow.jobs.run import Sink
from orbiflow.runtime import (
    Cancel,
    Finished,
    Note,
    Progress,
    RecordError,
    ResultFolder,
    Written,
    one_thread,
    write_atomic,
)

MOST_SCORED = 20_000
"""Rows over which the mean log density is taken: up to here all of them, for a few hundredths of the
fit's time at most; of 100,000 rows of six angles it would be two fifths."""

SETTINGS = (
    "parts", "repeats", "missing", "weights", "group", "detail", "segments", "kernels", "seed",
)  # fmt: skip
"""Of a request, told in the report."""

WIDTH = {"sphere": None, "projective-plane": None, "klein-bottle": 2, "torus": None}


@one_thread()
def density_fit(request: DensityFitRequest, tell: Sink, cancel: Cancel) -> Finished:
    """Fit, and write the folder whole.

    Returns:
        `summary`: `folder`, `rows`, `log_likelihood` and `seconds`, as in report.json; `picture`, the
        name of the small one, or None.

    Raises:
        OrbiflowError: for anything that the user can mend.
        Cancelled: if it was told to stop; nothing is written.
    """
    begin = time.perf_counter()
    _check_flow(request)
    table, weights = read_beside_groups(request, WIDTH[request.space], tell)
    groups = None
    if request.group is not None:
        groups = read_labels(request.data, request.group, table, has_header=request.header)
    estimator = estimator_of(request, angle_unit(request.space, request.unit, table, tell))
    folder = ResultFolder(request.out, written_files)
    check_folder(request.out, request.data)
    estimator.fit(
        table.values, sample_weight=weights, groups=groups, progress=told_of(tell, cancel)
    )
    document = _document(request, table, weights, estimator, begin)
    with folder.replaced() as staged:
        whole = table.values[~np.isnan(table.values).any(axis=1)]
        fitted = RowSketch.of(estimator.space_, whole).to_json() if len(whole) else None
        saved = density_to_bytes(
            estimator.density_, columns=list(table.columns), fitted_rows=fitted
        )
        write_atomic(staged / MODEL, saved)
        write_atomic(staged / REPORT, json.dumps(document, allow_nan=False, indent=1))
        if request.picture:
            from orbiflow.density import density_thumbnail

            picture = density_thumbnail(estimator.density_, table.values)
            write_atomic(staged / THUMBNAIL, picture)
    for name in (MODEL, REPORT, *((THUMBNAIL,) if request.picture else ())):
        tell(Written(request.out / name))
    for note in (*estimator.report_.notes, *_told(request, document, len(table.values))):
        tell(Note(note))
    summary = {name: document[name] for name in ("log_likelihood", "seconds")}
    summary["picture"] = THUMBNAIL if request.picture else None
    return Finished("done", {"folder": str(request.out), "rows": len(table.values), **summary})


def _check_flow(request: DensityFitRequest) -> None:
    """
    Raises:
        RecordError: for settings of a flow that are out of range, or where there can be none.
    """
    for name in ("detail", "segments", "seconds", "seed"):
        value = getattr(request, name)
        if value is None:
            continue
        try:
            FitSettings(**{name: value})
        except OrbiflowError as error:
            raise RecordError(str(error).replace(name, f"{{{name}}}", 1)) from error
        if name in ("detail", "segments") and "flow" not in (request.parts or ("flow",)):
            raise RecordError(
                f"{{{name}}} is the flow's, and {{parts}} allows none: leave it out, or allow a flow"
            )


def estimator_of(request: DensityFitRequest, unit: str) -> DensityEstimator:
    """What is asked for, before it has seen data; `unit` of its angles."""
    return DensityEstimator(
        request.space,
        unit=unit,
        parts="auto" if request.parts is None else ",".join(request.parts),
        repeats=request.repeats,
        missing="marginalise" if request.missing == "marginalise" else "refuse",
        detail=request.detail,
        segments=request.segments,
        kernels=request.kernels,
        seconds=math.inf if request.seconds is None else request.seconds,
        seed=request.seed,
    )


def told_of(tell: Sink, cancel: Cancel) -> Callable[[float, str], None]:
    """A fit's progress as events, whose share never falls; raises `Cancelled`."""
    reached = 0.0

    def progress(share: float, what: str) -> None:
        nonlocal reached
        cancel.check()
        reached = max(reached, share)
        tell(Progress(reached, what))

    return progress


def _document(
    request: DensityFitRequest,
    table: Table,
    weights: Array | None,
    estimator: DensityEstimator,
    begin: float,
) -> dict[str, Any]:
    """Of report.json."""
    report = estimator.report_
    scored = _scored(table, weights, request.seed)
    return {
        "space": {"name": estimator.space_.name, **estimator.space_.settings()},
        "columns": table.columns,
        "settings": {name: getattr(request, name) for name in SETTINGS},
        "log_likelihood": {
            "natural": estimator.score(
                table.values[scored], sample_weight=None if weights is None else weights[scored]
            ),
            "natural_rows": len(scored),
            "uniform": -math.log(estimator.space_.volume),
            "square_train": -report.train_nll,
            "square_validation": -report.validation_nll,
        },
        "report": plain_report(report),
        "seconds": time.perf_counter() - begin,
    }


def _told(request: DensityFitRequest, document: dict[str, Any], rows: int) -> tuple[str, str]:
    """What came of it, in words."""
    likelihood, mass = document["log_likelihood"], document["report"]["mass"]
    gain = likelihood["natural"] - likelihood["uniform"]
    scored = likelihood["natural_rows"]
    which = "these rows" if scored == rows else f"{scored} of them"
    return (
        f"{rows} rows: mean log density at {which} {likelihood['natural']:.4f} nats, {gain:.4f} more "
        f"than the uniform density; integral {'not checked' if mass is None else f'{mass:.5f}'}",
        f"written to {request.out} in {document['seconds']:.0f} s",
    )


def _scored(table: Table, weights: Array | None, seed: int) -> NDArray[np.int64]:
    """Which rows the mean log density is of: those that count and lack nothing, or many of them."""
    whole = ~np.isnan(table.values).any(axis=1)
    if weights is not None:
        whole &= weights > 0
    found = np.flatnonzero(whole)
    if len(found) <= MOST_SCORED:
        return found
    return np.sort(np.random.default_rng(seed).choice(found, MOST_SCORED, replace=False))


def plain_report(report: FitReport) -> dict[str, Any]:
    """For `json.dumps`."""
    document = asdict(report)
    for stage in document["stages"]:
        for name in ("train", "validation"):
            stage[name] = [round(v, 6) if np.isfinite(v) else None for v in stage[name]]
    return document
