"""One fit of a cross-validation: to all rows but those of one fold, which it then scores."""

from __future__ import annotations

import json
import math
import time
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from orbiflow import runtime
from orbiflow.batch import csv_bytes
from orbiflow.density import tables
from orbiflow.density.estimator import DensityEstimator
from orbiflow.density.fitting import ComponentSettings, DensitySettings
from orbiflow.density.operations import mean_of_whole
from orbiflow.density.run_folder import write_files
from orbiflow.errors import OrbiflowError, SettingError, literal
from orbiflow.settings import Option

SCORES, REPORT = "scores.csv", "report.json"


@runtime.operation("density fold")
@runtime.one_thread()
def fold(
    data: Path,
    where: tables.SpaceSettings,
    density: ComponentSettings = ComponentSettings(),
    out: Annotated[Path, Option("-o")] = Path("fold"),
    rows: tables.RowSettings = tables.RowSettings(),
    *,
    fold: int,
    held: str = "fold",
    group: str | None = None,
    on_event: runtime.Sink = runtime.ignore,
    cancel: runtime.Cancel = runtime.Cancel(),
) -> runtime.Outcome:
    """Fit a density to all rows of a table but those of one fold, and score that fold.

    Writes scores.csv, a line for each row held out, and report.json. Rows of the fold take no part in
    the fit, nor in where the space is turned for it.

    Args:
        data: The table.
        out: Folder for the results, made if need be.
        fold: The fold that is held out.
        held: Column that numbers the fold of each row.
        group: Column that names what rows belong to.
    """
    begin = time.perf_counter()
    width = len(rows.columns or ()) or None
    read = tables.read_rows(data, rows, on_event, width=width, group=group)
    table, weights, labels = read.table, read.weights, read.labels()
    out_of_fit = _held(data, table, fold, held, rows.header)
    estimator = DensityEstimator.with_settings(
        where.space,
        DensitySettings(**density.to_json()),
        unit=tables.angle_unit(where.space, where.unit, table, on_event),
        missing="marginalise" if rows.missing == "marginalise" else "refuse",
    )
    folder = runtime.ResultFolder(out, written_files)
    estimator.fit(
        table.values[~out_of_fit],
        sample_weight=None if weights is None else weights[~out_of_fit],
        groups=None if labels is None else labels[~out_of_fit],
        progress=runtime.progress_events(on_event, cancel),
    )
    scores = estimator.score_samples(table.values[out_of_fit])
    if not np.isfinite(scores).all():
        raise SettingError(
            f"{(~np.isfinite(scores)).sum()} rows held out have no density: allow other "
            "{components}"
        )
    cancel.check()
    mean = mean_of_whole(
        scores, None if weights is None else weights[out_of_fit], read.whole[out_of_fit]
    )
    document = {
        "space": {"name": estimator.space_.name, **estimator.space_.settings()},
        "fold": fold,
        "components": density.components,
        "rows": int(out_of_fit.sum()),
        "fitted": int((~out_of_fit).sum()),
        "log_likelihood": mean,
        "uniform": -math.log(estimator.space_.volume),
        "report": estimator.report_.to_json(),
        "seconds": time.perf_counter() - begin,
    }
    report = json.dumps(document, allow_nan=False, indent=1)
    pairs = zip(table.lines[out_of_fit].tolist(), scores.tolist(), strict=True)
    write_files(folder, {SCORES: csv_bytes(["row", "log_prob"], pairs), REPORT: report}, on_event)
    on_event(runtime.Note(f"mean log density {mean:.4f} nats at {out_of_fit.sum()} rows held out"))
    names = ("rows", "fitted", "log_likelihood", "seconds")
    return runtime.Outcome({"folder": str(out), **{name: document[name] for name in names}})


def written_files(folder: Path) -> set[str]:
    """Return the names of what an earlier fold wrote into the folder."""
    return {SCORES, REPORT} if (folder / SCORES).is_file() else set()


def _held(
    data: Path, table: tables.Table, fold: int, name: str, header: bool | None
) -> NDArray[np.bool_]:
    """Which rows (N,) are of the fold."""
    column = tables.read_table(data, columns=[name], width=1, has_header=header, drop_missing=True)
    if not np.isin(table.lines, column.lines).all():
        raise OrbiflowError(f"{data}: some rows lack their fold in {column.columns[0]!r}")
    folds = column.values[np.isin(column.lines, table.lines), 0]
    held = folds == fold
    if not held.any() or held.all():
        some = ", ".join(f"{one:g}" for one in np.unique(folds)[:20])
        raise SettingError(
            literal(f"{data}: {'all' if held.any() else 'none'} of its {len(held)} rows are of ")
            + f"{{fold}} {fold} by "
            + literal(f"{column.columns[0]!r}; give one of {some}")
        )
    return held
