"""Read, fit, certify, draw: the job of an `EscherizeRequest`."""

from __future__ import annotations

import os
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from orbiflow.jobs.asked import given
from orbiflow.jobs.place import check_folder
from orbiflow.jobs.run import Sink
from orbiflow.jobs.tile_requests import EscherizeRequest
from orbiflow.runtime import (
    Cancel,
    ClassFailed,
    Finished,
    Note,
    Preview,
    Progress,
    RecordError,
    ResultFolder,
    State,
    TileFound,
    Written,
)
from orbiflow.tiles import (
    CLASSES,
    FIELD_FILES,
    OVERVIEW,
    BothSearch,
    ClassFailure,
    Emphasis,
    EscherTile,
    LikenessSearch,
    OccupancySearch,
    OverlapSearch,
    Pins,
    SearchMethod,
    Target,
    figure_files,
    fill_run,
    is_poor,
    isohedral_class,
    report,
    written_files,
)
from orbiflow.tiles.search import searching as search

POOR = (
    "even the first tile hardly looks like it; another pose, fewer or thicker limbs, all nine classes "
    "or more effort may do better"
)
"""Said where nothing that was found looks like the silhouette."""


def escherize(request: EscherizeRequest, tell: Sink, cancel: Cancel) -> Finished:
    """Search, and write the folder whole.

    A run that finishes no class with a tile leaves an earlier run's folder as it is.

    Returns:
        `summary`: `folder`, whether it was `written`, `seconds` in all, the `tiles` that it holds
        now (best first), and `failed`.

    Raises:
        OrbiflowError: for anything that the user can mend.
    """
    begin = time.perf_counter()
    found: list[EscherTile] = []
    names = _class_names(request.classes)
    settings = _settings(request)
    workers = min(request.workers or os.cpu_count() or 1, len(names))
    target, emphasis, pins = _read(request)
    folder = ResultFolder(request.out, written_files)
    masks = [Path(pin) for pin in request.pin or ()]
    check_folder(request.out, request.image, request.emphasis, *masks)
    for source in (target, emphasis, pins):
        for note in source.notes if source else ():
            tell(Note(note))
    results, failures = search.escherize(
        target,
        names,
        settings,
        emphasis=emphasis,
        pins=pins,
        per_class=request.per_class,
        workers=workers,
        force=request.force,
        watch=_Relay(names, tell, found),
        cancel=cancel,
    )
    document = report(
        target,
        results,
        failures,
        settings,
        seconds=time.perf_counter() - begin,
        workers=workers,
        emphasis=emphasis,
        pins=pins,
    )
    if document["objective"] == "both" and results:
        tell(Note(_chosen(results, found)))
    if results and is_poor(results[0]):
        tell(Note(POOR))
    interrupted = {failure.name for failure in failures if failure.reason == search.INTERRUPTED}
    # a first look at a class that was interrupted is less than an earlier run's tiles
    earlier = folder.has_a_run and (request.out / OVERVIEW).is_file()
    write = not earlier or any(result.isohedral_class not in interrupted for result in results)
    # processes are for figures alone; 0 is without
    figures = workers if request.figures else 0
    if write:
        _write(folder, document, results, failures, found, target, figures, tell)
    state: State = "done" if results else "nothing found"
    summary = {
        "folder": str(request.out),
        "written": write,
        "seconds": time.perf_counter() - begin,
        "tiles": [_row(result) for result in results if write],
        "failed": document["failed"],
    }
    return Finished("cancelled" if interrupted or cancel.cancelled else state, summary)


