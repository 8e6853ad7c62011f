"""Jobs in processes of this machine."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing
from importlib import import_module
from types import TracebackType
from typing import Any, Self

from orbiflow.jobs.executors.parcel import (
    Answer,
    Parcel,
    carry_out,
)
from orbiflow.jobs.run import Sink
from orbiflow.runtime import Cancel, Note

TRIES = 3
"""Processes that may die of one parcel."""


class LocalProcesses:
    """An `Executor`: so many processes, each at one job at a time.

    Args:
        workers: processes; None for one a core.
        preload: modules that the jobs need, imported once instead of in every process.
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
        """Processes end with `answers`."""

    @property
    def place(self) -> str:
        return "one process" if self.workers == 1 else f"{self.workers} processes"

    def answers(
        self,
        parcels: Iterable[Parcel],
        tell: Sink,
        cancel: Cancel,
    ) -> Generator[Answer, None, None]:
        """As of every `Executor`."""
        from orbiflow.runtime import process_context, work

        keys: list[str] = []

        def orders() -> Iterator[tuple[str, bytes]]:
            for parcel in parcels:
                keys.append(parcel.key)
                yield parcel.header(), parcel.data

        context = process_context(("torch", *self.preload))
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
                    yield Answer.of(keys[news.index], *news.value)


def _serve(
    order: tuple[str, bytes], _tell: Callable[[Any], None], cancel: Cancel
) -> tuple[str, dict[str, bytes]]:
    return carry_out(*order, cancel)
