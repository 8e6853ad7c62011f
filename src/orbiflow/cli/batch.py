"""`orbiflow batch`: the command's options."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from orbiflow.cli.batch_options import (
    Match,
    OutFolder,
    RetryFailed,
    Scheduler,
    Workers,
    done_many,
)
from orbiflow.cli.search_options import (
    ChosenEffort,
    ChosenMethod,
    ChosenObjective,
    Classes,
    Figures,
    Force,
    Invert,
    Iterations,
    MaxFrequency,
    Method,
    MinNeck,
    PerClass,
    Seed,
    Threshold,
    Turns,
    named_classes,
)
from orbiflow.jobs import BatchRequest


def batch(
    folder: Annotated[
        Path,
        typer.Argument(
            help="Folder of silhouettes, searched with the folders in it: PNG, JPEG, WebP, SVG, and "
            "polygons (.json, .dat).",
            show_default=False,
        ),
    ],
    out: OutFolder = Path("batch"),
    match: Match = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    retry_failed: RetryFailed = False,
    classes: Classes = "all",
    effort: ChosenEffort = None,
    objective: ChosenObjective = None,
    per_class: PerClass = 1,
    min_neck: MinNeck = None,
    max_frequency: MaxFrequency = None,
    seed: Seed = 0,
    method: ChosenMethod = Method.DESCENT,
    turns: Turns = None,
    iterations: Iterations = None,
    figures: Figures = False,
    threshold: Threshold = None,
    invert: Invert = None,
    force: Force = False,
) -> None:
    """Find tiles for every silhouette of a folder, here or on a Dask cluster.

    Writes a folder a silhouette, as escherize does; batch.csv, all in one table; and index.html, all on
    one page. Both grow as results come. Ended in any way, the same command goes on: nothing is done
    twice unless a file or an option has changed. Status 1 if some have no tile.
    """
    asked: dict[str, Any] = {
        "classes": named_classes(classes),
        "effort": effort.value if effort else None,
        "objective": objective.value if objective else None,
        "per_class": per_class,
        "min_neck": min_neck,
        "max_frequency": max_frequency,
        "seed": seed,
        "method": method.value,
        "turns": turns,
        "iterations": iterations,
        "figures": figures,
        "threshold": threshold,
        "invert": invert,
        "force": force,
    }
    done_many(BatchRequest, folder, asked, out, match, workers, scheduler, retry_failed)
