"""The reproduction of all exhibits: first the work that they share, then the drawing of each."""

import contextlib
import functools
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from orbiflow.errors import OrbiflowError
from orbiflow.runtime import Cancel, Cancelled, one_blas_thread, one_thread, process_context, work
from reproduction import (
    animal,
    classes,
    comparison,
    densities,
    method,
    spaces,
    square,
    symmetries,
    symmetrization,
)
from reproduction.drawing import Canvas, Picture
from reproduction.exhibit import Draw, Exhibit, Extent, Findings, Shown, Work

# all exhibits, in the order of the paper
EXHIBITS: tuple[Exhibit, ...] = (
    square.EXHIBIT,
    classes.TEMPLATES,
    classes.GROUPS_TABLE,
    spaces.SPACES_FIGURE,
    symmetries.EXHIBIT,
    method.EXHIBIT,
    classes.TILINGS,
    symmetrization.EXHIBIT,
    animal.EXHIBIT,
    animal.FREQUENCIES,
    comparison.TILES,
    comparison.TABLE,
    spaces.SYMMETRIZATION,
    densities.TABLE,
    densities.SIX_GAUSSIANS,
    densities.SURFACES,
    densities.CHECKERBOARD,
)

Progress = Callable[[float, str], None]
"""Called with the share of everything that is done, and with what was done last."""

DRAWING_COST = 4.0  # about how many seconds a drawing takes, for the progress


class Outcome(NamedTuple):
    """The outcome of a call: its value, or why there is none; and its seconds."""

    value: Any
    failure: str
    seconds: float


def reproduce(
    exhibits: Sequence[Exhibit],
    extent: Extent,
    folder: Path,
    *,
    workers: int = 1,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> list[Shown]:
    """Draw exhibits into an existing folder, and return what came of each, in their order.

    Work that several exhibits need is done once. An exhibit that fails is shown with the reason, and
    the others are drawn all the same. With one worker everything stays in this process.
    """
    cancel = cancel or Cancel()
    needs = [exhibit.needs(extent) for exhibit in exhibits]
    chosen = {one.key: one for needed in needs for one in needed}
    jobs = sorted(chosen.values(), key=lambda one: -one.cost)
    total = sum(one.cost for one in jobs) + DRAWING_COST * len(exhibits)
    worked = 0.0

    def tell(cost: float, what: str) -> None:
        nonlocal worked
        worked += cost
        if progress is not None:
            progress(min(1.0, worked / total), what)

    run = functools.partial(_run, workers=workers, cancel=cancel)
    done: dict[Any, Outcome] = {}
    for index, outcome in run(_work_done, jobs):
        done[jobs[index].key] = outcome
        tell(jobs[index].cost, "working")
    given = [[done.get(one.key, _LOST) for one in needed] for needed in needs]
    shown = [Shown(exhibit, failure=_LOST.failure) for exhibit in exhibits]
    function = functools.partial(_drawn, extent=extent, folder=folder)
    drawings = [(one.name, one.draw, values) for one, values in zip(exhibits, given, strict=True)]
    for index, outcome in run(function, drawings):
        exhibit = exhibits[index]
        pictures, findings = ((), None) if outcome.failure else outcome.value
        shown[index] = Shown(exhibit, pictures, findings, outcome.failure, outcome.seconds)
        tell(DRAWING_COST, f"drawn {exhibit.label}")
    cancel.check()
    return shown


_LOST = Outcome(None, "the process that worked on it died; was memory short?", 0.0)


def _run(
    function: Callable[[Any], Any], items: Sequence[Any], *, workers: int, cancel: Cancel
) -> Iterator[tuple[int, Outcome]]:
    """Yield indices and outcomes as they come; items whose process dies have none."""
    if min(workers, len(items)) <= 1:
        for index, item in enumerate(items):
            cancel.check()
            yield index, _outcome(function, item, lambda _news: None, cancel)
        return
    told = functools.partial(_outcome, function)
    context = process_context(("orbiflow.tiles.search.escherizing",))
    pool = work(told, items, workers, context=context, cancel=cancel)
    with contextlib.closing(pool), contextlib.suppress(OrbiflowError):
        for news in pool:
            yield news.index, news.value
    cancel.check()


def _outcome(
    function: Callable[[Any], Any], item: Any, _tell: Callable[[Any], None], _cancel: Cancel
) -> Outcome:
    begin = time.perf_counter()
    value, failure = None, ""
    with one_thread(), one_blas_thread():
        try:
            value = function(item)
        except Cancelled:
            raise
        except Exception as error:  # any error: the other exhibits go on, and this one shows it
            mistake = isinstance(error, OrbiflowError)
            failure = str(error) if mistake else f"{type(error).__name__}: {error}"
    return Outcome(value, failure, time.perf_counter() - begin)


def _work_done(job: Work) -> Any:
    return job.function(*job.arguments)


def _drawn(
    item: tuple[str, Draw, list[Outcome]], *, extent: Extent, folder: Path
) -> tuple[tuple[Picture, ...], Findings]:
    name, draw, given = item
    for outcome in given:
        if outcome.failure:
            raise OrbiflowError(outcome.failure)
    canvas = Canvas(folder, name)
    findings = draw(canvas, extent, [outcome.value for outcome in given])
    return tuple(canvas.pictures), findings
