"""`orbiflow density patches`: 3 x 3 image patches to angles on the Klein bottle."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from orbiflow.cli.density_options import (
    DropMissing,
    NoHeader,
    Unit,
    named_columns,
)
from orbiflow.cli.work import do
from orbiflow.jobs import PatchesRequest


def patches(
    data: Annotated[
        Path,
        typer.Argument(
            help="Table of 9 pixel values a row, from the top left, or 8 DCT coordinates.",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path, typer.Option("--out", "-o", help="CSV of theta, phi and distance.")
    ] = Path("angles.csv"),
    columns: Annotated[
        str | None,
        typer.Option(help="Names or numbers of the 9 or 8 columns.", show_default=False),
    ] = None,
    no_header: NoHeader = False,
    drop_missing: DropMissing = False,
    unit: Annotated[Unit, typer.Option(help="Of theta and phi.")] = Unit.RADIANS,
    farthest: Annotated[
        float | None,
        typer.Option(
            help="Leave out patches farther than this from the Klein bottle, 0 to 1.41.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Turn image patches into theta,phi on the Klein bottle, for `fit --space klein-bottle`.

    The distance is between patches of mean 0 and contrast 1.
    """
    request = PatchesRequest(
        data=data,
        out=out,
        columns=named_columns(columns),
        header=False if no_header else None,
        drop_missing=drop_missing,
        unit=unit.value,
        farthest=farthest,
    )
    do(request)
