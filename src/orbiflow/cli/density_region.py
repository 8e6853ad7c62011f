"""`orbiflow density region`: where a density is highest."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from orbiflow.cli.density_options import (
    Model,
    RegionSamples,
    numbers_of,
)
from orbiflow.cli.work import do
from orbiflow.jobs import DensityRegionRequest


def region_of(
    model: Model,
    out: Annotated[
        Path,
        typer.Option("--out", "-o", help=".geojson (of directions and axes), .json or .csv."),
    ] = Path("regions.json"),
    mass: Annotated[
        str | None,
        typer.Option(help="That regions hold, such as 0.5,0.9 (default).", show_default=False),
    ] = None,
    level: Annotated[
        str | None,
        typer.Option(
            help="Log densities, as `score` gives them, above which regions lie.",
            show_default=False,
        ),
    ] = None,
    samples: RegionSamples = None,
    budget: Annotated[
        int, typer.Option(help="Evaluations after which outlines get no finer.")
    ] = 300_000,
    seed: Annotated[int, typer.Option(help="Same seed, same result.")] = 0,
) -> None:
    """Find the smallest regions that hold a mass: threshold, size, and boundary as closed polygons.

    Of a torus of more or fewer than two angles: threshold and size.
    """
    request = DensityRegionRequest(
        model=model,
        out=out,
        mass=numbers_of(mass, "mass"),
        level=numbers_of(level, "level"),
        samples=samples,
        budget=budget,
        seed=seed,
    )
    do(request)
