"""Escherization over several classes, one process each."""

from __future__ import annotations

import contextlib
import functools
import time
from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from orbiflow.arguments import (
    described,
    instance,
    is_a,
)
from orbiflow.errors import CertificationError, OrbiflowError
from orbiflow.runtime import (
    Cancel,
    Cancelled,
    one_thread,
    process_context,
    work,
)
from orbiflow.tiles.likeness import (
    diverse,
    least_neck,
    mutual_iou,
)
from orbiflow.tiles.search.front import (
    ALIKE,
    front_list,
    measured,
)
from orbiflow.tiles.search.methods import (
    BothSettings,
    OneSettings,
    Settings,
    fit,
    parts,
    prepare,
    shared_hands,
)
from orbiflow.tiles.search.occupancy import OccupancySettings
from orbiflow.tiles.search.result import (
    ClassFailure,
    best_tiles,
)
from orbiflow.tiles.search.settings import BendingSettings, DescentSettings
from orbiflow.tiles.search.steps import quick_bent_tile, quick_tile
from orbiflow.tiles.silhouette import (
    Emphasis,
    Pins,
    Target,
)
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tilings import (
    CLASSES,
    IsohedralClass,
    isohedral_class,
)

CANDIDATES = 3
"""Tiles of each class, of either search, that a search for both chooses from at least."""

INTERRUPTED = "interrupted"
"""The reason given for a class that was left undone."""

ClassName = str | int | IsohedralClass
"""What `isohedral_class` takes."""

Watcher = Callable[["Event"], None]
Outcome = EscherTile | ClassFailure


@dataclass(frozen=True)
class Event:
    """News from a search, told in the thread that called `escherize`, in this order:

    1. at most one event with a `preview`;
    2. of each class, any number of events whose `share` never falls, then exactly one with its
       `outcome`; those of several classes come as they happen, in any mixture.

    Classes that a `Cancel` left undone have their outcome last, in the order asked for.

    - `name`: of the class.
    - `share`: of the class's work that is done; 1 at its end, unless it was interrupted.
    - `loss`: best so far in the method's own measure; for the descent 1 - IoU.
    - `outcome`: what the class gave.
    - `preview`: a first certified tile, which the search is going to improve on.
    """

    name: str
    share: float
    loss: float
    outcome: Outcome | None = None
    preview: EscherTile | None = None


@dataclass(frozen=True, eq=False)
class Task:
    """What is to be done for each class: arguments as in `escherize`."""

    target: Target
    settings: Settings
    emphasis: Emphasis | None = None
    pins: Pins | None = None
    per_class: int = 1
    force: bool = False

    def __post_init__(self) -> None:
        instance(self.target, Target, "the target", "Target.read and Target.from_polygon make one")
        if not is_a(self.settings, Settings):
            raise OrbiflowError(
                f"settings must be of a method, got {described(self.settings)}; for a level of "
                'effort: BendingSettings.for_effort("fast")'
            )
        if self.pins is not None:
            instance(self.pins, Pins, "pins", "Pins.read and Pins.at make one")
            if not isinstance(self.settings, BendingSettings | BothSettings):
                raise OrbiflowError(
                    "pins belong to the search for likeness, where silhouettes bend"
                )


def escherize(
    target: Target,
    classes: ClassName | Iterable[ClassName] = tuple(CLASSES),
    settings: Settings | None = None,
    *,
    emphasis: Emphasis | None = None,
    pins: Pins | None = None,
    per_class: int = 1,
    workers: int = 1,
    force: bool = False,
    watch: Watcher | None = None,
    cancel: Cancel | None = None,
) -> tuple[list[EscherTile], list[ClassFailure]]:
    """Fit a tile of each class to the target.

    Args:
        target: the silhouette.
        classes: name of one, such as "IH4", or several; each is done once, in its own process.
        settings: of the search for likeness (`BendingSettings`, the default), for overlap
            (`DescentSettings`), for both (`BothSettings`), or of the paper's method
            (`OccupancySettings`).
        emphasis: what must survive.
        pins: what must not bend, in the search for likeness.
        per_class: tiles of each class at most, no two of them with a mutual IoU of .9; in a search
            for both, those of either kind that it chooses from, at least three.
        workers: processes; 1 stays in this process. A script that asks for more must do its work
            under `if __name__ == "__main__":`, as always with multiprocessing.
        force: return tiles that are not certified, too; their certificates say why.
        watch: called in this thread with every `Event`, in the order that `Event` states. What it
            raises ends the search and comes out of this function; so does `KeyboardInterrupt`.
        cancel: ends the search early, from another thread, a signal handler or `watch`; looked at
            before each step of every fit.

    Returns:
        Certified tiles, best first (`EscherTile.score`), and the classes that gave none. Of
        `BothSettings` at most twelve tiles in all, those for likeness first: see `front_list`. The
        same seed gives the same tiles, whatever the number of workers. If it was cancelled: what was
        found by then, and the other classes as failures with the reason `INTERRUPTED`.

    Raises:
        OrbiflowError: for an unknown class, a setting out of range, or workers that die.
    """
    names = _names(classes)
    if not names:
        raise OrbiflowError(f"no isohedral class was given; the nine are {', '.join(CLASSES)}")
    for what, number in (("workers", workers), ("per_class", per_class)):
        if number < 1:
            raise OrbiflowError(f"{what} must be at least 1, got {number}")
    settings = BendingSettings.for_effort("normal") if settings is None else settings
    task = Task(target, settings, emphasis, pins, per_class, force)
    cancel = cancel or Cancel()
    teller = _Teller(watch)
    count = min(workers, len(names))
    # asked before torch is limited here: a limit makes no fork safe
    context = process_context(("orbiflow.tiles.search.searching",)) if count > 1 else None
    with contextlib.suppress(Cancelled):
        _preview(task, names, teller.tell, cancel)
        if context is None:
            _run_here(task, names, teller.tell, cancel)
        else:
            with contextlib.closing(_run_pool(task, names, count, context, cancel)) as found:
                for event in found:
                    teller.tell(event)
    teller.interrupted(names)
    results, failures = teller.sorted(names)
    return front_list(results) if isinstance(settings, BothSettings) else results, failures


