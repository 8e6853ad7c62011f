"""Options that batches of silhouettes and of tables share, and their request."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from orbiflow.cli.work import do_many
from orbiflow.jobs import BatchRequest, DensityBatchRequest

OutFolder = Annotated[
    Path,
    typer.Option(
        "--out", "-o", help="Folder for the results; an earlier run there is gone on with."
    ),
]
Match = Annotated[
    str | None,
    typer.Option(help='Only files whose names fit, such as "*.svg".', show_default=False),
]
Workers = Annotated[
    int | None,
    typer.Option(help="Processes, each at one at a time; default one a core.", show_default=False),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        help="Address of a Dask scheduler, tcp://HOST:PORT: its workers do the work.",
        show_default=False,
    ),
]
RetryFailed = Annotated[
    bool, typer.Option("--retry-failed", help="Do again what had no result before.")
]


def done_many(
    kind: type[BatchRequest] | type[DensityBatchRequest],
    folder: Path,
    each: dict[str, Any],
    out: Path,
    match: str | None,
    workers: int | None,
    scheduler: str | None,
    retry_failed: bool,
) -> None:
    """Make the request of a batch, `each` for every file, and run it.

    Raises:
        OrbiflowError: for anything that the user can mend.
        typer.Exit: with status 1 if a file has no result, 130 after Ctrl-C.
    """
    request = kind(
        folder=folder,
        out=out,
        each=each,
        match=match,
        workers=workers,
        scheduler=scheduler,
        retry_failed=retry_failed,
    )
    do_many(request)
