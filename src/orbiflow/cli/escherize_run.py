"""What `orbiflow escherize` does."""

from __future__ import annotations

import json
import os
import re
import time
from dataclasses import dataclass
from pathlib import Path

import torch
import typer
from rich.table import Table

from orbiflow.cli.console import errors, output
from orbiflow.cli.interrupts import stopped_by_interrupt
from orbiflow.cli.progress import watched
from orbiflow.errors import OrbiflowError
from orbiflow.escher import ClassFailure, DescentSettings, OccupancySettings, TileResult
from orbiflow.escher import escherize as search
from orbiflow.escher.methods import Settings
from orbiflow.escher.report import report
from orbiflow.escher.search import INTERRUPTED
from orbiflow.export.gallery import write_gallery
from orbiflow.files import make_folder, write_atomic
from orbiflow.silhouette import Emphasis, Target
from orbiflow.tilings import CLASSES, isohedral_class


@dataclass(frozen=True)
class Request:
    """The options of the command."""

    image: Path
    out: Path
    classes: str
    method: str
    effort: str | None
    emphasis: Path | None
    strength: float | None
    per_class: int
    max_frequency: int | None
    seed: int
    turns: int | None
    iterations: int | None
    workers: int | None
    threshold: float | None
    invert: bool | None
    force: bool


def run(request: Request) -> None:
    """Read, fit, certify, draw, and say what came of it.

    Raises:
        OrbiflowError: for anything that the user can mend.
        typer.Exit: with status 1 if no class gave a certified tile.
    """
    begin = time.perf_counter()
    names = _class_names(request.classes)
    settings = _settings(request)
    torch.set_num_threads(1)  # many small operations; and workers may be forked
    count = min(_workers(request.workers), len(names))
    target = Target.read(request.image, threshold=request.threshold, invert=request.invert)
    emphasis = None
    if request.emphasis is not None:
        strength = {} if request.strength is None else {"strength": request.strength}
        emphasis = Emphasis.read(request.emphasis, target, **strength)
    out = make_folder(request.out)
    for note in (*target.notes, *(emphasis.notes if emphasis else ())):
        output.print(f"  {note}", highlight=False, soft_wrap=True)
    with stopped_by_interrupt() as cancel, watched(names) as watch:
        results, failures = search(
            target,
            names,
            settings,
            emphasis=emphasis,
            per_class=request.per_class,
            workers=count,
            force=request.force,
            watch=watch,
            cancel=cancel,
        )
    seconds = time.perf_counter() - begin
    document = report(
        target, results, failures, settings, seconds=seconds, workers=count, emphasis=emphasis
    )
    write_atomic(out / "result.json", json.dumps(document, allow_nan=False))
    if results:
        output.print("  drawing")
        write_gallery(results, target, out, workers=count)
        output.print(_table(results))
    interrupted = any(failure.reason == INTERRUPTED for failure in failures)
    for failure in failures:
        _explain(failure)
    if not results and not interrupted:
        errors.print(f"no certified tile was found; see {out / 'result.json'}", soft_wrap=True)
        raise typer.Exit(1)
    if results:
        total = time.perf_counter() - begin
        # a path broken over two lines cannot be copied
        output.print(
            f"written to {out} in {total:.0f} s; look at {out / 'overview.png'} first",
            soft_wrap=True,
        )
    if interrupted:
        raise typer.Exit(130)


def _settings(request: Request) -> Settings:
    """Of the method asked for.

    Raises:
        OrbiflowError: for values out of range, and for options of the other method.
    """
    if request.per_class < 1:
        raise OrbiflowError(f"--per-class must be at least 1, got {request.per_class}")
    asked = {
        name: value
        for name in ("max_frequency", "turns", "iterations")
        if (value := getattr(request, name)) is not None
    }
    if request.strength is not None and request.emphasis is None:
        raise OrbiflowError("--strength needs --emphasis: the mask that it belongs to")
    if request.method == "occupancy":
        for name in ("emphasis", "effort"):
            if getattr(request, name) is not None:
                raise OrbiflowError(f"--{name} belongs to --method descent")
        return OccupancySettings(seed=request.seed, **asked)
    for name in ("turns", "iterations"):
        if name in asked:
            raise OrbiflowError(
                f"--{name} belongs to --method occupancy; the descent has --effort instead"
            )
    return DescentSettings.for_effort(request.effort or "normal", seed=request.seed, **asked)


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
    for column in ("class", "score", "IoU", "Dice", "recognised", "certified", "edges", "s"):
        table.add_column(column, justify="left" if column == "class" else "right", no_wrap=True)
    for result in results:
        metrics, certificate = result.metrics, result.certificate
        table.add_row(
            f"{result.name} ({result.group_name})",
            f"{result.score:.3f}",
            f"{metrics.iou:.4f}",
            f"{metrics.dice:.4f}",
            f"{result.recognisability.score:.3f}",
            "yes" if certificate.valid else "[red]NO[/]",
            f"{certificate.edge_mismatch:.0e}",
            f"{result.seconds:.1f}",
        )
    return table


def _explain(failure: ClassFailure) -> None:
    what = "interrupted" if failure.reason == INTERRUPTED else f"no tile: {failure.reason}"
    errors.print(f"{failure.name}: {what}", highlight=False, soft_wrap=True)
