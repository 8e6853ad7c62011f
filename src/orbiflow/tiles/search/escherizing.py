"""The search for tiles: from a silhouette and settings to certified tiles, and their `result.json`."""

from __future__ import annotations

import math
import platform
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from typing import Any, cast

import numpy as np
import shapely

from orbiflow import __version__
from orbiflow.arguments import as_instance
from orbiflow.runtime import Cancel, ClassFailed, Note, Preview, Progress, Sink, TileFound, ignore
from orbiflow.tiles.result_file import SCHEMA_VERSION, tile_json
from orbiflow.tiles.search.certifying import ClassFailure
from orbiflow.tiles.search.escherize_settings import EscherizeSettings
from orbiflow.tiles.search.likeness_search import LikenessSearch
from orbiflow.tiles.search.method import SearchMethod
from orbiflow.tiles.search.searching import INTERRUPTED, Event, class_list, search_classes
from orbiflow.tiles.silhouette import Emphasis, Pins, Target
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tilings import CLASSES


@dataclass(frozen=True, eq=False)
class SearchResult:
    """What a search found.

    - `target`: The silhouette.
    - `tiles`: Certified tiles, best first; after a search for both those for likeness come first.
    - `failures`: The classes that gave none, and why.
    - `found`: All tiles that were found, those that are not listed among them.
    - `method`: The method that was used, with its settings.
    - `emphasis`, `pins`: What had to survive, and what did not bend.
    - `seconds`: How long it took.
    - `workers`: The number of processes.
    """

    target: Target
    tiles: Sequence[EscherTile] = ()
    failures: Sequence[ClassFailure] = ()
    found: Sequence[EscherTile] = ()
    method: SearchMethod = field(default_factory=lambda: LikenessSearch.for_effort("normal"))
    emphasis: Emphasis | None = None
    pins: Pins | None = None
    seconds: float = 0.0
    workers: int = 1

    @property
    def interrupted(self) -> frozenset[str]:
        """The classes that were not finished."""
        return frozenset(f.name for f in self.failures if f.reason == INTERRUPTED)


def escherize(
    target: Target,
    settings: EscherizeSettings | None = None,
    *,
    method: SearchMethod | None = None,
    emphasis: Emphasis | None = None,
    pins: Pins | None = None,
    on_event: Sink = ignore,
    cancel: Cancel | None = None,
) -> SearchResult:
    """Find tiles that look like a silhouette and tile the plane, and certify them.

    Args:
        target: The silhouette; `Target.read` reads one.
        settings: Which tiles are looked for, and how. Without `workers` the search stays in this
            process; a script that asks for more must work under `if __name__ == "__main__":`.
        method: A method of one's own, or with settings of its own, instead of the settings'.
        emphasis: What must survive, instead of the settings' mask.
        pins: What must not bend, instead of the settings'.
        on_event: Called in this thread with each `Note`, `Progress`, `Preview`, `TileFound` and
            `ClassFailed`. What it raises ends the search.
        cancel: Ends the search early; what was found by then is returned, and the other classes are
            `interrupted`.

    Returns:
        The same seed gives the same tiles, whatever the number of workers.

    Raises:
        OrbiflowError: For an unknown class, a mask that cannot be read, or workers that die.
    """
    begin = time.perf_counter()
    as_instance(target, Target, "the target", "Target.read and Target.from_polygon make one")
    settings = as_instance(settings or EscherizeSettings(), EscherizeSettings, "settings")
    if emphasis is None and settings.emphasis is not None:
        strength = {} if settings.strength is None else {"strength": settings.strength}
        emphasis = Emphasis.read(settings.emphasis, target, **strength)
    if pins is None and settings.pin is not None:
        pins = Pins.read(settings.pin, target, keep_angle=settings.pin_angle)
    for source in (emphasis, pins):
        for note in source.notes if source else ():
            on_event(Note(note))
    method = method or settings.search_method
    names = class_list(CLASSES if settings.classes is None else settings.classes)
    workers = min(settings.workers or 1, len(names))
    relay = _Relay(names, on_event)
    tiles, failures = search_classes(
        target,
        names,
        method,
        emphasis=emphasis,
        pins=pins,
        per_class=settings.per_class,
        workers=workers,
        force=settings.force,
        watch=relay,
        cancel=cancel,
    )
    seconds = time.perf_counter() - begin
    return SearchResult(
        target, tiles, failures, relay.found, method, emphasis, pins, seconds, workers
    )


class _Relay:
    """The events of a search for those who watch; all tiles of all classes go into `found`."""

    def __init__(self, names: Sequence[str], on_event: Sink) -> None:
        self.found: list[EscherTile] = []
        self.shares = dict.fromkeys(names, 0.0)
        self.on_event = on_event
        self.begin = time.perf_counter()
        on_event(Progress(0.0, "fitting"))

    def __call__(self, event: Event) -> None:
        name, outcome = event.name, event.outcome
        if event.preview is not None:
            seconds = time.perf_counter() - self.begin
            self.on_event(Preview(name, event.preview.metrics.iou, seconds))
            return
        self.shares[name] = event.share
        share = sum(self.shares.values()) / len(self.shares)
        loss = event.loss if math.isfinite(event.loss) else None  # no NaN in JSON
        self.on_event(Progress(share, "fitting", name, event.share, loss))
        if isinstance(outcome, ClassFailure):
            self.on_event(ClassFailed(name, outcome.reason))
        elif outcome is not None:
            self.found += outcome.family()
            iou, certified = outcome.metrics.iou, outcome.certificate.valid
            self.on_event(TileFound(name, iou, outcome.score, certified))


def report(result: SearchResult) -> dict[str, Any]:
    """Return the whole document, ready for JSON, tiles best first."""
    tiles, method = result.tiles, result.method
    core_seconds = sum({tile.isohedral_class: tile.seconds for tile in tiles}.values())
    return {
        "schema_version": SCHEMA_VERSION,
        "method": method.method_name,
        "objective": method.objective,
        "seed": method.seed,
        "settings": asdict(cast(Any, method)),
        "versions": {
            "orbiflow": __version__,
            "python": platform.python_version(),
            "torch": version("torch"),
            "numpy": np.__version__,
            "shapely": shapely.__version__,
        },
        "timings": {
            "wall_seconds": round(result.seconds, 3),
            "core_seconds": round(core_seconds, 3),
            "workers": result.workers,
        },
        "input": result.target.report(),
        "emphasis": None if result.emphasis is None else result.emphasis.report(),
        "pins": None if result.pins is None else result.pins.report(),
        "tiles": [tile_json(tile) for tile in tiles],
        "failed": [{"class": f.name, "reason": f.reason} for f in result.failures],
    }
