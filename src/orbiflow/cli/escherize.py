"""`orbiflow escherize`: the command's options."""

from __future__ import annotations

import re
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from orbiflow.cli.work import do
from orbiflow.jobs import EscherizeRequest


class Method(StrEnum):
    """How tiles are fitted."""

    DESCENT = "descent"
    OCCUPANCY = "occupancy"


class Objective(StrEnum):
    """What a tile is to be good at."""

    LIKENESS = "likeness"
    OVERLAP = "overlap"
    BOTH = "both"


class Effort(StrEnum):
    """How long the descent searches."""

    FAST = "fast"
    NORMAL = "normal"
    BEST = "best"


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
    classes: Annotated[
        str, typer.Option(help="Isohedral classes, such as IH4,IH6, or all.")
    ] = "all",
    effort: Annotated[
        Effort | None,
        typer.Option(
            help="Seconds, a quarter of a minute, or minutes; default normal.", show_default=False
        ),
    ] = None,
    objective: Annotated[
        Objective | None,
        typer.Option(
            help="Likeness: the silhouette bends until it is a tile, every limb kept. Overlap: the "
            "tile covers the silhouette as it is. Both: a short list of the best compromises. Default "
            "likeness.",
            show_default=False,
        ),
    ] = None,
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
    per_class: Annotated[
        int, typer.Option(help="Tiles of each class, the best and others that differ from it.")
    ] = 1,
    min_neck: Annotated[
        float | None,
        typer.Option(
            help="Tiles with necks thinner than this rank lower; in square roots of the area, "
            "default 0.01.",
            show_default=False,
        ),
    ] = None,
    max_frequency: Annotated[
        int | None,
        typer.Option(
            help="Overlap: detail of the deformation (Omega in the paper), 0 to 60; default 10, or "
            "15 for effort best.",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Same seed, same machine: same tiles.")] = 0,
    method: Annotated[
        Method, typer.Option(help="The descent, or the paper's occupancy loss for comparison.")
    ] = Method.DESCENT,
    turns: Annotated[
        int | None,
        typer.Option(help="Occupancy: starting rotations, default 12.", show_default=False),
    ] = None,
    iterations: Annotated[
        int | None,
        typer.Option(help="Occupancy: steps of the fit, default 200.", show_default=False),
    ] = None,
    figures: Annotated[
        bool,
        typer.Option(
            "--figures",
            help="Also for print: tiling.pdf, overlay.pdf; and the flow: field.png, field.pdf.",
        ),
    ] = False,
    workers: Annotated[
        int | None, typer.Option(help="Processes; default one a core.", show_default=False)
    ] = None,
    threshold: Annotated[
        float | None,
        typer.Option(help="Level between shape and background, 0 to 1; default: found out."),
    ] = None,
    invert: Annotated[
        bool | None,
        typer.Option(
            "--invert/--no-invert", help="The shape is the light part; default: found out."
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Keep tiles that are not certified, marked so.")
    ] = False,
) -> None:
    """Find tiles that look like a silhouette and tile the plane, and prove it.

    Writes result.json, overview.png and index.html into the folder, and for each class a folder with
    tile.svg, tiling.svg, tiling.png, overlay.png and model.safetensors; after a search for both,
    front.png, too.
    """
    names = None if classes.strip().lower() == "all" else re.split(r"[,\s]+", classes)
    request = EscherizeRequest(
        image=image,
        out=out,
        classes=None if names is None else tuple(filter(None, names)),
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
