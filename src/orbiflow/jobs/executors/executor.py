"""What runs jobs, wherever that is."""

from __future__ import annotations

from collections.abc import Generator, Iterable
from types import TracebackType
from typing import Protocol, Self

from orbiflow.jobs.executors.parcel import Answer, Parcel
from orbiflow.jobs.run import Sink
from orbiflow.runtime import Cancel


class Executor(Protocol):
    """Runs many jobs. To be used in a `with` block, which ends what it has begun.

    The same parcel has the same answer from every executor, but for its seconds.
    """

    def __enter__(self) -> Self:
        """Raises an `OrbiflowError` if there is nobody to work."""
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
        """Who works, in words: "2 processes"."""
        ...

    def answers(
        self, parcels: Iterable[Parcel], tell: Sink, cancel: Cancel
    ) -> Generator[Answer, None, None]:
        """One answer a parcel, as they come, in this thread.

        A worker that dies costs its time: what it was at is done again by another. A parcel that
        several die of is answered by a `Failed` ("died"), alone.

        Args:
            parcels: taken in order when somebody is free for them, so that few are held at a time.
            tell: told, as `Note`, what the user should know of the workers.
            cancel: ends the work; what is unfinished then has no answer.

        Raises:
            OrbiflowError: if nobody is left to work.
        """
        ...
