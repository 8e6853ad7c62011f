"""`orbiflow density marginal` and `conditional`: models of fewer angles."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from orbiflow.cli.density_options import Model, named_columns
from orbiflow.cli.work import do
from orbiflow.jobs import DensityConditionalRequest, DensityMarginalRequest

Folder = typer.Option("--out", "-o", help="Folder of the new model, made if need be.")


def marginal(
    model: Model,
    columns: Annotated[
        str,
        typer.Option(help="Angles to keep, by name or number, such as phi.", show_default=False),
    ],
    out: Annotated[Path, Folder] = Path("marginal"),
) -> None:
    """The density of some of a torus' angles, whatever the others are.

    Writes a model that score, sample and plot read; of one or two angles density.csv and
    density.png, too.
    """
    do(DensityMarginalRequest(model=model, columns=named_columns(columns) or (), out=out))


def conditional(
    model: Model,
    given: Annotated[
        str,
        typer.Option(
            help="What is known, in the model's unit, such as psi=-45 or psi=-45,chi1=60.",
            show_default=False,
        ),
    ],
    columns: Annotated[
        str | None,
        typer.Option(help="Of the other angles, those to keep; default all.", show_default=False),
    ] = None,
    out: Annotated[Path, Folder] = Path("conditional"),
) -> None:
    """The density of a torus' other angles where some are known.

    Writes a model that score, sample and plot read; of one or two angles density.csv and
    density.png, too.
    """
    request = DensityConditionalRequest(
        model=model, given=named_columns(given) or (), columns=named_columns(columns), out=out
    )
    do(request)
