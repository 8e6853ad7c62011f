"""Who does the work of a batch: processes of this machine, or the workers of a Dask cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing
from importlib import import_module
from typing import Annotated, Any

from orbiflow.batch.parcels import Executor, Parcel, WorkerReply, carry_out
from orbiflow.errors import SettingError
from orbiflow.runtime import Cancel, Note, Sink, process_context, work
from orbiflow.settings import DefaultText, NotWith, Range, Settings

MAX_DEATHS = 3
"""The number of processes that may die of one parcel."""


class WorkSettings(Settings, group="Work"):
    """Who works on many items, and on which."""

    workers: Annotated[int | None, Range(1), DefaultText("one per core")] = None
    """Number of processes; each works on one item at a time."""

    scheduler: Annotated[
        str | None, NotWith("workers", because="a scheduler has workers of its own")
    ] = None
    """Address of a Dask scheduler, such as tcp://10.0.0.5:8786, whose workers do the work."""

    retry_failed: bool = False
    """Try again what had no result before."""

    def check(self) -> None:
        if self.scheduler == "":
            raise SettingError("{scheduler} must be an address, such as tcp://10.0.0.5:8786")


class LocalProcesses(Executor):
    """Processes on this machine, each with one parcel at a time, that end with `answers`.

    Args:
        workers: The number of processes. Default: one per core.
        preload: Modules that the work needs, imported once rather than in every process.
    """

    def __init__(self, workers: int | None = None, preload: Sequence[str] = ()) -> None:
        self.workers = workers or os.cpu_count() or 1
        self.preload = tuple(preload)

    @property
    def place(self) -> str:
        return "one process" if self.workers == 1 else f"{self.workers} processes"

    def answers(
        self, parcels: Iterable[Parcel], tell: Sink, cancel: Cancel
    ) -> Generator[WorkerReply, None, None]:
        keys: list[str] = []

        def orders() -> Iterator[tuple[str, bytes]]:
            for parcel in parcels:
                keys.append(parcel.key)
                yield parcel.header(), parcel.data

        context = process_context(self.preload)
        if context.get_start_method() == "fork":
            for name in self.preload:
                import_module(name)
        pool = work(
            _serve, orders(), self.workers, context=context, cancel=cancel, tries=MAX_DEATHS
        )
        with closing(pool) as all_news:
            for news in all_news:
                if news.died:
                    tell(
                        Note(f"{MAX_DEATHS} processes died of {keys[news.index]}; the others go on")
                    )
                    yield WorkerReply.died(keys[news.index], MAX_DEATHS)
                elif news.done:
                    yield WorkerReply.from_worker(keys[news.index], *news.value)


def executor_for(settings: WorkSettings, count: int, preload: Sequence[str]) -> Executor:
    """Return who works on so many parcels."""
    if settings.scheduler is not None:
        from orbiflow.batch.dask_cluster import DaskCluster

        return DaskCluster(settings.scheduler)
    return LocalProcesses(min(settings.workers or os.cpu_count() or 1, count), preload)


def _serve(
    order: tuple[str, bytes], _tell: Callable[[Any], None], cancel: Cancel
) -> tuple[str, dict[str, bytes]]:
    return carry_out(*order, cancel)
