"""`orbiflow escherize`: the command's options. The work is imported when it runs: --help is quick."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Method(StrEnum):
    """How tiles are fitted."""

    OCCUPANCY = "occupancy"


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
    max_frequency: Annotated[
        int, typer.Option(help="Detail of the deformation (Omega in the paper), 1 to 60.")
    ] = 10,
    seed: Annotated[int, typer.Option(help="Same seed, same machine: same tiles.")] = 0,
    method: Annotated[  # noqa: ARG001 - one so far; results name it
        Method, typer.Option(help="How tiles are fitted.")
    ] = Method.OCCUPANCY,
    turns: Annotated[int, typer.Option(help="Starting rotations of each template.")] = 12,
    iterations: Annotated[
        int, typer.Option(help="Steps of the fit: more is better, slower.")
    ] = 200,
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

    Writes result.json and overview.png into the folder, and for each class a folder with tile.svg,
    tiling.svg, tiling.png, overlay.png, field.png and model.safetensors.
    """
    from orbiflow.cli.escherize_run import Request, run

    run(
        Request(
            image=image,
            out=out,
            classes=classes,
            max_frequency=max_frequency,
            seed=seed,
            turns=turns,
            iterations=iterations,
            workers=workers,
            threshold=threshold,
            invert=invert,
            force=force,
        )
    )
