"""`orbiflow density batch`: the command's options."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from orbiflow.cli.batch_options import (
    Match,
    OutFolder,
    RetryFailed,
    Scheduler,
    Workers,
    done_many,
)
from orbiflow.cli.density_options import (
    Columns,
    DropMissing,
    NoHeader,
    Parts,
    Repeats,
    RepeatsOption,
    Space,
    UnitOption,
    named_columns,
)
from orbiflow.jobs import DensityBatchRequest


def batch(
    folder: Annotated[
        Path,
        typer.Argument(
            help="Folder of tables, searched with the folders in it: CSV, TSV, NPY or Parquet.",
            show_default=False,
        ),
    ],
    space: Annotated[Space, typer.Option(help="Where the data live.", show_default=False)],
    out: OutFolder = Path("batch"),
    match: Match = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    retry_failed: RetryFailed = False,
    columns: Columns = None,
    no_header: NoHeader = False,
    drop_missing: DropMissing = False,
    unit: UnitOption = None,
    parts: Parts = None,
    repeats: RepeatsOption = Repeats.PLACES,
    seed: Annotated[int, typer.Option(help="Same seed, same machine: same densities.")] = 0,
) -> None:
    """Fit a density to every table of a folder, here or on a Dask cluster.

    Writes a folder a table, as fit does; batch.csv and index.html for all. Ended in any way, the same
    command goes on where it was. Status 1 if some have no density.
    """
    asked: dict[str, Any] = {
        "space": space.value,
        "columns": named_columns(columns),
        "header": False if no_header else None,
        "drop_missing": drop_missing,
        "unit": None if unit is None else unit.value,
        "parts": named_columns(parts),
        "repeats": repeats.value,
        "seed": seed,
    }
    done_many(DensityBatchRequest, folder, asked, out, match, workers, scheduler, retry_failed)
