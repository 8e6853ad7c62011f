"""Who does the work of a batch: processes of this machine, or the workers of a Dask cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing
from importlib import import_module
from types import TracebackType
from typing import Annotated, Any, Protocol, Self

from orbiflow.batch.parcels import Answer, Parcel, carry_out
from orbiflow.errors import SettingError
from orbiflow.runtime import Cancel, Note, Sink, process_context, work
from orbiflow.settings import DefaultText, NotWith, Range, Settings

TRIES = 3
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


class Executor(Protocol):
    """Runs many calls. Use it in a `with` block, which ends what it has begun.

    Every executor gives the same answer to the same parcel, except for the seconds.
    """

    def __enter__(self) -> Self:
        """Raise an `OrbiflowError` if there is nobody to work."""
        ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
        /,
    ) -> None: ...

    @property
    def place(self) -> str:
        """Who works, in words, such as "2 processes"."""
        ...

    def answers(
        self, parcels: Iterable[Parcel], tell: Sink, cancel: Cancel
    ) -> Generator[Answer, None, None]:
        """Yield an answer for each parcel, as they come, in this thread.

        If a worker dies, another does its work again. A parcel that several workers die of is answered
        by a `Failed` ("died"), and the others go on.

        Args:
            parcels: Taken in order when somebody is free for them, so that few are held at a time.
            tell: Is told in a `Note` what the user should know of the workers.
            cancel: Ends the work; what is unfinished then has no answer.

        Raises:
            OrbiflowError: If nobody is left to work.
        """
        ...


class LocalProcesses:
    """An `Executor` of processes on this machine, each with one parcel at a time.

    Args:
        workers: The number of processes. Default: one per core.
        preload: Modules that the work needs, imported once rather than in every process.
    """

    def __init__(self, workers: int | None = None, preload: Sequence[str] = ()) -> None:
        self.workers = workers or os.cpu_count() or 1
        self.preload = tuple(preload)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
        /,
    ) -> None:
        """Do nothing: the processes end with `answers`."""

    @property
    def place(self) -> str:
        return "one process" if self.workers == 1 else f"{self.workers} processes"

    def answers(
        self, parcels: Iterable[Parcel], tell: Sink, cancel: Cancel
    ) -> Generator[Answer, None, None]:
        """Yield an answer for each parcel; see `Executor.answers`."""
        keys: list[str] = []

        def orders() -> Iterator[tuple[str, bytes]]:
            for parcel in parcels:
                keys.append(parcel.key)
                yield parcel.header(), parcel.data

        context = process_context(self.preload)
        if context.get_start_method() == "fork":
            for name in self.preload:
                import_module(name)
        pool = work(_serve, orders(), self.workers, context=context, cancel=cancel, tries=TRIES)
        with closing(pool) as all_news:
            for news in all_news:
                if news.died:
                    tell(Note(f"{TRIES} processes died of {keys[news.index]}; the others go on"))
                    yield Answer.died(keys[news.index], TRIES)
                elif news.done:
                    yield Answer.from_worker(keys[news.index], *news.value)


def executor_for(settings: WorkSettings, count: int, preload: Sequence[str]) -> Executor:
    """Return who works on so many parcels."""
    if settings.scheduler is not None:
        from orbiflow.batch.dask_cluster import DaskCluster

        return DaskCluster(settings.scheduler)
    workers = min(LocalProcesses(settings.workers).workers, count)
    return LocalProcesses(workers, preload)


def _serve(
    order: tuple[str, bytes], _tell: Callable[[Any], None], cancel: Cancel
) -> tuple[str, dict[str, bytes]]:
    return carry_out(*order, cancel)
