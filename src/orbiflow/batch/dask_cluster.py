"""Work on the workers of a Dask cluster, on any number of machines.

Dask sends functions as pickles, and whoever can reach a scheduler can run code on its workers: this is
how Dask works. What orbiflow sends is a function by its name, text and bytes.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import ctypes
import importlib
import os
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Self, TypeAlias

from orbiflow import __version__
from orbiflow.batch.parcels import Executor, Parcel, WorkerReply, carry_out
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import Cancel, Note, Polled, Sink, one_thread
from orbiflow.settings import naming_extras

Client: TypeAlias = Any
Future: TypeAlias = Any
"""Classes of `distributed`, which has no types and is not always installed."""

POLL_SECONDS = 0.05
"""Seconds between looks at the token while no answer comes."""

SECONDS_BETWEEN_LOOKS = 2.0
"""Seconds between looks at who works."""

MAX_SECONDS_WITHOUT_WORKERS = 300.0
"""Seconds without any worker after which the batch ends."""

TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3  # of glibc's malloc.h
KEPT_BYTES = 32 * 2**20  # the most that glibc itself would come to


class DaskCluster(Executor):
    """The workers of the scheduler at an address.

    Dask gives the work of a lost worker to another one, three times (the scheduler's setting
    `distributed.scheduler.allowed-failures`), and then gives up all that the last one worked on. These
    parcels are tried once more at the end, one at a time, so that only the one to blame has no result.

    Args:
        address: An address such as "tcp://10.0.0.5:8786", or "tls://..." with Dask's own settings.
        timeout: Seconds to wait for an answer of the scheduler, and for a first worker.
    """

    def __init__(self, address: str, *, timeout: float = 15.0) -> None:
        self.address, self.timeout = address, timeout
        self._client: Client | None = None

    def __enter__(self) -> Self:
        """Connect, if there is a scheduler with workers that have the same orbiflow."""
        with naming_extras("a Dask scheduler"):
            importlib.import_module("distributed")
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
            self.__exit__()
            raise
        return self

    def __exit__(self, *_error: object) -> None:
        """Disconnect; workers stop at their next step."""
        if self._client is not None:
            with suppress(Exception):  # a scheduler that has gone
                self._client.close(timeout=2)
            self._client = None

    @property
    def place(self) -> str:
        count = _threads(self._working())
        return f"{'one worker' if count == 1 else f'{count} workers'} of {self.address}"

    def answers(
        self, parcels: Iterable[Parcel], tell: Sink, cancel: Cancel
    ) -> Generator[WorkerReply, None, None]:
        """Yield an answer for each parcel; no more are out than the workers have threads."""
        out = _Out(self._working(), self.address, tell)
        waiting, suspects = iter(parcels), list[Parcel]()
        alone = False
        try:
            while not cancel.cancelled:
                room = out.room()
                out.fill(waiting, room)
                if not out.sent and room:
                    if not suspects:
                        return
                    alone = True
                    out.send(suspects.pop())
                for sent in out.came():
                    out.fill(waiting, room)  # now: what comes next takes the caller its time
                    answer = self._answer(sent, alone)
                    if answer is not None:
                        yield answer
                        continue
                    key = sent.parcel.key
                    tell(Note(f"workers died while they were at {key}; it is tried again alone"))
                    suspects.append(sent.parcel)
        finally:
            out.recall()

    def _answer(self, sent: _Sent, alone: bool) -> WorkerReply | None:
        """The answer that came, or None for a parcel that is only suspected of killing workers."""
        from distributed import KilledWorker

        try:
            result = sent.result.result()
        except KilledWorker as error:
            died = WorkerReply.died(sent.parcel.key, error.allowed_failures + 1)
            return died if alone else None
        except (OSError, concurrent.futures.CancelledError) as error:
            raise OrbiflowError(
                f"the scheduler at {self.address} has gone or dropped the work: run the same command "
                "again to resume once it is back"
            ) from error
        except Exception as error:
            raise OrbiflowError(
                f"a worker of {self.address} could not begin: {type(error).__name__}: {error}; is the "
                "same orbiflow installed there?"
            ) from error
        sent.future.release()
        return WorkerReply.from_worker(sent.parcel.key, *result)

    def _check_workers(self, client: Client) -> None:
        try:
            client.wait_for_workers(1, timeout=self.timeout)
        except TimeoutError as error:
            raise OrbiflowError(
                f"the scheduler at {self.address} has no worker; start some with `dask worker "
                f"{self.address} --nthreads 1 --nworkers N`"
            ) from error
        try:
            versions = client.run(_version_asker())
        except Exception as error:
            raise OrbiflowError(
                f"the workers of {self.address} cannot be asked: {error}"
            ) from error
        for worker, version in versions.items():
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


@dataclass(frozen=True, eq=False)
class _Sent:
    """A parcel that is on the cluster, and its result to come.

    The future's own status does not tell: if a worker dies once its result has been fetched, the
    status is "lost".
    """

    parcel: Parcel
    future: Future
    result: concurrent.futures.Future[Any]


class _Out:
    """The parcels that are on the cluster, and the number of threads that work there."""

    def __init__(self, client: Client, address: str, tell: Sink) -> None:
        self.client, self.address, self.tell = client, address, tell
        self.sent: list[_Sent] = []
        self.threads = _threads(client)
        self.looked = self.seen = time.monotonic()

    def room(self) -> int:
        """Return how many parcels may be here at a time; raise an error if it was none for long."""
        now = time.monotonic()
        if now - self.looked >= SECONDS_BETWEEN_LOOKS:
            before, self.threads, self.looked = self.threads, _threads(self.client), now
            if before and not self.threads:
                self.tell(Note(f"no worker is left at {self.address}; waiting for one"))
        if self.threads:
            self.seen = now
        elif now - self.seen > MAX_SECONDS_WITHOUT_WORKERS:
            raise OrbiflowError(
                f"no worker has been at {self.address} for {MAX_SECONDS_WITHOUT_WORKERS:.0f} s: run "
                "the same command again to resume once there is one"
            )
        return self.threads

    def fill(self, waiting: Iterator[Parcel], room: int) -> None:
        while len(self.sent) < room and (parcel := next(waiting, None)) is not None:
            self.send(parcel)

    def send(self, parcel: Parcel) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that a picture is large
            future = self.client.submit(_serve, parcel.header(), parcel.data, pure=False, retries=0)
        loop = self.client.loop.asyncio_loop
        fetched = asyncio.run_coroutine_threadsafe(_fetched(self.client, future), loop)
        self.sent.append(_Sent(parcel, future, fetched))

    def came(self) -> list[_Sent]:
        """Return those that have come back; if there are none, after a while."""
        came = [sent for sent in self.sent if sent.result.done()]
        self.sent = [sent for sent in self.sent if sent not in came]
        if not came:
            time.sleep(POLL_SECONDS)
        return came

    def recall(self) -> None:
        """Give up the rest; their workers stop at the next step."""
        left, self.sent = self.sent, []
        with suppress(Exception):  # the scheduler may have gone
            if left:
                self.client.cancel([sent.future for sent in left], force=True)
        # that ends them; if they were cancelled first, asyncio would print a traceback of each
        concurrent.futures.wait([sent.result for sent in left], SECONDS_BETWEEN_LOOKS)
        for sent in left:
            sent.result.cancel()


async def _fetched(client: Client, future: Future) -> Any:
    """Wait for a result, whatever dies before it is here.

    `distributed.as_completed` never yields a result that is lost while it fetches it and whose task
    then fails, and `Client.get_executor` takes the status "lost" of a result for its failure.
    """
    return await client.gather(future, asynchronous=True)


def _connected(address: str, timeout: float) -> Client:
    """Return a client; one that fails is closed at once, and its thread ends.

    The garbage collector would close it, too, but takes the lock of all clients' loops for this. If
    another client is just starting, which holds the lock, that never ends. `close` leaves the thread of
    a client that never was connected, beside which no worker could be forked.
    """
    import distributed

    client: Client = distributed.Client.__new__(distributed.Client)
    try:
        client.__init__(address, timeout=timeout, set_as_default=False, name="orbiflow")
    except BaseException:
        with suppress(Exception):
            client.close(timeout=2)
        with suppress(Exception):
            client._loop_runner.stop()
        raise
    return client


def _threads(client: Client) -> int:
    try:
        return sum(client.nthreads().values())
    except (OSError, RuntimeError, TimeoutError, AttributeError):  # the scheduler has gone
        return 0


def _serve(header: str, data: bytes) -> tuple[str, dict[str, bytes]]:
    """Carry out a parcel in a worker."""
    with suppress(ModuleNotFoundError):
        importlib.import_module("torch")  # what is not imported cannot be limited

    keep_memory()
    with one_thread():
        return carry_out(header, data, _released())


def _released() -> Cancel:
    """Return a token that is cancelled once nobody waits for this thread's task any more."""
    from distributed import get_worker

    worker = get_worker()
    key = worker.get_current_task()

    def released() -> bool:
        task = worker.state.tasks.get(key)
        return task is None or task.state == "cancelled"

    return Polled(released)


def _version_asker() -> Callable[[], str | None]:
    """Return a function that travels with its code: workers need no orbiflow to run it."""

    def version() -> str | None:
        try:
            import orbiflow
        except ImportError:
            return None
        return orbiflow.__version__

    return version


def keep_memory() -> None:
    """Keep freed memory with this process, where glibc was told not to.

    Dask's nannies start workers with MALLOC_TRIM_THRESHOLD_=65536: glibc then hands every freed block
    of that size back to the system. A search frees such arrays all the time, and fetching the memory
    again cost as much as its own work (2.4 s instead of 1.3 s for one class).
    """
    if "MALLOC_TRIM_THRESHOLD_" in os.environ:
        with suppress(OSError, TypeError, AttributeError):  # another library
            set_option = ctypes.CDLL(None).mallopt
            set_option(TRIM_THRESHOLD, KEPT_BYTES)
            set_option(MMAP_THRESHOLD, KEPT_BYTES)
