"""`orbiflow escherize`: a silhouette in, certified tiles and their pictures out."""

from __future__ import annotations

import json
import os
import re
import time
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from orbiflow.cli.console import errors, output
from orbiflow.cli.progress import watched
from orbiflow.draw import write_atomic
from orbiflow.draw.folder import make_folder
from orbiflow.draw.gallery import write_gallery
from orbiflow.errors import OrbiflowError
from orbiflow.escher import ClassFailure, OccupancySettings, Target, TileResult
from orbiflow.escher import escherize as search
from orbiflow.escher.report import report
from orbiflow.tilings import CLASSES, isohedral_class


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
    begin = time.perf_counter()
    names = _class_names(classes)
    settings = OccupancySettings(
        max_frequency=max_frequency, seed=seed, turns=turns, iterations=iterations
    )
    count = min(_workers(workers), len(names))
    target = Target.read(image, threshold=threshold, invert=invert)
    make_folder(out)
    for note in target.notes:
        output.print(f"  {note}", highlight=False)
    with watched(names) as watch:
        results, failures = search(target, names, settings, workers=count, force=force, watch=watch)
    seconds = time.perf_counter() - begin
    document = report(target, results, failures, settings, seconds=seconds, workers=count)
    write_atomic(out / "result.json", json.dumps(document, allow_nan=False))
    if results:
        with output.status("drawing"):
            write_gallery(results, target, out, workers=count)
        output.print(_table(results))
    for failure in failures:
        _explain(failure)
    total = time.perf_counter() - begin
    if not results:
        errors.print(f"no certified tile was found; see {out / 'result.json'}")
        raise typer.Exit(1)
    output.print(f"written to {out} in {total:.0f} s; look at {out / 'overview.png'} first")


def _class_names(text: str) -> list[str]:
    if text.strip().lower() == "all":
        return list(CLASSES)
    parts = [part for part in re.split(r"[,\s]+", text) if part]
    if not parts:
        raise OrbiflowError(f"--classes names no class; the nine are {', '.join(CLASSES)}, or all")
    return [isohedral_class(part).name for part in parts]


def _workers(asked: int | None) -> int:
    if asked is not None and asked < 1:
        raise OrbiflowError(f"--workers must be at least 1, got {asked}")
    return asked or os.cpu_count() or 1


def _table(results: list[TileResult]) -> Table:
    table = Table(title="Tiles, best first")
    for column in ("class", "group", "IoU", "Dice", "Hausdorff", "certified", "edges", "seconds"):
        table.add_column(column, justify="left" if column in ("class", "group") else "right")
    for result in results:
        metrics, certificate = result.metrics, result.certificate
        table.add_row(
            result.name,
            result.group_name,
            f"{metrics.iou:.4f}",
            f"{metrics.dice:.4f}",
            f"{metrics.hausdorff:.3f}",
            "yes" if certificate.valid else "[red]NO[/]",
            f"{certificate.edge_mismatch:.0e}",
            f"{result.seconds:.1f}",
        )
    return table


def _explain(failure: ClassFailure) -> None:
    errors.print(f"{failure.name}: no tile: {failure.reason}", highlight=False, soft_wrap=True)