class _Relay:
    """A search's events as a job's; all tiles of all classes go into `found`."""

    def __init__(self, names: list[str], tell: Sink, found: list[EscherTile]) -> None:
        self.found = found
        self.shares = dict.fromkeys(names, 0.0)
        self.tell = tell
        self.begin = time.perf_counter()
        tell(Progress(0.0, "fitting"))

    def __call__(self, event: search.Event) -> None:
        name, outcome = event.name, event.outcome
        if event.preview is not None:
            seconds = time.perf_counter() - self.begin
            self.tell(Preview(name, event.preview.metrics.iou, seconds))
            return
        self.shares[name] = event.share
        share = sum(self.shares.values()) / len(self.shares)
        loss = event.loss if abs(event.loss) < float("inf") else None  # no NaN in JSON
        self.tell(Progress(share, "fitting", name, event.share, loss))
        if isinstance(outcome, ClassFailure):
            self.tell(ClassFailed(name, outcome.reason))
        elif outcome is not None:
            self.found += outcome.family()
            iou, certified = outcome.metrics.iou, outcome.certificate.valid
            self.tell(TileFound(name, iou, outcome.score, certified))


def _class_names(classes: tuple[str, ...] | None) -> list[str]:
    if classes is None:
        return list(CLASSES)
    if not classes:
        raise RecordError(f"{{classes}} names no class; the nine are {', '.join(CLASSES)}, or all")
    return list(dict.fromkeys(isohedral_class(name).name for name in classes))


def _settings(request: EscherizeRequest) -> SearchMethod:
    asked = given(request, ("max_frequency", "turns", "iterations"))
    if request.method == "occupancy":
        return OccupancySearch(seed=request.seed, **asked)
    effort, objective = request.effort or "normal", request.objective or "likeness"
    neck = LikenessSearch.min_neck if request.min_neck is None else request.min_neck
    bending = LikenessSearch.for_effort(effort, seed=request.seed, min_neck=neck)
    if objective == "likeness":
        return bending
    descent = OverlapSearch.for_effort(effort, seed=request.seed, min_neck=neck, **asked)
    return descent if objective == "overlap" else BothSearch(bending, descent)


def _read(request: EscherizeRequest) -> tuple[Target, Emphasis | None, Pins | None]:
    target = Target.read(request.image, threshold=request.threshold, invert=request.invert)
    if request.called is not None:
        target = replace(target, source=request.called)
    emphasis = pins = None
    if request.emphasis is not None:
        strength = {} if request.strength is None else {"strength": request.strength}
        emphasis = Emphasis.read(request.emphasis, target, **strength)
    if request.pin is not None:
        pins = Pins.read(request.pin, target, keep_angle=request.pin_angle)
    return target, emphasis, pins


def _write(
    folder: ResultFolder,
    document: dict[str, Any],
    results: list[EscherTile],
    failures: list[ClassFailure],
    found: list[EscherTile],
    target: Target,
    figures: int,
    tell: Sink,
) -> None:
    """All files, figures by so many processes. No cancelling: what was found is to be kept."""
    with folder.replaced() as staged:
        if results:
            tell(Note("drawing"))
            if figures and not any(FIELD_FILES[0] in figure_files(result) for result in results):
                tell(
                    Note("no flow made these tiles, so there is none to draw: the silhouette bent")
                )
        written = fill_run(
            staged,
            document,
            results,
            target,
            found=found,
            failures=failures,
            figures=figures > 0,
            workers=max(1, figures),
        )
    for path in written:
        tell(Written(folder.path / path))


def _chosen(results: list[EscherTile], found: list[EscherTile]) -> str:
    front = sum(result.front is True for result in results)
    text = f"{len(results)} of {len(found)} tiles are listed: {front} that no other beats in both "
    text += "deformation and overlap"
    return text if front == len(results) else f"{text}, {len(results) - front} near these"


def _row(result: EscherTile) -> dict[str, Any]:
    return {
        "class": result.isohedral_class,
        "group": result.group_name,
        "objective": result.objective,
        "deformation": result.deformation,
        "front": result.front,
        "score": result.score,
        "iou": result.metrics.iou,
        "dice": result.metrics.dice,
        "recognised": result.recognisability.score,
        "certified": result.certificate.valid,
        "edge_mismatch": _finite(result.certificate.edge_mismatch),
        "seconds": result.seconds,
    }


def _finite(value: float) -> float | None:
    return value if abs(value) < float("inf") else None
