"""Jobs on the workers of a Dask cluster, on any number of machines.

Dask itself sends functions as pickles, and whoever can reach a scheduler can run code on its workers:
that is how Dask is. What orbiflow adds is a function by its name, text and bytes.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import importlib
import secrets
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self, TypeAlias

from orbiflow import __version__
from orbiflow.errors import OrbiflowError
from orbiflow.jobs.executors.memory import keeping_memory
from orbiflow.jobs.executors.parcel import (
    Answer,
    Parcel,
    carry_out,
)
from orbiflow.jobs.run import Sink
from orbiflow.runtime import Cancel, Note

Client: TypeAlias = Any
Future: TypeAlias = Any
"""Of `distributed`, which has no types and is not always there."""

POLL = 0.05
"""Seconds between looks at the token while nothing comes."""

LOOK = 2.0
"""Seconds between looks at who works."""

PATIENCE = 300.0
"""Seconds without any worker after which there will be none."""


class DaskCluster:
    """An `Executor`: the workers of the scheduler at an address.

    Dask gives what a lost worker was at to another one, so many times (the scheduler's setting
    `distributed.scheduler.allowed-failures`, 3), and then gives up all that the last one was at. These
    parcels are tried once more at the end, one at a time: only the one to blame has no result.

    Args:
        address: such as "tcp://10.0.0.5:8786", or "tls://..." with Dask's own settings.
        timeout: seconds to wait for an answer of the scheduler, and for a first worker.
    """

    def __init__(self, address: str, *, timeout: float = 15.0) -> None:
        self.address, self.timeout = address, timeout
        self._client: Client | None = None

    def __enter__(self) -> Self:
        """Connect.

        Raises:
            OrbiflowError: without dask.distributed, a scheduler there, a worker, or the same version
                of orbiflow on every worker.
        """
        try:
            importlib.import_module("distributed")
        except ImportError as error:
            raise OrbiflowError(
                "a Dask scheduler needs dask.distributed: pip install distributed"
            ) from error
        try:
            self._client = _connected(self.address, self.timeout)
        except Exception as error:  # of many kinds, down to an AssertionError of its event loop
            raise OrbiflowError(
                f"no Dask scheduler answers at {self.address} within {self.timeout:g} s; start one "
                "with `dask scheduler`, which prints its address (tcp://...:8786)"
            ) from error
        try:
            self._check_workers(self._client)
        except BaseException:
            self._close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
        /,
    ) -> None:
        """Disconnect; workers stop what they were at."""
        self._close()

    @property
    def place(self) -> str:
        count = _threads(self._working())
        return f"{'one worker' if count == 1 else f'{count} workers'} of {self.address}"

    def answers(
        self, parcels: Iterable[Parcel], tell: Sink, cancel: Cancel
    ) -> Generator[Answer, None, None]:
        """As of every `Executor`; no more parcels are out than threads work."""
        client = self._working()
        out, crew = _Out(client), _Crew(client, self.address, tell)
        waiting, suspects = iter(parcels), list[Parcel]()
        alone = False
        try:
            while not cancel.cancelled:
                room = crew.room()
                out.fill(waiting, room)
                if not len(out) and room:
                    if not suspects:
                        return
                    alone = True
                    out.send(suspects.pop())
                came = out.came()
                for one in came:
                    out.fill(waiting, room)  # now: what comes next takes the caller its time
                    answer = self._answer(one, alone)
                    if answer is not None:
                        yield answer
                        continue
                    key = one.parcel.key
                    tell(Note(f"workers died while they were at {key}; it is tried again alone"))
                    suspects.append(one.parcel)
                if not came:
                    time.sleep(POLL)
        finally:
            out.recall()

    def _answer(self, one: _Sent, alone: bool) -> Answer | None:
        """Nothing of what is only suspected of killing workers."""
        from distributed import KilledWorker

        try:
            result = one.result.result()
        except KilledWorker as error:
            died = Answer.died(one.parcel.key, error.allowed_failures + 1)
            return died if alone else None
        except (OSError, concurrent.futures.CancelledError) as error:
            raise OrbiflowError(
                f"the scheduler at {self.address} has gone or dropped the work; the same command goes "
                "on from here once it is back"
            ) from error
        except Exception as error:
            raise OrbiflowError(
                f"a worker of {self.address} could not begin: {type(error).__name__}: {error}; is the "
                "same orbiflow installed there?"
            ) from error
        one.future.release()
        return Answer.of(one.parcel.key, *result)

    def _check_workers(self, client: Client) -> None:
        try:
            client.wait_for_workers(1, timeout=self.timeout)
        except TimeoutError as error:
            raise OrbiflowError(
                f"the scheduler at {self.address} has no worker; start some with `dask worker "
                f"{self.address} --nthreads 1 --nworkers N`"
            ) from error
        try:
            found = client.run(_version_asker())
        except Exception as error:
            raise OrbiflowError(
                f"the workers of {self.address} cannot be asked: {error}"
            ) from error
        for worker, version in found.items():
            if version != __version__:
                has = "no orbiflow" if version is None else f"orbiflow {version}"
                raise OrbiflowError(
                    f"the worker at {worker} has {has}, here is {__version__}: install the same "
                    "version on all machines"
                )

    def _working(self) -> Client:
        if self._client is None:
            raise OrbiflowError("connect first: `with DaskCluster(address) as cluster:`")
        return self._client

    def _close(self) -> None:
        if self._client is not None:
            with suppress(Exception):  # a scheduler that has gone
                self._client.close(timeout=2)
            self._client = None


@dataclass(frozen=True, eq=False)
class _Sent:
    """A parcel that is with the workers, and what comes back.

    The future's own status says nothing of the result: of a worker that dies once its result has been
    fetched, the status is "lost".
    """

    parcel: Parcel
    future: Future
    result: concurrent.futures.Future[Any]


class _Out:
    """Parcels that are with the workers."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self.run = secrets.token_hex(4)
        self.count = 0
        self.sent: list[_Sent] = []

    def __len__(self) -> int:
        return len(self.sent)

    def fill(self, waiting: Iterator[Parcel], room: int) -> None:
        while len(self) < room and (parcel := next(waiting, None)) is not None:
            self.send(parcel)

    def send(self, parcel: Parcel) -> None:
        key = f"orbiflow-{self.run}-{self.count}"
        self.count += 1
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that a picture is large
            future = self.client.submit(
                _serve, parcel.header(), parcel.data, key=key, pure=False, retries=0
            )
        loop = self.client.loop.asyncio_loop
        fetched = asyncio.run_coroutine_threadsafe(_fetched(self.client, future), loop)
        self.sent.append(_Sent(parcel, future, fetched))

    def came(self) -> list[_Sent]:
        """Those that are out no more."""
        came = [one for one in self.sent if one.result.done()]
        self.sent = [one for one in self.sent if one not in came]
        return came

    def recall(self) -> None:
        """Workers that are at it stop at their next step."""
        left, self.sent = self.sent, []
        for one in left:
            one.result.cancel()
        with suppress(Exception):  # the scheduler may have gone
            if left:
                self.client.cancel([one.future for one in left], force=True)


