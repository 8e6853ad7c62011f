"""`orbiflow density`: options of its commands."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from orbiflow.cli.density_batch import batch
from orbiflow.cli.density_compare import compare
from orbiflow.cli.density_cv import cv
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
from orbiflow.cli.density_patches import patches
from orbiflow.cli.density_plot import plot
from orbiflow.cli.density_region import region_of
from orbiflow.cli.work import do
from orbiflow.jobs import (
    DensityFitRequest,
)

density = typer.Typer(
    name="density",
    help="Fit, evaluate, sample and draw exact densities of angles, directions and axes.",
    no_args_is_help=True,
    rich_markup_mode="rich",
)


@density.command()
def fit(
    data: Data,
    space: Annotated[Space, typer.Option(help="Where the data live.", show_default=False)],
    out: Annotated[
        Path, typer.Option("--out", "-o", help="Folder for the results, made if need be.")
    ] = Path("density"),
    columns: Columns = None,
    no_header: NoHeader = False,
    drop_missing: DropMissing = False,
    missing: MissingOption = Missing.REFUSE,
    weights: Weights = None,
    group: Group = None,
    unit: UnitOption = None,
    parts: Parts = None,
    repeats: RepeatsOption = Repeats.PLACES,
    detail: Annotated[
        int | None,
        typer.Option(
            help="Waves of the flow along a side of the square, 1 to 64.", show_default=False
        ),
    ] = None,
    segments: Annotated[
        int | None, typer.Option(help="Stationary pieces of the flow.", show_default=False)
    ] = None,
    kernels: Annotated[
        bool,
        typer.Option("--kernels", help="A flow with adaptive kernels, and nothing else."),
    ] = False,
    seconds: Annotated[
        float | None,
        typer.Option(help="Of training at most; default no limit.", show_default=False),
    ] = None,
    seed: Annotated[int, typer.Option(help="Same seed, same machine: same density.")] = 0,
) -> None:
    """Fit a density: angles (torus), lat,lon or x,y,z (sphere), axes (projective plane) or theta,phi.

    Writes density.safetensors and report.json into the folder.
    """
    request = DensityFitRequest(
        data=data,
        space=space.value,
        out=out,
        columns=named_columns(columns),
        header=False if no_header else None,
        drop_missing=drop_missing,
        missing=missing.value,
        weights=weights,
        group=group,
        unit=None if unit is None else unit.value,
        parts=named_columns(parts),
        repeats=repeats.value,
        detail=detail,
        segments=segments,
        kernels=kernels,
        seconds=seconds,
        seed=seed,
    )
    do(request)


density.command()(plot)
density.command()(compare)
density.command("region")(region_of)
density.command()(patches)
density.command()(batch)
density.command()(cv)
