"""Escherization over several classes, one process each."""

from __future__ import annotations

import contextlib
import functools
import time
from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from orbiflow.arguments import as_instance, described, is_a
from orbiflow.errors import CertificationError, OrbiflowError
from orbiflow.runtime import Cancel, Cancelled, one_thread, process_context, work
from orbiflow.tiles.likeness import diverse, mutual_iou
from orbiflow.tiles.search.both_search import ALIKE
from orbiflow.tiles.search.candidates import Fit, Progress
from orbiflow.tiles.search.certifying import HOW, ClassFailure, best_tiles
from orbiflow.tiles.search.likeness_search import LikenessSearch
from orbiflow.tiles.search.method import Goal, SearchMethod
from orbiflow.tiles.silhouette import Emphasis, Pins, Target
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tilings import CLASSES, IsohedralClass, isohedral_class

INTERRUPTED = "interrupted"  # the reason given for a class that was left undone

ClassName = str | int | IsohedralClass
"""What `isohedral_class` takes."""

Watcher = Callable[["Event"], None]
Outcome = EscherTile | ClassFailure


@dataclass(frozen=True)
class Event:
    """News from a search, told in the thread that called `search_classes`.

    First comes at most one event with a `preview`; then, of each class, any number of events whose
    `share` never falls and exactly one with its `outcome`, those of several classes in any mixture.
    Classes that a `Cancel` left undone have their outcome last, in the order asked for.

    - `name`: The class.
    - `share`: The share of the class's work that is done; 1 at its end, unless it was interrupted.
    - `loss`: The best so far in the method's own measure; for the descent 1 - IoU.
    - `outcome`: What the class gave.
    - `preview`: A first certified tile, which the search is going to improve on.
    """

    name: str
    share: float
    loss: float
    outcome: Outcome | None = None
    preview: EscherTile | None = None


@dataclass(frozen=True, eq=False)
class Task:
    """What is to be done for each class: arguments as in `search_classes`."""

    goal: Goal
    method: SearchMethod
    per_class: int = 1
    force: bool = False


