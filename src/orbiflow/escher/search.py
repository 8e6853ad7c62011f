"""Escherization over several classes, one process each."""

from __future__ import annotations

import contextlib
import multiprocessing
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
from orbiflow.escher.occupancy import OccupancySettings, fit_occupancy
from orbiflow.escher.result import ClassFailure, TileResult, best_tile
from orbiflow.escher.starts import initial_poses
from orbiflow.escher.target import Target
from orbiflow.tilings import CLASSES, isohedral_class

INTERRUPTED = "interrupted"
"""The reason given for a class that Ctrl-C left undone."""

Watcher = Callable[["Event"], None]


@dataclass(frozen=True)
class Event:
    """News from a search: `share` of a class's work is done, or its `outcome` is there."""

    name: str
    share: float
    loss: float
    outcome: TileResult | ClassFailure | None = None


def escherize(
    target: Target,
    classes: Iterable[str] = tuple(CLASSES),
    settings: OccupancySettings | None = None,
    *,
    workers: int = 1,
    force: bool = False,
    watch: Watcher | None = None,
) -> tuple[list[TileResult], list[ClassFailure]]:
    """Fit a tile of each class to the target.

    Args:
        target: the silhouette.
        classes: names; each is done once, in its own process.
        settings: of the occupancy method.
        workers: processes; 1 stays in this process. A script that asks for more must do its work
            under `if __name__ == "__main__":`, as always with multiprocessing.
        force: return tiles that are not certified, too; their certificates say why.
        watch: called in this process with every `Event`.

    Returns:
        Certified tiles, largest IoU first, and the classes that gave none. The same seed gives the
        same tiles, whatever the number of workers. After Ctrl-C: what was finished by then.

    Raises:
        OrbiflowError: for an unknown class, a setting out of range, or workers that die.
    """
    names = list(dict.fromkeys(isohedral_class(name).name for name in classes))
    if not names:
        raise OrbiflowError(f"no isohedral class was given; the nine are {', '.join(CLASSES)}")
    settings = settings or OccupancySettings()
    if workers < 1:
        raise OrbiflowError(f"workers must be at least 1, got {workers}")
    count = min(workers, len(names))
    watch = watch or _ignore
    run = _run_here if count == 1 else _run_pool
    outcomes = []
    with (
        contextlib.suppress(KeyboardInterrupt),
        contextlib.closing(run(target, names, settings, count, force, watch)) as found,
    ):
        for outcome in found:
            outcomes.append(outcome)  # before it is told: an interrupt must not lose it
            watch(Event(outcome.name, 1.0, float("nan"), outcome))
    results = [outcome for outcome in outcomes if isinstance(outcome, TileResult)]
    failures = [outcome for outcome in outcomes if isinstance(outcome, ClassFailure)]
    missing = [name for name in names if name not in {outcome.name for outcome in outcomes}]
    failures += [ClassFailure(name, INTERRUPTED) for name in missing]
    # ties are broken by the order in which the classes were asked for
    results.sort(key=lambda r: (-r.metrics.iou, names.index(r.name)))
    return results, failures


def escherize_class(
    target: Target,
    name: str,
    settings: OccupancySettings,
    *,
    force: bool = False,
    watch: Watcher | None = None,
) -> TileResult | ClassFailure:
    """Fit and certify one class in this process, on one thread."""
    kind = isohedral_class(name)
    watch = watch or _ignore
    begin = time.perf_counter()
    number = list(CLASSES).index(kind.name)
    own = replace(settings, seed=(settings.seed * 1009 + number) % 2**32)
    with _one_thread():
        model = fit_occupancy(
            target, kind, own, lambda share, loss: watch(Event(kind.name, share, loss))
        )
        starts = len(initial_poses(kind, settings.turns)[0])
        try:
            result = best_tile(target, model, starts=starts, seconds=0.0, force=force)
        except CertificationError as error:
            return ClassFailure(kind.name, str(error))
    return replace(result, seconds=time.perf_counter() - begin)


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
    target: Target,
    names: Sequence[str],
    settings: OccupancySettings,
    _count: int,
    force: bool,
    watch: Watcher,
) -> Generator[TileResult | ClassFailure, None, None]:
    for name in names:
        yield escherize_class(target, name, settings, force=force, watch=watch)


_events: Any = None  # the queue of a worker process


def _set_up_worker(events: Any) -> None:
    global _events
    _events = events


def _work(
    target: Target, name: str, settings: OccupancySettings, force: bool
) -> TileResult | ClassFailure:
    return escherize_class(target, name, settings, force=force, watch=_events.put)


def _run_pool(
    target: Target,
    names: Sequence[str],
    settings: OccupancySettings,
    count: int,
    force: bool,
    watch: Watcher,
) -> Generator[TileResult | ClassFailure, None, None]:
    methods = multiprocessing.get_all_start_methods()
    context = multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")
    if context.get_start_method() == "forkserver":
        context.set_forkserver_preload(["orbiflow.escher.search"])
    events = context.Queue()
    with (
        ProcessPoolExecutor(count, context, _set_up_worker, (events,)) as pool,
        _relayed(events, watch),
    ):
        pending = {pool.submit(_work, target, name, settings, force) for name in names}
        try:
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


def _in_order(
    done: Iterable[Future[TileResult | ClassFailure]],
) -> list[TileResult | ClassFailure]:
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
