"""Escherization over several classes, one process each."""

from __future__ import annotations

import contextlib
import queue
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from typing import Any

import torch

from orbiflow.errors import CertificationError, OrbiflowError
from orbiflow.escher.descent_settings import DescentSettings
from orbiflow.escher.methods import Settings, fit, prepare
from orbiflow.escher.preview import quick_tile
from orbiflow.escher.processes import process_context, quiet_fork
from orbiflow.escher.result import ClassFailure, TileResult, best_tiles
from orbiflow.likeness.ranking import diverse, tile_similarity
from orbiflow.silhouette.emphasis import Emphasis
from orbiflow.silhouette.target import Target
from orbiflow.tilings import CLASSES, isohedral_class

INTERRUPTED = "interrupted"
"""The reason given for a class that Ctrl-C left undone."""

Watcher = Callable[["Event"], None]
Outcome = TileResult | ClassFailure


@dataclass(frozen=True)
class Event:
    """News from a search.

    - `name`: of the class.
    - `share`: of the class's work that is done.
    - `loss`: best so far in the method's own measure; for the descent 1 - IoU.
    - `outcome`: what the class gave, once it is there.
    - `preview`: a first certified tile, which the search is going to improve on.
    """

    name: str
    share: float
    loss: float
    outcome: Outcome | None = None
    preview: TileResult | None = None


@dataclass(frozen=True, eq=False)
class Task:
    """What is to be done for each class: arguments as in `escherize`."""

    target: Target
    settings: Settings
    emphasis: Emphasis | None = None
    per_class: int = 1
    force: bool = False


def escherize(
    target: Target,
    classes: Iterable[str] = tuple(CLASSES),
    settings: Settings | None = None,
    *,
    emphasis: Emphasis | None = None,
    per_class: int = 1,
    workers: int = 1,
    force: bool = False,
    watch: Watcher | None = None,
) -> tuple[list[TileResult], list[ClassFailure]]:
    """Fit a tile of each class to the target.

    Args:
        target: the silhouette.
        classes: names; each is done once, in its own process.
        settings: of the descent (`DescentSettings`, the default) or of the paper's method
            (`OccupancySettings`).
        emphasis: what must survive.
        per_class: tiles of each class at most, no two of them twins.
        workers: processes; 1 stays in this process. A script that asks for more must do its work
            under `if __name__ == "__main__":`, as always with multiprocessing.
        force: return tiles that are not certified, too; their certificates say why.
        watch: called in this process with every `Event`.

    Returns:
        Certified tiles, best first (`TileResult.score`), and the classes that gave none. The same
        seed gives the same tiles, whatever the number of workers. After Ctrl-C: what was found by
        then.

    Raises:
        OrbiflowError: for an unknown class, a setting out of range, or workers that die.
    """
    names = list(dict.fromkeys(isohedral_class(name).name for name in classes))
    if not names:
        raise OrbiflowError(f"no isohedral class was given; the nine are {', '.join(CLASSES)}")
    for what, number in (("workers", workers), ("per_class", per_class)):
        if number < 1:
            raise OrbiflowError(f"{what} must be at least 1, got {number}")
    task = Task(target, settings or DescentSettings(), emphasis, per_class, force)
    count = min(workers, len(names))
    watch = watch or _ignore
    run = _run_here if count == 1 else _run_pool
    outcomes: list[Outcome] = []
    previews: list[TileResult] = []

    def note(event: Event) -> None:
        if event.preview is not None:
            previews.append(event.preview)
        watch(event)

    with (
        contextlib.suppress(KeyboardInterrupt),
        contextlib.closing(run(task, names, count, note)) as found,
    ):
        for outcome in found:
            outcomes.append(outcome)  # before it is told: an interrupt must not lose it
            watch(Event(outcome.name, 1.0, float("nan"), outcome))
    missing = [name for name in names if name not in {outcome.name for outcome in outcomes}]
    outcomes += [preview for preview in previews if preview.name in missing]
    results = [o for best in outcomes if isinstance(best, TileResult) for o in best.family()]
    failures = [outcome for outcome in outcomes if isinstance(outcome, ClassFailure)]
    failures += [ClassFailure(name, INTERRUPTED) for name in missing]
    # ties are broken by the order in which the classes were asked for
    results.sort(key=lambda r: (-r.score, names.index(r.name)))
    return results, failures


