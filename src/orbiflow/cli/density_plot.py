"""`orbiflow density plot`: its options."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from orbiflow.cli.density_options import (
    Columns,
    DropMissing,
    Format,
    Measure,
    Model,
    NoHeader,
    Projection,
    RegionSamples,
    Scale,
    named_columns,
    numbers_of,
)
from orbiflow.cli.work import do
from orbiflow.jobs import DensityPlotRequest


def plot(
    model: Model,
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            "-o",
            help="Folder for the pictures, made if need be; or a .pdf, a page a figure.",
        ),
    ] = Path("plots"),
    data: Annotated[
        Path | None,
        typer.Option(
            help="Table to draw beside samples in samples.png, and as the dots of --dots.",
            show_default=False,
        ),
    ] = None,
    columns: Columns = None,
    no_header: NoHeader = False,
    drop_missing: DropMissing = False,
    coastlines: Annotated[
        Path | None,
        typer.Option(
            help="Lines to draw over maps of the sphere: GeoJSON, or a table of lat,lon where a lat "
            "beyond 90 ends a line.",
            show_default=False,
        ),
    ] = None,
    file_format: Annotated[
        Format | None,
        typer.Option(
            "--format", help="Of the figures: png, or pdf or svg for print.", show_default=False
        ),
    ] = None,
    width: Annotated[
        str | None,
        typer.Option(
            help="For print, with texts of 7 to 8 points: single (85mm), double (180mm) or a length "
            "from 40mm.",
            show_default=False,
        ),
    ] = None,
    measure: Annotated[Measure, typer.Option(help="What the density is per.")] = Measure.NATURAL,
    scale: Annotated[
        Scale,
        typer.Option(
            help="Of colours. Auto: log if on 80 % of the area the density is below a tenth of its "
            "peak."
        ),
    ] = Scale.AUTO,
    center: Annotated[
        str | None,
        typer.Option(
            help="Angles in the middle of a torus' pictures, such as 180,180 (default 0 each); of a "
            "map lat,lon, or the lon of its middle meridian.",
            show_default=False,
        ),
    ] = None,
    projection: Annotated[
        Projection,
        typer.Option(
            help="Of maps. Auto, on the sphere: lambert if nearly all points are in one hemisphere, "
            "else equal-earth. Schmidt and wulff are nets of plunge, trend."
        ),
    ] = Projection.AUTO,
    radius: Annotated[
        float | None,
        typer.Option(
            help="Degrees about the centre that lambert, stereographic and nets show, at most 90.",
            show_default=False,
        ),
    ] = None,
    regions: Annotated[
        str | None,
        typer.Option(
            help="Masses such as 0.5,0.9: lines about the smallest regions that hold them.",
            show_default=False,
        ),
    ] = None,
    region_samples: RegionSamples = None,
    samples: Annotated[
        int | None,
        typer.Option(
            help="How many beside the data, or beside the density where there are none; default "
            "3000 beside data alone.",
            show_default=False,
        ),
    ] = None,
    dots: Annotated[
        bool,
        typer.Option(
            "--dots",
            help="Draw data, or else samples, over density and surface, smaller where they crowd.",
        ),
    ] = False,
    seed: Annotated[int, typer.Option(help="Of the samples.")] = 0,
) -> None:
    """Draw a density: density, flow, samples as PNG, PDF or SVG, and surface.html, to turn in 3-D.

    Directions and axes are drawn on maps (density, latlon) and on the square; of a torus of more or
    fewer than two angles there are samples alone, all pairs of angles.
    """
    request = DensityPlotRequest(
        model=model,
        out=out,
        data=data,
        columns=named_columns(columns),
        header=False if no_header else None,
        drop_missing=drop_missing,
        coastlines=coastlines,
        format=file_format.value if file_format else None,
        width=width,
        measure=measure.value,
        scale=scale.value,
        center=center,
        projection=projection.value,
        radius=radius,
        regions=numbers_of(regions, "regions"),
        region_samples=region_samples,
        samples=samples,
        dots=dots,
        seed=seed,
    )
    do(request)
