"""`orbiflow escherize`: the command's options."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

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
from orbiflow.cli.work import do
from orbiflow.jobs import EscherizeRequest


def escherize(
    image: Annotated[
        Path,
        typer.Argument(
            help="The silhouette: PNG, JPEG, WebP, SVG, or a polygon (.json, .dat).",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path, typer.Option("--out", "-o", help="Folder for the results, made if need be.")
    ] = Path("out"),
    classes: Classes = "all",
    effort: ChosenEffort = None,
    objective: ChosenObjective = None,
    emphasis: Annotated[
        Path | None,
        typer.Option(
            help="A mask, white where the silhouette must survive: a head, a tail.",
            show_default=False,
        ),
    ] = None,
    strength: Annotated[
        float | None,
        typer.Option(
            help="How many times more the mask's white part counts; default 4.",
            show_default=False,
        ),
    ] = None,
    pin: Annotated[
        list[str] | None,
        typer.Option(
            help="What must keep its shape while the rest bends: x,y or x,y,radius in the input's "
            "coordinates, or a mask, white where pinned; may be repeated.",
            show_default=False,
        ),
    ] = None,
    pin_angle: Annotated[
        bool, typer.Option("--pin-angle", help="What is pinned keeps its angle, too.")
    ] = False,
    per_class: PerClass = 1,
    min_neck: MinNeck = None,
    max_frequency: MaxFrequency = None,
    seed: Seed = 0,
    method: ChosenMethod = Method.DESCENT,
    turns: Turns = None,
    iterations: Iterations = None,
    figures: Figures = False,
    workers: Annotated[
        int | None, typer.Option(help="Processes; default one a core.", show_default=False)
    ] = None,
    threshold: Threshold = None,
    invert: Invert = None,
    force: Force = False,
) -> None:
    """Find tiles that look like a silhouette and tile the plane, and prove it.

    Writes result.json, overview.png and index.html into the folder, and for each class a folder with
    tile.svg, tiling.svg, tiling.png, overlay.png and model.safetensors; after a search for both,
    front.png, too.
    """
    request = EscherizeRequest(
        image=image,
        out=out,
        classes=named_classes(classes),
        method=method.value,
        objective=objective.value if objective else None,
        min_neck=min_neck,
        effort=effort.value if effort else None,
        emphasis=emphasis,
        strength=strength,
        pin=tuple(pin) if pin else None,
        pin_angle=pin_angle,
        per_class=per_class,
        max_frequency=max_frequency,
        seed=seed,
        turns=turns,
        iterations=iterations,
        figures=figures,
        workers=workers,
        threshold=threshold,
        invert=invert,
        force=force,
    )
    do(request)
