"""`orbiflow density`: options of its commands."""

from __future__ import annotations

import typer

from orbiflow.cli.density_batch import batch
from orbiflow.cli.density_compare import compare
from orbiflow.cli.density_cv import cv
from orbiflow.cli.density_patches import patches
from orbiflow.cli.density_plot import plot
from orbiflow.cli.density_region import region_of

density = typer.Typer(
    name="density",
    help="Fit, evaluate, sample and draw exact densities of angles, directions and axes.",
    no_args_is_help=True,
    rich_markup_mode="rich",
)


density.command()(plot)
density.command()(compare)
density.command("region")(region_of)
density.command()(patches)
density.command()(batch)
density.command()(cv)
