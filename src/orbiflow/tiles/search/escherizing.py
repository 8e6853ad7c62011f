"""The search for tiles: from a silhouette and settings to certified tiles, and their `result.json`."""

from __future__ import annotations

import contextlib
import functools
import itertools
import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, cast

import numpy as np
import scipy
import shapely

from orbiflow import __version__
from orbiflow.errors import OrbiflowError, SettingError
from orbiflow.runtime import (
    NEVER,
    Cancel,
    Cancelled,
    Note,
    Sink,
    ignore,
    one_blas_thread,
    one_thread,
)
from orbiflow.settings import as_instance
from orbiflow.tiles.likeness import NearSymmetry, near_symmetry
from orbiflow.tiles.result_file import SCHEMA_VERSION, tile_json
from orbiflow.tiles.search.candidates import ClassFinalists, OnProgress, silent
from orbiflow.tiles.search.class_search import ClassSearch, ClassTask
from orbiflow.tiles.search.escherize_settings import EscherizeSettings
from orbiflow.tiles.search.finished_tiles import ClassFailure, rated
from orbiflow.tiles.search.likeness_search import LikenessSearch
from orbiflow.tiles.search.pair_record import PairRecord
from orbiflow.tiles.search.pair_search import PairSearch
from orbiflow.tiles.search.search_method import SYMMETRIC_CLASSES, Goal, SearchMethod
from orbiflow.tiles.search.search_record import OnTile, Outcome, Record
from orbiflow.tiles.silhouette import Emphasis, Pins, Target
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tilings import CLASSES, IsohedralClass, isohedral_class


@dataclass(frozen=True, eq=False)
class SearchResult:
    """What a search found.

    - `target`: The silhouette, of two the first.
    - `tiles`: Certified tiles, best first, with their ratings.
    - `failures`: The classes that gave none, and why.
    - `method`: The method that was used, with its settings.
    - `emphasis`, `pins`: What had to survive, and what did not bend.
    - `seconds`: How long it took.
    - `workers`: The number of processes.
    - `interrupted`: The classes that were not finished: each is a failure, or has its first tile alone.
    - `near_symmetry`: How near the silhouette is to symmetric, if the method asks.
    - `second`: The other silhouette, of two, with what had to survive and what did not bend.
    """

    target: Target
    tiles: Sequence[EscherTile] = ()
    failures: Sequence[ClassFailure] = ()
    method: SearchMethod | PairSearch = field(
        default_factory=lambda: LikenessSearch.for_effort("normal")
    )
    emphasis: Emphasis | None = None
    pins: Pins | None = None
    seconds: float = 0.0
    workers: int = 1
    interrupted: frozenset[str] = frozenset()
    near_symmetry: NearSymmetry | None = None
    second: Goal | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "tiles", rated(self.tiles, *self.targets))

    @property
    def targets(self) -> tuple[Target, ...]:
        """The silhouettes."""
        if self.second is None or self.second.is_background:
            return (self.target,)
        return (self.target, self.second.target)


