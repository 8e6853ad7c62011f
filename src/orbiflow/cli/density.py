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
    Measure,
    Missing,
    MissingOption,
    Model,
    NoHeader,
    Parts,
    Repeats,
    RepeatsOption,
    Space,
    UnitOption,
    Weights,
    named_columns,
)
from orbiflow.cli.density_partial import conditional, marginal
from orbiflow.cli.density_patches import patches
from orbiflow.cli.density_plot import plot
from orbiflow.cli.density_region import region_of
from orbiflow.cli.work import do
from orbiflow.jobs import (
    DensityFitRequest,
    DensitySampleRequest,
    DensityScoreRequest,
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


@density.command()
def score(
    data: Data,
    model: Model,
    out: Annotated[
        Path, typer.Option("--out", "-o", help="The data with a column log_prob.")
    ] = Path("scores.csv"),
    columns: Columns = None,
    no_header: NoHeader = False,
    drop_missing: DropMissing = False,
    missing: MissingOption = Missing.REFUSE,
    weights: Weights = None,
    measure: Annotated[
        Measure,
        typer.Option(help="Natural: the data's own units, or steradians. Uniform: against chance."),
    ] = Measure.NATURAL,
    region: Annotated[
        bool,
        typer.Option(
            "--region",
            help="Add a column hdr: the mass of the smallest region of highest density that holds "
            "the row.",
        ),
    ] = False,
    samples: Annotated[
        int | None,
        typer.Option(
            help="Of the density, by which hdr is known: default 20000, which tell masses up to "
            "0.9995.",
            show_default=False,
        ),
    ] = None,
    gradient: Annotated[
        bool,
        typer.Option(
            "--gradient",
            help="Add the gradient of log_prob, a column for each of the data's: per unit of each "
            "angle, per degree of lat and lon, tangent vectors of x,y,z.",
        ),
    ] = False,
    table: Annotated[
        bool,
        typer.Option(
            "--table",
            help="Read log densities off a table, in two dimensions: faster where kernels are wide "
            "or a flow has a share. Its error is said.",
        ),
    ] = False,
) -> None:
    """Add a column log_prob, in nats, to a table."""
    request = DensityScoreRequest(
        data=data,
        model=model,
        out=out,
        columns=named_columns(columns),
        header=False if no_header else None,
        drop_missing=drop_missing,
        missing=missing.value,
        weights=weights,
        measure=measure.value,
        region=region,
        samples=samples,
        gradient=gradient,
        table=table,
    )
    do(request)


@density.command()
def sample(
    model: Model,
    out: Annotated[Path, typer.Option("--out", "-o", help="CSV of the samples.")] = Path(
        "samples.csv"
    ),
    n: Annotated[int, typer.Option("-n", help="How many.")] = 1000,
    seed: Annotated[int, typer.Option(help="Same seed, same machine: same samples.")] = 0,
) -> None:
    """Draw samples in the units of the data."""
    do(DensitySampleRequest(model=model, out=out, count=n, seed=seed))


density.command()(plot)
density.command()(marginal)
density.command()(conditional)
density.command()(compare)
density.command("region")(region_of)
density.command()(patches)
density.command()(batch)
density.command()(cv)