def _names(classes: ClassName | Iterable[ClassName]) -> list[str]:
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
    settings: Settings,
    *,
    emphasis: Emphasis | None = None,
    pins: Pins | None = None,
    per_class: int = 1,
    force: bool = False,
    watch: Watcher | None = None,
    cancel: Cancel | None = None,
) -> Outcome:
    """Fit and certify one class in this process, on one thread; arguments as in `escherize`.

    Raises:
        Cancelled: if it was told to stop.
    """
    task = Task(target, settings, emphasis, pins, per_class, force)
    return _work_on(task, name, watch or _ignore, cancel or Cancel())


class _Teller:
    """Keeps what was found, and the order of events."""

    def __init__(self, watch: Watcher | None) -> None:
        self.watch = watch or _ignore
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
        """Tiles, best first, and failures; ties in the order in which classes were asked for.

        Those of a search for likeness come before those for overlap: their scores are of two kinds.
        """
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
    for share, settings in parts(task.settings):
        try:
            chosen += _chosen_tiles(task, kind, settings, watch, cancel, done, share)
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
    settings: OneSettings,
    watch: Watcher,
    cancel: Cancel,
    done: float,
    share: float,
) -> list[EscherTile]:
    """The tiles of one fit that are shown, best first; `done` of the class's work was done before."""
    both = isinstance(task.settings, BothSettings)
    count = max(CANDIDATES, task.per_class) if both else task.per_class
    with one_thread():
        found = fit(
            task.target,
            kind,
            settings,
            emphasis=task.emphasis,
            pins=task.pins,
            per_class=count,
            progress=lambda own, loss: watch(Event(kind.name, done + share * own, loss)),
            cancel=cancel,
        )
        tiles = best_tiles(task.target, found, force=task.force, min_neck=_min_neck(task, settings))
        chosen = [tiles[k] for k in _without_twins(tiles, count)]
        if not isinstance(task.settings, BothSettings):
            return chosen
        hand, _ = shared_hands(task.target, task.settings.likeness, task.emphasis, task.pins)
        cancel.check()
        return [measured(tile, hand) for tile in chosen]


def _min_neck(task: Task, settings: OneSettings) -> float:
    if isinstance(settings, BendingSettings):
        return least_neck(task.target.normal, settings.min_neck)
    return 0.0 if isinstance(settings, OccupancySettings) else settings.min_neck


def _without_twins(tiles: Sequence[EscherTile], count: int) -> list[int]:
    if count == 1 or len(tiles) == 1:
        return [0]
    sound = [k for k, tile in enumerate(tiles) if tile.certificate.simple]
    alike = mutual_iou([tiles[k].normal_tile.polygon for k in sound], ALIKE)
    below = float(np.nextafter(ALIKE, 0))
    chosen = diverse([tiles[k].score for k in sound], count, alike, twin=below)
    return [sound[k] for k in chosen] or [0]


def _preview(task: Task, names: Sequence[str], watch: Watcher, cancel: Cancel) -> None:
    """A first tile to look at, while the others are on their way."""
    tile = None
    _, settings = parts(task.settings)[0]
    with one_thread():
        if isinstance(settings, BendingSettings):
            tile = quick_bent_tile(
                task.target, names, settings, task.emphasis, task.pins, cancel=cancel
            )
        elif isinstance(settings, DescentSettings) and settings.starts == "outline":
            tile = quick_tile(task.target, names, cancel=cancel)
    if tile is not None:
        watch(Event(tile.name, 0.0, 1 - tile.metrics.iou, preview=tile))


def _ignore(_event: Event) -> None:
    """Nobody watches."""


def _finished(outcome: Outcome) -> Event:
    return Event(outcome.name, 1.0, float("nan"), outcome)


def _run_here(task: Task, names: Sequence[str], watch: Watcher, cancel: Cancel) -> None:
    for name in names:
        cancel.check()
        watch(_finished(_work_on(task, name, watch, cancel)))


def _run_pool(
    task: Task, names: Sequence[str], count: int, context: Any, cancel: Cancel
) -> Generator[Event, None, None]:
    cancel.check()
    if context.get_start_method() == "fork":
        with one_thread():
            prepare(task.target, task.settings, task.emphasis, task.pins)  # once, for all workers
    # classes with more lattice freedom take longer
    order = sorted(names, key=lambda name: -isohedral_class(name).stretch_dim)
    function = functools.partial(_work_on, task)
    with contextlib.closing(
        work(function, order, count, context=context, cancel=cancel)
    ) as all_news:
        for news in all_news:
            yield _finished(news.value) if news.done else news.value