def escherize(
    target: Target,
    settings: EscherizeSettings | None = None,
    *,
    second: Target | None = None,
    method: SearchMethod | None = None,
    emphasis: Emphasis | None = None,
    pins: Pins | None = None,
    on_checked: Callable[[], object] | None = None,
    on_tile: OnTile | None = None,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> SearchResult:
    """Find tiles that look like a silhouette and tile the plane, and certify them.

    With a second silhouette each tile is divided into two figures, one like each (design point 21).

    Args:
        target: The silhouette; `Target.read` reads one.
        settings: Which tiles are looked for, and how. Without `workers` the search stays in this
            process; a script that asks for more must work under `if __name__ == "__main__":`.
        second: The second silhouette, of two.
        method: A method of one's own, or with settings of its own, instead of the settings'.
        emphasis: What must survive, instead of the settings' mask.
        pins: What must not bend, instead of the settings'.
        on_checked: Called when all arguments have been checked and there is a first look, before the
            search.
        on_tile: Called in this thread with each certified tile and its stage, as soon as it is found:
            "sketch" for all classes first, "better" and, once for each class, "final". The
            search then takes a level of effort for all classes before the next.
        on_event: Called in this thread with each `Note`, `Progress`, `Preview`, `TileFound` and
            `ClassFailed`. What it raises ends the search.
        cancel: Ends the search early; what was found by then is returned, and the other classes are
            `interrupted`. It is looked at before each step of every fit.

    Returns:
        The same seed gives the same tiles, whatever the number of workers.

    Raises:
        OrbiflowError: For an unknown class, a mask that cannot be read, or workers that die.
    """
    begin = time.perf_counter()
    settings = as_instance(settings or EscherizeSettings(), EscherizeSettings, "settings")
    if second is None:
        settings.check_single()
    goal = settings.goal(target)
    goal = replace(goal, emphasis=emphasis or goal.emphasis, pins=pins or goal.pins)
    other, near = settings.second_goal(second) if second else None, None
    if settings.background:
        if second is not None:
            raise SettingError("{background} takes the place of a second silhouette; leave one out")
        other = Goal.background()
    if other is not None:
        if method is not None:
            raise OrbiflowError(
                "a method of one's own searches for one silhouette; leave out second"
            )
        search = PairRecord((goal, other), settings.pair_search, on_tile, on_event)
    else:
        method = method or settings.search_method
        task = ClassTask(goal, method, settings.per_class, settings.force)
        near = _near_symmetry(target) if method.takes_symmetric else None
        names = _class_names(settings.classes, near)
        shown = None if on_tile is None else _rating(on_tile, target)
        record = Record(names, on_event, shown, most=settings.per_class)
        notes = goal.notes + _symmetry_notes(near, names)
        search = ClassSearch(task, settings.workers or 1, notes, record)
    with contextlib.suppress(Cancelled):
        search.look_first(cancel)
        if on_checked is not None:
            on_checked()
        for note in search.notes:
            on_event(Note(note))
        search.search(cancel)
    tiles, failures, left = search.finish()
    return SearchResult(
        target,
        tiles,
        failures,
        search.method,
        goal.emphasis,
        goal.pins,
        time.perf_counter() - begin,
        search.workers,
        left,
        near,
        other,
    )


def searched_classes(target: Target, settings: EscherizeSettings) -> list[str]:
    """Return the names of the classes that a search with these settings looks at, in order."""
    asks = settings.search_method.takes_symmetric
    return _class_names(settings.classes, _near_symmetry(target) if asks else None)


@functools.lru_cache(maxsize=2)  # who asks for the classes searches next
def _near_symmetry(target: Target) -> NearSymmetry:
    with one_blas_thread():
        return near_symmetry(target.normal)


def _class_names(classes: Sequence[str] | None, near: NearSymmetry | None) -> list[str]:
    """Return the names of classes to search: by default the nine, and what suits the silhouette."""
    if classes is None:
        symmetric = SYMMETRIC_CLASSES.get(near.stabiliser, ()) if near else ()
        classes = (*CLASSES, *symmetric)
    names: list[str] = []
    for name in classes:
        if name.strip().lower() == "all":
            names += [*CLASSES, *itertools.chain(*SYMMETRIC_CLASSES.values())]
        else:
            names.append(isohedral_class(name).name)
    return list(dict.fromkeys(names))


def _symmetry_notes(near: NearSymmetry | None, names: Sequence[str]) -> list[str]:
    """Return a note on a silhouette near to symmetric, and which of its classes are searched."""
    if near is None or near.stabiliser not in SYMMETRIC_CLASSES:
        return []
    what = "its mirror image" if near.stabiliser == "D1" else "itself turned by 180 degrees"
    classes = [name for name in SYMMETRIC_CLASSES[near.stabiliser] if name in names]
    searched = (
        f"{', '.join(classes)} with exactly symmetric tiles"
        if classes
        else "no class of such tiles"
    )
    return [
        f"the silhouette is much like {what} (likeness {max(near):.2f}): {searched} "
        f"{'are' if len(classes) > 1 else 'is'} searched"
    ]


def _rating(on_tile: OnTile, target: Target) -> OnTile:
    """Return a function that gives a tile its stars before it is shown."""
    return lambda tile, stage: on_tile(rated([tile], target)[0], stage)


def escherize_class(
    target: Target,
    kind: IsohedralClass | str | int,
    method: SearchMethod,
    *,
    per_class: int = 1,
    force: bool = False,
    progress: OnProgress = silent,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Fit and certify one class in this process, on one thread, without a first look.

    `progress` is called with the share of the work done, and the best loss so far.

    Raises:
        Cancelled: If the token was cancelled.
    """
    task = ClassTask(Goal(target), method, per_class, force)
    return task.outcome(isohedral_class(kind), progress, cancel)


def fit_tile(
    target: Target,
    kind: IsohedralClass | str | int,
    method: SearchMethod | None = None,
    *,
    emphasis: Emphasis | None = None,
    pins: Pins | None = None,
    per_class: int = 1,
    progress: OnProgress = silent,
    cancel: Cancel = NEVER,
) -> ClassFinalists:
    """Fit tiles of one class to a target, in this process; `certified_tiles` makes polygons of them.

    `escherize` does both, for several classes. This is for those who look at, or go on with, what
    was fitted: `Fit.model` is a `TileModel`, a torch module whose candidates may be trained on.
    `progress` is called with the share of the work done, and the best loss so far.

    Raises:
        OrbiflowError: For an argument that cannot be used.
        CertificationError: If no candidate is left.
        Cancelled: If the token was cancelled.

    >>> boot = Target.from_polygon([[0, 0], [3, 0], [3.4, 1.2], [2.2, 1.5], [2, 2.8], [0.8, 2.5]])
    >>> few = LikenessSearch(placements=10, held=3, finalists=1, rounds=2)
    >>> from orbiflow.tiles import certified_tiles
    >>> best, *_ = certified_tiles(boot, fit_tile(boot, "IH4", few))
    >>> best.name, best.certificate.valid
    ('IH4', True)
    """
    task = ClassTask(Goal(target, emphasis, pins), method or LikenessSearch.for_effort("normal"))
    with one_thread(), one_blas_thread():
        return task.method.fit(task.goal, isohedral_class(kind), per_class, progress, cancel)


def _second_report(goal: Goal) -> dict[str, Any] | None:
    """Return what was asked of the second figure; None of a background, which may be anything."""
    if goal.is_background:
        return None
    return {
        "input": goal.target.report(),
        "emphasis": None if goal.emphasis is None else goal.emphasis.report(),
        "pins": None if goal.pins is None else goal.pins.report(),
    }


def report(result: SearchResult) -> dict[str, Any]:
    """Return the whole document, ready for JSON, tiles best first."""
    tiles, method, near = result.tiles, result.method, result.near_symmetry
    core_seconds = sum({tile.isohedral_class: tile.search.seconds for tile in tiles}.values())
    return {
        "schema_version": SCHEMA_VERSION,
        "method": method.method_name,
        "objective": method.objective,
        "seed": method.seed,
        "settings": asdict(cast(Any, method)),
        "versions": {
            "orbiflow": __version__,
            "python": platform.python_version(),
            "numpy": np.__version__,
            "scipy": scipy.__version__,
            "shapely": shapely.__version__,
        },
        "timings": {
            "wall_seconds": round(result.seconds, 3),
            "core_seconds": round(core_seconds, 3),
            "workers": result.workers,
        },
        "input": result.target.report(),
        **({} if result.second is None else {"second": _second_report(result.second)}),
        "near_symmetry": None if near is None else near._asdict(),
        "emphasis": None if result.emphasis is None else result.emphasis.report(),
        "pins": None if result.pins is None else result.pins.report(),
        "tiles": [tile_json(tile) for tile in tiles],
        "failed": [{"class": f.name, "reason": f.reason} for f in result.failures],
    }
