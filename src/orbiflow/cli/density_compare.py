"""`orbiflow density compare`: models at held-out rows, or two data sets."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from orbiflow.cli.density_options import (
    Columns,
    DropMissing,
    Group,
    NoHeader,
    Space,
    Unit,
    named_columns,
)
from orbiflow.cli.work import do
from orbiflow.jobs import DensityCompareRequest


def compare(
    data: Annotated[
        list[Path],
        typer.Option(
            "--data",
            "-d",
            help="Held-out rows for models; or twice, for two data sets.",
            show_default=False,
        ),
    ],
    models: Annotated[
        list[Path] | None,
        typer.Option(
            "--model", "-m", help="Folder that `fit` wrote; twice or more.", show_default=False
        ),
    ] = None,
    space: Annotated[
        Space | None,
        typer.Option(help="Where two data sets live.", show_default=False),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="A .json or .csv of the result.", show_default=False),
    ] = None,
    columns: Columns = None,
    no_header: NoHeader = False,
    drop_missing: DropMissing = False,
    unit: Annotated[
        Unit | None, typer.Option(help="Of angles in two data sets.", show_default=False)
    ] = None,
    group: Group = None,
    bootstrap: Annotated[int, typer.Option(help="Resamples of rows or groups.")] = 2000,
    permutations: Annotated[int, typer.Option(help="Of the test of two data sets.")] = 999,
    level: Annotated[float, typer.Option(help="Of intervals and test.")] = 0.95,
    seed: Annotated[int, typer.Option(help="Same seed, same result.")] = 0,
) -> None:
    """Which model suits held-out rows better, or do two data sets differ? With its uncertainty.

    Models: -m A -m B -d held-out.csv. Data sets: -d a.csv -d b.csv --space sphere.
    """
    request = DensityCompareRequest(
        data=tuple(data),
        models=tuple(models or ()),
        space=None if space is None else space.value,
        out=out,
        columns=named_columns(columns),
        header=False if no_header else None,
        drop_missing=drop_missing,
        unit=None if unit is None else unit.value,
        group=group,
        bootstrap=bootstrap,
        permutations=permutations,
        level=level,
        seed=seed,
    )
    do(request)
