"""The operations of a cross-validation: all of it, and one of its fits, which workers do."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from orbiflow import batch, runtime
from orbiflow.density import operations, tables
from orbiflow.density.cross_validation.settings import (
    REPORT,
    SCORES,
    CrossValidation,
    CvDensitySettings,
    CvSettings,
    written_files,
)
from orbiflow.density.run_folder import write_files
from orbiflow.density.tables import RowSettings
from orbiflow.errors import SettingError, literal
from orbiflow.settings import Option

if TYPE_CHECKING:
    from numpy.typing import NDArray


@runtime.operation("density cv", keeps_partial=True, starts_processes=True)
def cross_validate_table(
    data: Path,
    density: CvDensitySettings,
    out: Annotated[Path, Option("-o")] = Path("cv"),
    cv: CvSettings = CvSettings(),
    rows: RowSettings = RowSettings(),
    work: batch.WorkSettings = batch.WorkSettings(),
    *,
    on_event: runtime.Sink = runtime.ignore,
    cancel: runtime.Cancel = runtime.Cancel(),
) -> runtime.Outcome:
    """Cross-validate: how well does a density predict rows that its fit has not seen?

    Fits to all folds but one, for each in turn, here or on a Dask cluster, and scores the one held out,
    beside other settings at the same folds. Writes cv.csv, a line for each fold; rows.csv, the table
    with the log densities of each row; and report.json, the comparison. If it is interrupted, run the
    same command again to resume. The exit status is 1 if a fold has no result.

    Args:
        data: CSV, TSV, NPY or Parquet.
        out: Folder for the results; an earlier cross-validation there is resumed.
    """
    task = CrossValidation(data, out, density, rows, cv)

    from orbiflow.density.cross_validation.overview import run

    return run(task, work, on_event, cancel)


@runtime.operation("density fold")
@runtime.one_thread()
def fold(
    data: Path,
    density: CvDensitySettings,
    out: Annotated[Path, Option("-o")] = Path("fold"),
    rows: RowSettings = RowSettings(),
    *,
    fold: int,
    held: str = "fold",
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
    """
    import numpy as np

    begin = time.perf_counter()
    read = tables.read_rows(data, rows, on_event, where=density, given=(held,))
    out_of_fit = _held(data, next(iter(read.given.values())), fold, held)
    fitted, unseen = read.only(~out_of_fit), read.only(out_of_fit)
    folder = runtime.ResultFolder(out, written_files)
    estimator = operations.fit_rows(fitted, density, rows, on_event, cancel)
    scores = estimator.score_samples(unseen.values)
    if not np.isfinite(scores).all():
        raise SettingError(
            f"{(~np.isfinite(scores)).sum()} rows held out have no density: allow other "
            "{components}"
        )
    cancel.check()
    mean = operations.mean_of_whole(scores, unseen.weights, unseen.whole)
    document = {
        "space": {"name": estimator.space_.name, **estimator.space_.settings()},
        "fold": fold,
        "components": density.components,
        "rows": len(scores),
        "fitted": len(fitted.values),
        "log_likelihood": mean,
        "uniform": operations.uniform_score(estimator, unseen.values, unseen.weights),
        "report": runtime.to_json(estimator.report_),
        "seconds": time.perf_counter() - begin,
    }
    report = json.dumps(document, allow_nan=False, indent=1)
    pairs = zip((unseen.numbers + 1).tolist(), scores.tolist(), strict=True)
    write_files(
        folder, {SCORES: runtime.csv_bytes(["row", "log_prob"], pairs), REPORT: report}, on_event
    )
    on_event(runtime.Note(f"mean log density {mean:.4f} nats at {len(scores)} rows held out"))
    names = ("rows", "fitted", "log_likelihood", "seconds")
    return runtime.Outcome({"folder": str(out), **{name: document[name] for name in names}})


def _held(data: Path, folds: NDArray[Any], fold: int, name: str) -> NDArray[Any]:
    """Return which rows (N,) are of the fold."""
    import numpy as np

    held = folds == fold
    if not held.any() or held.all():
        some = ", ".join(f"{number:g}" for number in np.unique(folds)[:20])
        raise SettingError(
            literal(f"{data}: {'all' if held.any() else 'none'} of its {len(held)} rows are of ")
            + f"{{fold}} {fold} by "
            + literal(f"{name!r}; give one of {some}")
        )
    return held