async def _fetched(client: Client, future: Future) -> Any:
    """A result, whatever dies before it is here.

    Not `distributed.as_completed`: a result that is lost while it fetches it, and whose task then
    fails, never comes out of it.
    """
    return await client.gather(future, asynchronous=True)


class _Crew:
    """How many work; looked at now and then."""

    def __init__(self, client: Client, address: str, tell: Sink) -> None:
        self.client, self.address, self.tell = client, address, tell
        self.threads = _threads(client)
        self.looked = self.seen = time.monotonic()

    def room(self) -> int:
        """Parcels that may be out at a time.

        Raises:
            OrbiflowError: if nobody has been there for long.
        """
        now = time.monotonic()
        if now - self.looked >= LOOK:
            before, self.threads, self.looked = self.threads, _threads(self.client), now
            if before and not self.threads:
                self.tell(Note(f"no worker is left at {self.address}; waiting for one"))
        if self.threads:
            self.seen = now
        elif now - self.seen > PATIENCE:
            raise OrbiflowError(
                f"no worker has been at {self.address} for {PATIENCE:.0f} s; the same command goes on "
                "from here once there is one"
            )
        return self.threads


def _connected(address: str, timeout: float) -> Client:
    """A client; what fails is closed at once.

    A client that could not start is closed by the garbage collector, which takes the lock of all
    clients' loops. In the midst of another's start, which holds it, that never ends.
    """
    import distributed

    client: Client = distributed.Client.__new__(distributed.Client)
    try:
        client.__init__(address, timeout=timeout, set_as_default=False, name="orbiflow")
    except BaseException:
        with suppress(Exception):
            client.close(timeout=2)
        raise
    return client


def _threads(client: Client) -> int:
    try:
        return sum(client.nthreads().values())
    except (OSError, RuntimeError, TimeoutError, AttributeError):  # the scheduler has gone
        return 0


def _serve(header: str, data: bytes) -> tuple[str, dict[str, bytes]]:
    """In a worker."""
    with keeping_memory():
        return carry_out(header, data, _Released())


class _Released(Cancel):
    """In a worker: cancelled once the task that this thread is at is nobody's wish any more."""

    def __init__(self) -> None:
        super().__init__()
        from distributed import get_worker

        self._worker = get_worker()
        self._key = self._worker.get_current_task()

    @property
    def cancelled(self) -> bool:
        task = self._worker.state.tasks.get(self._key)
        return task is None or task.state == "cancelled"


def _version_asker() -> Callable[[], str | None]:
    """A function of its own code: workers need no orbiflow to run it."""

    def version() -> str | None:
        try:
            import orbiflow
        except ImportError:
            return None
        return orbiflow.__version__

    return version
