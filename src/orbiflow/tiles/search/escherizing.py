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
from orbiflow.errors import CertificationError, OrbiflowError, SettingError
from orbiflow.runtime import (
    NEVER,
    Cancel,
    Cancelled,
    Note,
    Sink,
    ignore,
    one_blas_thread,
    one_thread,
    process_context,
    work,
)
from orbiflow.settings import as_instance, described, is_a
from orbiflow.tiles.likeness import NearSymmetry, near_symmetry
from orbiflow.tiles.result_file import SCHEMA_VERSION, tile_json
from orbiflow.tiles.search.candidates import ClassFinalists, OnProgress, silent
from orbiflow.tiles.search.escherize_settings import EscherizeSettings
from orbiflow.tiles.search.finished_tiles import ClassFailure, best_tiles, rated
from orbiflow.tiles.search.likeness_search import LikenessSearch
from orbiflow.tiles.search.pair_record import PairRecord
from orbiflow.tiles.search.pair_search import PairSearch
from orbiflow.tiles.search.search_method import SYMMETRIC_CLASSES, Goal, SearchMethod, Sketches
from orbiflow.tiles.search.search_record import OnTile, Outcome, Record, without_twins
from orbiflow.tiles.silhouette import HOW_TO_GET_A_TARGET, Emphasis, Pins, Target
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
    if second is not None or settings.background:
        if method is not None:
            raise OrbiflowError(
                "a method of one's own searches for one silhouette; leave out second"
            )
        if second is not None and settings.background:
            raise SettingError("{background} takes the place of a second silhouette; leave one out")
        other = Goal.background() if second is None else settings.second_goal(second)
        search = settings.pair_search
        record = PairRecord((goal, other), search, on_tile, on_event)
        found = record.search(on_checked, cancel)
        seconds, known = time.perf_counter() - begin, (search, goal.emphasis, goal.pins)
        workers, left = search.workers, found.interrupted
        return SearchResult(
            target, found.tiles, found.failures, *known, seconds, workers, left, second=other
        )
    emphasis, pins = goal.emphasis, goal.pins
    method = method or settings.search_method
    task = _task(goal, method, settings.per_class, settings.force)
    near = _near_symmetry(target) if method.takes_symmetric else None
    names = _class_names(settings.classes, near)
    notes = list(goal.notes)
    if near is not None and near.stabiliser in SYMMETRIC_CLASSES:
        notes.append(_symmetry_note(near, names))
    workers = min(settings.workers or 1, len(names))
    shown = None if on_tile is None else _rating(on_tile, target)
    record = Record(names, on_event, shown, most=settings.per_class)
    with contextlib.suppress(Cancelled):
        _look_first(task, names, record, cancel)
        if on_checked is not None:
            on_checked()
        for note in notes:
            on_event(Note(note))
        _search_by_levels(task, names, workers, record, cancel)
    tiles, failures, left = record.finish()
    seconds = time.perf_counter() - begin
    return SearchResult(
        target, tiles, failures, method, emphasis, pins, seconds, workers, left, near
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
    found: list[str] = []
    for name in classes:
        if name.strip().lower() == "all":
            found += [*CLASSES, *itertools.chain(*SYMMETRIC_CLASSES.values())]
        else:
            found.append(isohedral_class(name).name)
    return list(dict.fromkeys(found))


def _symmetry_note(near: NearSymmetry, names: Sequence[str]) -> str:
    """Return a note on a silhouette near to symmetric, and which of its classes are searched."""
    what = "its mirror image" if near.stabiliser == "D1" else "itself turned by 180 degrees"
    own = [name for name in SYMMETRIC_CLASSES[near.stabiliser] if name in names]
    searched = f"{', '.join(own)} with exactly symmetric tiles" if own else "no class of such tiles"
    return (
        f"the silhouette is much like {what} (likeness {max(near):.2f}): {searched} "
        f"{'are' if len(own) > 1 else 'is'} searched"
    )


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
    task = _task(Goal(target), method, per_class, force)
    return _outcome(task, isohedral_class(kind), progress, cancel)


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
    task = _task(Goal(target, emphasis, pins), method or LikenessSearch.for_effort("normal"))
    with one_thread(), one_blas_thread():
        return task.method.fit(task.goal, isohedral_class(kind), per_class, progress, cancel)


@dataclass(frozen=True, eq=False)
class _Task:
    """What is to be done for each class."""

    goal: Goal
    method: SearchMethod
    per_class: int
    force: bool


def _task(goal: Goal, method: SearchMethod, per_class: int = 1, force: bool = False) -> _Task:
    """Return the task, checked, with what its method needs imported."""
    as_instance(goal.target, Target, "the target", HOW_TO_GET_A_TARGET)
    if not is_a(method, SearchMethod):
        raise OrbiflowError(
            f"the method must be a search such as LikenessSearch(), got {described(method)}; for a "
            'level of effort: LikenessSearch.for_effort("fast")'
        )
    if goal.pins is not None:
        as_instance(goal.pins, Pins, "pins", "Pins.read and Pins.at make one")
        if not method.takes_pins:
            raise OrbiflowError("pins belong to the search for likeness, where silhouettes bend")
    return _Task(goal, method, per_class, force)


def _rating(on_tile: OnTile, target: Target) -> OnTile:
    """Return a function that gives a tile its stars before it is shown."""
    return lambda tile, stage: on_tile(rated([tile], target)[0], stage)


SKETCHING = 0.1  # the share of the work that first looks are, if somebody watches


def _look_first(task: _Task, names: Sequence[str], record: Record, cancel: Cancel) -> None:
    """Show a certified tile of one of the classes in a moment, if the method can."""
    record.next_level("sketch", SKETCHING * (record.on_tile is not None))
    with one_thread(), one_blas_thread():
        first = task.method.preview(task.goal, names, cancel)
    if first is not None:
        record.first_look(first)


def _search_by_levels(
    task: _Task, names: Sequence[str], workers: int, record: Record, cancel: Cancel
) -> None:
    """Do the task for each class, one level of effort after another, each for the promising ones."""
    # asked before torch is limited here: a limit makes no fork safe
    preload = ("orbiflow.tiles.search.escherizing", type(task.method).__module__)
    context = process_context(preload) if workers > 1 else None

    def search(names: Sequence[str], method: SearchMethod, per_class: int) -> None:
        own = replace(task, method=method, per_class=per_class)
        if context is not None and len(names) > 1:
            _search_in_processes(own, names, workers, context, record, cancel)
            return
        for name in names:
            cancel.check()
            progress = functools.partial(record.progress, name)
            record.level_outcome(_outcome(own, isohedral_class(name), progress, cancel))

    method, rest = task.method, 1.0
    if record.on_tile is not None:
        rest -= SKETCHING
        search([name for name in names if name not in record.looks], Sketches(method), 1)
    levels = method.levels()
    for share, own in levels:
        is_last = own is levels[-1][1]
        record.next_level("final" if is_last else "better", share * rest)
        search(names, own, task.per_class)
        if not is_last:
            names = record.settled(names, method.is_promising)


def _search_in_processes(
    task: _Task, names: Sequence[str], workers: int, context: Any, record: Record, cancel: Cancel
) -> None:
    cancel.check()
    if context.get_start_method() == "fork":
        with one_thread(), one_blas_thread():
            task.method.prepare(task.goal)  # once, for all workers
    order = task.method.in_order(names)
    function = functools.partial(_work_on, task)
    with contextlib.closing(work(function, order, workers, context=context, cancel=cancel)) as news:
        for one in news:
            if one.done:
                record.level_outcome(one.value)
            else:
                record.progress(order[one.index], *one.value)


def _work_on(
    task: _Task, name: str, tell: Callable[[tuple[float, float]], None], cancel: Cancel
) -> Outcome:
    """Do the task for a class in a worker process."""
    return _outcome(task, isohedral_class(name), lambda share, loss: tell((share, loss)), cancel)


def _outcome(task: _Task, kind: IsohedralClass, progress: OnProgress, cancel: Cancel) -> Outcome:
    """Return the best certified tile of a class, which holds the others, or why there is none."""
    begin = time.perf_counter()
    try:
        chosen = _chosen_tiles(task, kind, progress, cancel)
    except CertificationError as error:
        return ClassFailure(kind.name, str(error))
    seconds = time.perf_counter() - begin
    best, *others = (tile.changed(search=replace(tile.search, seconds=seconds)) for tile in chosen)
    return best.changed(others=tuple(others))


def _chosen_tiles(
    task: _Task, kind: IsohedralClass, progress: OnProgress, cancel: Cancel
) -> list[EscherTile]:
    """Return the tiles of a class that are shown, best first, no two of them alike.

    They are those of the first goal that has some.

    Raises:
        CertificationError: If none has, with the first one's reason.
    """
    method, count = task.method, task.per_class

    def found(goal: Goal, share: float) -> list[EscherTile]:
        fit = method.fit(goal, kind, count, progress, cancel)
        tiles = best_tiles(
            goal.target,
            fit,
            force=task.force,
            min_neck=method.least_neck(goal),
            original=task.goal.target,
            smoothed=share,
        )
        cancel.check()
        return [tiles[k] for k in without_twins(tiles, count)]

    # many small systems: several threads would wait for each other, ten times as long as they work
    with one_thread(), one_blas_thread():
        reasons: list[CertificationError] = []
        for share, own in method.goals(task.goal):
            try:
                return found(own, share)
            except CertificationError as error:
                reasons.append(error)
        raise reasons[0]


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