def escherize_class(
    target: Target,
    name: str,
    settings: Settings,
    *,
    emphasis: Emphasis | None = None,
    per_class: int = 1,
    force: bool = False,
    watch: Watcher | None = None,
) -> Outcome:
    """Fit and certify one class in this process, on one thread; arguments as in `escherize`."""
    return _work_on(Task(target, settings, emphasis, per_class, force), name, watch or _ignore)


def _work_on(task: Task, name: str, watch: Watcher) -> Outcome:
    kind = isohedral_class(name)
    begin = time.perf_counter()
    with _one_thread():
        found = fit(
            task.target,
            kind,
            task.settings,
            emphasis=task.emphasis,
            per_class=task.per_class,
            progress=lambda share, loss: watch(Event(kind.name, share, loss)),
        )
        try:
            tiles = best_tiles(task.target, found, force=task.force)
        except CertificationError as error:
            return ClassFailure(kind.name, str(error))
    chosen = _without_twins(tiles, task.per_class)
    seconds = time.perf_counter() - begin
    best, *others = (replace(tiles[k], seconds=seconds) for k in chosen)
    return replace(best, others=tuple(others))


def _without_twins(tiles: Sequence[TileResult], count: int) -> list[int]:
    if count == 1 or len(tiles) == 1:
        return [0]
    sound = [k for k, tile in enumerate(tiles) if tile.certificate.simple]
    alike = tile_similarity([tiles[k].tile.polygon for k in sound], [tiles[k].name for k in sound])
    return [sound[k] for k in diverse([tiles[k].score for k in sound], count, alike)] or [0]


def _preview(task: Task, names: Sequence[str], watch: Watcher) -> None:
    """A first tile to look at, while the others are on their way."""
    if isinstance(task.settings, DescentSettings) and task.settings.starts == "outline":
        with _one_thread():
            tile = quick_tile(task.target, names)
        if tile is not None:
            watch(Event(tile.name, 0.0, 1 - tile.metrics.iou, preview=tile))


def _ignore(_event: Event) -> None:
    """Nobody watches."""


@contextlib.contextmanager
def _one_thread() -> Iterator[None]:
    # many small operations: threads cost far more than they bring
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def _run_here(
    task: Task, names: Sequence[str], _count: int, watch: Watcher
) -> Generator[Outcome, None, None]:
    _preview(task, names, watch)
    for name in names:
        yield _work_on(task, name, watch)


_events: Any = None  # the queue of a worker process


def _set_up_worker(events: Any) -> None:
    global _events
    _events = events


def _work(task: Task, name: str) -> Outcome:
    return _work_on(task, name, _events.put)


def _run_pool(
    task: Task, names: Sequence[str], count: int, watch: Watcher
) -> Generator[Outcome, None, None]:
    context = process_context()
    events = context.Queue()
    _preview(task, names, watch)
    if context.get_start_method() == "fork":
        prepare(task.target, task.settings, task.emphasis)  # once, for all workers
    with ProcessPoolExecutor(count, context, _set_up_worker, (events,)) as pool:
        try:
            with quiet_fork():
                pending = {pool.submit(_work, task, name) for name in _longest_first(names)}
            with _relayed(events, watch):  # a thread: not before the fork
                while pending:
                    done, pending = wait(pending, return_when=FIRST_COMPLETED)
                    yield from _in_order(done)
        except BrokenProcessPool as error:
            raise OrbiflowError(
                "a worker process died: was memory short, or is the script that called this "
                'without `if __name__ == "__main__":`? Try workers=1'
            ) from error
        except (KeyboardInterrupt, GeneratorExit):  # here, or in the caller's loop
            for process in list((pool._processes or {}).values()):
                process.terminate()
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _longest_first(names: Sequence[str]) -> list[str]:
    return sorted(names, key=lambda name: -isohedral_class(name).stretch_dim)


def _in_order(done: Iterable[Future[Outcome]]) -> list[Outcome]:
    return sorted((future.result() for future in done), key=lambda outcome: outcome.name)


@contextlib.contextmanager
def _relayed(events: Any, watch: Watcher) -> Iterator[None]:
    """Hand a worker's events on to `watch`, from a thread of this process."""
    stop = threading.Event()

    def relay() -> None:
        while not stop.is_set():
            with contextlib.suppress(queue.Empty):
                watch(events.get(timeout=0.1))

    thread = threading.Thread(target=relay, daemon=True)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()
