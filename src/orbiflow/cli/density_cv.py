"""`orbiflow density cv`: cross-validation, as the field abbreviates it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from orbiflow.cli.batch_options import (
    OutFolder,
    RetryFailed,
    Scheduler,
    Workers,
)
from orbiflow.cli.density_options import (
    Columns,
    Data,
    DropMissing,
    Group,
    Missing,
    MissingOption,
    NoHeader,
    Parts,
    Repeats,
    RepeatsOption,
    Space,
    UnitOption,
    Weights,
    named_columns,
)
from orbiflow.cli.work import do_many
from orbiflow.jobs import DensityCvRequest


def cv(
    data: Data,
    space: Annotated[Space, typer.Option(help="Where the data live.", show_default=False)],
    out: OutFolder = Path("cv"),
    folds: Annotated[int, typer.Option(help="Parts of the rows, each held out once.")] = 10,
    times: Annotated[
        int, typer.Option(help="Splits, each of its own: more take away the chance of one split.")
    ] = 1,
    group: Group = None,
    against: Annotated[
        list[str] | None,
        typer.Option(
            help="Other --parts to be fitted to the same folds and compared row by row; also "
            "'default', all parts, and 'uniform'. May be given several times. Default kernels.",
            show_default=False,
        ),
    ] = None,
    columns: Columns = None,
    no_header: NoHeader = False,
    drop_missing: DropMissing = False,
    missing: MissingOption = Missing.REFUSE,
    weights: Weights = None,
    unit: UnitOption = None,
    parts: Parts = None,
    repeats: RepeatsOption = Repeats.PLACES,
    workers: Workers = None,
    scheduler: Scheduler = None,
    retry_failed: RetryFailed = False,
    level: Annotated[float, typer.Option(help="Of intervals.")] = 0.95,
    bootstrap: Annotated[int, typer.Option(help="Resamples of rows or groups.")] = 2000,
    seed: Annotated[int, typer.Option(help="Same seed: same folds, same numbers.")] = 0,
) -> None:
    """Cross-validate: how well does a density foretell rows that its fit has not seen?

    Fits to all folds but one, for each in turn, here or on a Dask cluster, and scores the one held
    out, beside other settings at the same folds. Writes cv.csv, a line a fold; rows.csv, the table with
    each row's log densities; report.json, the comparison; and index.html, a page to look at. Ended in
    any way, the same command goes on. Status 1 if a fold has no result.
    """
    request = DensityCvRequest(
        data=data,
        space=space.value,
        out=out,
        folds=folds,
        times=times,
        group=group,
        columns=named_columns(columns),
        header=False if no_header else None,
        drop_missing=drop_missing,
        missing=missing.value,
        weights=weights,
        unit=None if unit is None else unit.value,
        parts=named_columns(parts),
        against=None if against is None else tuple(against),
        repeats=repeats.value,
        level=level,
        bootstrap=bootstrap,
        workers=workers,
        scheduler=scheduler,
        retry_failed=retry_failed,
        seed=seed,
    )
    do_many(request)