def fit_tile(
    target: Target,
    kind: IsohedralClass | str | int,
    method: SearchMethod | None = None,
    *,
    emphasis: Emphasis | None = None,
    pins: Pins | None = None,
    per_class: int = 1,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Fit:
    """Fit tiles of one class to a target, in this process; `certified_tiles` makes polygons of them.

    `escherize` does both, for several classes. This is for those who look at, or go on with, what
    was fitted: `Fit.model` is a `TileModel`, a torch module whose candidates may be trained on.
    Arguments are as in `search_classes`; `progress` is called with the share of the work done, and
    the loss.

    Raises:
        OrbiflowError: for an argument that cannot be used.
        CertificationError: if no candidate is left.
        Cancelled: if it was told to stop.

    >>> boot = Target.from_polygon([[0, 0], [3, 0], [3.4, 1.2], [2.2, 1.5], [2, 2.8], [0.8, 2.5]])
    >>> few = LikenessSearch(placements=10, held=3, finalists=1, rounds=2)
    >>> from orbiflow.tiles import certified_tiles
    >>> best, *_ = certified_tiles(boot, fit_tile(boot, "IH4", few))
    >>> best.name, best.certificate.valid
    ('IH4', True)
    """
    task = _task(target, method, emphasis, pins, per_class)
    with one_thread():
        return task.method.fit(
            task.goal, isohedral_class(kind), per_class=per_class, progress=progress, cancel=cancel
        )


def _task(
    target: Target,
    method: SearchMethod | None,
    emphasis: Emphasis | None,
    pins: Pins | None,
    per_class: int = 1,
    force: bool = False,
) -> Task:
    """Return the task, checked, by default for likeness, with what its method needs imported."""
    as_instance(target, Target, "the target", HOW)
    if method is None:
        method = LikenessSearch.for_effort("normal")
    if not is_a(method, SearchMethod):
        raise OrbiflowError(
            f"the method must be a search such as LikenessSearch(), got {described(method)}; for a "
            'level of effort: LikenessSearch.for_effort("fast")'
        )
    if pins is not None:
        as_instance(pins, Pins, "pins", "Pins.read and Pins.at make one")
        if not method.takes_pins:
            raise OrbiflowError("pins belong to the search for likeness, where silhouettes bend")
    method.load()
    return Task(Goal(target, emphasis, pins), method, per_class, force)


def search_classes(
    target: Target,
    classes: ClassName | Iterable[ClassName] = tuple(CLASSES),
    method: SearchMethod | None = None,
    *,
    emphasis: Emphasis | None = None,
    pins: Pins | None = None,
    per_class: int = 1,
    workers: int = 1,
    force: bool = False,
    watch: Watcher | None = None,
    cancel: Cancel | None = None,
) -> tuple[list[EscherTile], list[ClassFailure]]:
    """Fit a tile of each class to the target, with a method and events of one's own; see `escherize`.

    Args:
        target: The silhouette.
        classes: The name of one, such as "IH4", or several; each is done once, in its own process.
        method: How to search. Default: `LikenessSearch` of normal effort.
        emphasis: What must survive; the occupancy method takes no notice.
        pins: What must not bend, in the search for likeness.
        per_class: Tiles of each class at most, no two of them with a mutual IoU of .9; in a search
            for both, those of either kind that it chooses from, at least three.
        workers: Processes; 1 stays in this process. A script that asks for more must do its work
            under `if __name__ == "__main__":`, as always with multiprocessing.
        force: Return tiles that are not certified, too; their certificates say why.
        watch: Called in this thread with every `Event`. What it raises ends the search and comes out
            of this function; so does `KeyboardInterrupt`.
        cancel: Ends the search early; looked at before each step of every fit.

    Returns:
        Certified tiles, best first, and the classes that gave none, with the reason `INTERRUPTED` for
        those that were not finished. Of `BothSearch` at most twelve tiles in all, those for likeness
        first. The same seed gives the same tiles, whatever the number of workers.

    Raises:
        OrbiflowError: for an unknown class, a setting out of range, or workers that die.
    """
    names = class_list(classes)
    if not names:
        raise OrbiflowError(f"no isohedral class was given; the nine are {', '.join(CLASSES)}")
    for what, number in (("workers", workers), ("per_class", per_class)):
        if number < 1:
            raise OrbiflowError(f"{what} must be at least 1, got {number}")
    task = _task(target, method, emphasis, pins, per_class, force)
    cancel = cancel or Cancel()
    teller = _Teller(watch or (lambda _event: None))
    count = min(workers, len(names))
    # asked before torch is limited here: a limit makes no fork safe
    preload = ("orbiflow.tiles.search.searching", *task.method.modules)
    context = process_context(preload) if count > 1 else None
    with contextlib.suppress(Cancelled):
        with one_thread():
            first = task.method.preview(task.goal, names, cancel)
        if first is not None:
            teller.tell(Event(first.name, 0.0, 1 - first.metrics.iou, preview=first))
        if context is None:
            for name in names:
                cancel.check()
                teller.tell(_finished(_work_on(task, name, teller.tell, cancel)))
        else:
            with contextlib.closing(_run_pool(task, names, count, context, cancel)) as found:
                for event in found:
                    teller.tell(event)
    teller.interrupted(names)
    results, failures = teller.sorted(names)
    return task.method.short_list(results), failures


def class_list(classes: ClassName | Iterable[ClassName]) -> list[str]:
    """Return the names of classes, each once."""
    if isinstance(classes, str | int | IsohedralClass):
        classes = [classes]
    if not is_a(classes, Iterable):
        raise OrbiflowError(
            f'classes must be a name such as "IH4", or a list of them, got {described(classes)}'
        )
    return list(dict.fromkeys(isohedral_class(name).name for name in classes))


def escherize_class(
    target: Target,
    name: str,
    method: SearchMethod,
    *,
    emphasis: Emphasis | None = None,
    pins: Pins | None = None,
    per_class: int = 1,
    force: bool = False,
    watch: Watcher | None = None,
    cancel: Cancel | None = None,
) -> Outcome:
    """Fit and certify one class in this process, on one thread; arguments as in `search_classes`.

    Raises:
        Cancelled: if it was told to stop.
    """
    task = _task(target, method, emphasis, pins, per_class, force)
    return _work_on(task, name, watch or (lambda _event: None), cancel or Cancel())


class _Teller:
    """Keeps what was found, and the order of events."""

    def __init__(self, watch: Watcher) -> None:
        self.watch = watch
        self.shares: dict[str, float] = {}
        self.outcomes: dict[str, Outcome] = {}
        self.preview: EscherTile | None = None

    def tell(self, event: Event) -> None:
        share = max(event.share, self.shares.get(event.name, 0.0))
        self.shares[event.name] = share
        if event.outcome is not None:  # kept before it is told
            self.outcomes[event.name] = event.outcome
        self.preview = event.preview or self.preview
        self.watch(event if share == event.share else replace(event, share=share))

    def interrupted(self, names: Sequence[str]) -> None:
        """Outcomes for classes that have none."""
        for name in names:
            if name not in self.outcomes:
                failure = ClassFailure(name, INTERRUPTED)
                self.tell(Event(name, self.shares.get(name, 0.0), float("nan"), failure))

    def sorted(self, names: Sequence[str]) -> tuple[list[EscherTile], list[ClassFailure]]:
        """Tiles, best first, those for likeness before those for overlap; and failures."""
        failures = [o for o in self.outcomes.values() if isinstance(o, ClassFailure)]
        best = [o for o in self.outcomes.values() if isinstance(o, EscherTile)]
        if self.preview and ClassFailure(self.preview.name, INTERRUPTED) in failures:
            best.append(self.preview)
        results = [tile for first in best for tile in first.family()]
        results.sort(key=lambda r: (r.objective != "likeness", -r.score, names.index(r.name)))
        return results, failures


def _work_on(task: Task, name: str, watch: Watcher, cancel: Cancel) -> Outcome:
    kind = isohedral_class(name)
    begin = time.perf_counter()
    chosen: list[EscherTile] = []
    reasons: list[str] = []
    done = 0.0
    for share, method in task.method.parts():
        try:
            chosen += _chosen_tiles(task, kind, method, watch, cancel, done, share)
        except CertificationError as error:  # the other part may give one
            reasons.append(str(error))
        done += share
    if not chosen:
        return ClassFailure(kind.name, "; ".join(dict.fromkeys(reasons)))
    seconds = time.perf_counter() - begin
    best, *others = (tile.changed(seconds=seconds) for tile in chosen)
    return best.changed(others=tuple(others))


def _chosen_tiles(
    task: Task,
    kind: IsohedralClass,
    method: SearchMethod,
    watch: Watcher,
    cancel: Cancel,
    done: float,
    share: float,
) -> Sequence[EscherTile]:
    """The tiles of one fit that are shown, best first; `done` of the class's work was done before."""
    goal, count = task.goal, task.method.shown(task.per_class)
    with one_thread():
        found = method.fit(
            goal,
            kind,
            per_class=count,
            progress=lambda own, loss: watch(Event(kind.name, done + share * own, loss)),
            cancel=cancel,
        )
        tiles = best_tiles(goal.target, found, force=task.force, min_neck=method.least_neck(goal))
        chosen = [tiles[k] for k in _without_twins(tiles, count)]
        cancel.check()
        return task.method.finish(chosen, goal)


def _without_twins(tiles: Sequence[EscherTile], count: int) -> list[int]:
    if count == 1 or len(tiles) == 1:
        return [0]
    sound = [k for k, tile in enumerate(tiles) if tile.certificate.simple]
    alike = mutual_iou([tiles[k].normal_tile.polygon for k in sound], ALIKE)
    below = float(np.nextafter(ALIKE, 0))
    chosen = diverse([tiles[k].score for k in sound], count, alike, twin=below)
    return [sound[k] for k in chosen] or [0]


def _finished(outcome: Outcome) -> Event:
    return Event(outcome.name, 1.0, float("nan"), outcome)


def _run_pool(
    task: Task, names: Sequence[str], count: int, context: Any, cancel: Cancel
) -> Generator[Event, None, None]:
    cancel.check()
    if context.get_start_method() == "fork":
        with one_thread():
            task.method.prepare(task.goal)  # once, for all workers
    # classes with more lattice freedom take longer
    order = sorted(names, key=lambda name: -isohedral_class(name).stretch_dim)
    function = functools.partial(_work_on, task)
    with contextlib.closing(
        work(function, order, count, context=context, cancel=cancel)
    ) as all_news:
        for news in all_news:
            yield _finished(news.value) if news.done else news.value
