"""Options that batches of silhouettes and of tables share."""

from __future__ import annotations

from typing import Annotated

import typer

Match = Annotated[
    str | None,
    typer.Option(help='Only files whose names fit, such as "*.svg".', show_default=False),
]
Workers = Annotated[
    int | None,
    typer.Option(
        help="Processes, each at a file at a time; default one a core.", show_default=False
    ),
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
