"""Jobs on the workers of a Dask cluster, on any number of machines.

Dask itself sends functions as pickles, and whoever can reach a scheduler can run code on its workers:
that is how Dask is. What orbiflow adds is a function by its name, text and bytes.
"""

from __future__ import annotations

import secrets
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import suppress
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from orbiflow import __version__
from orbiflow.cancel import Cancel
from orbiflow.errors import OrbiflowError
from orbiflow.jobs.events import Note
from orbiflow.jobs.executors.memory import keeping_memory
from orbiflow.jobs.executors.parcel import Answer, Parcel, carry_out
from orbiflow.jobs.run import Sink

if TYPE_CHECKING:
    from distributed import Client, Future

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
            from distributed import Client
        except ImportError as error:
            raise OrbiflowError(
                "a Dask scheduler needs dask.distributed: pip install 'orbiflow[dask]'"
            ) from error
        try:
            self._client = Client(
                self.address, timeout=self.timeout, set_as_default=False, name="orbiflow"
            )
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
        count = _threads(self._connected())
        return f"{'one worker' if count == 1 else f'{count} workers'} of {self.address}"

    def answers(
        self, parcels: Iterable[Parcel], tell: Sink, cancel: Cancel
    ) -> Generator[Answer, None, None]:
        """As of every `Executor`; no more parcels are out than threads work."""
        client = self._connected()
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
                for future, result in came:
                    parcel = out.known(future)
                    out.fill(waiting, room)  # now: what comes next takes the caller its time
                    answer = self._answer(parcel, future, result, alone)
                    if answer is not None:
                        yield answer
                        continue
                    tell(
                        Note(
                            f"workers died while they were at {parcel.key}; it is tried again alone"
                        )
                    )
                    suspects.append(parcel)
                if not came:
                    time.sleep(POLL)
        finally:
            out.recall()

    def _answer(self, parcel: Parcel, future: Future, result: Any, alone: bool) -> Answer | None:
        """Nothing of what is only suspected of killing workers."""
        from distributed import KilledWorker

        if future.status == "finished":
            future.release()
            return Answer.of(parcel.key, *result)
        if future.status == "error":
            error = result[1]
            if isinstance(error, KilledWorker):
                return Answer.died(parcel.key, error.allowed_failures + 1) if alone else None
            raise OrbiflowError(
                f"a worker of {self.address} could not begin: {type(error).__name__}: {error}; is the "
                "same orbiflow installed there?"
            ) from error
        raise OrbiflowError(
            f"the scheduler at {self.address} has gone or dropped the work; the same command goes on "
            "from here once it is back"
        )

    def _check_workers(self, client: Client) -> None:
        try:
            client.wait_for_workers(1, timeout=self.timeout)
        except TimeoutError as error:
            raise OrbiflowError(
                f"the scheduler at {self.address} has no worker; start some with `dask worker "
                f"{self.address} --nthreads 1 --nworkers N`"
            ) from error
        try:
            found: Any = client.run(_version_asker())
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

    def _connected(self) -> Client:
        if self._client is None:
            raise OrbiflowError("connect first: `with DaskCluster(address) as cluster:`")
        return self._client

    def _close(self) -> None:
        if self._client is not None:
            with suppress(Exception):  # a scheduler that has gone
                self._client.close(timeout=2)
            self._client = None


class _Out:
    """Parcels that are with the workers."""

    def __init__(self, client: Client) -> None:
        from distributed import as_completed

        self.client = client
        self.run = secrets.token_hex(4)
        self.sent = 0
        self.futures: dict[str, tuple[Parcel, Future]] = {}
        self.coming = as_completed(loop=client.loop, with_results=True, raise_errors=False)

    def __len__(self) -> int:
        return len(self.futures)

    def fill(self, waiting: Iterator[Parcel], room: int) -> None:
        while len(self) < room and (parcel := next(waiting, None)) is not None:
            self.send(parcel)

    def send(self, parcel: Parcel) -> None:
        key = f"orbiflow-{self.run}-{self.sent}"
        self.sent += 1
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that a picture is large
            future = self.client.submit(
                _serve, parcel.header(), parcel.data, key=key, pure=False, retries=0
            )
        self.futures[key] = parcel, future
        self.coming.add(future)

    def came(self) -> list[tuple[Future, Any]]:
        return list(self.coming.next_batch(block=False))

    def known(self, future: Future) -> Parcel:
        """Which it was of; it is out no more."""
        return self.futures.pop(str(future.key))[0]

    def recall(self) -> None:
        """Workers that are at it stop at their next step."""
        left = [future for _, future in self.futures.values()]
        self.futures.clear()
        with suppress(Exception):  # the scheduler may have gone
            if left:
                self.client.cancel(left, force=True)


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


def _threads(client: Client) -> int:
    try:
        found: Any = client.nthreads()
        return sum(found.values())
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
