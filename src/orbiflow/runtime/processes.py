"""Worker processes: how they start, what they say, how they end."""

from __future__ import annotations

import contextlib
import multiprocessing
import pickle
import signal
import threading
import time
import traceback
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection, wait
from typing import Any

from orbiflow.errors import OrbiflowError
from orbiflow.runtime.events import Cancel, Cancelled, Polled
from orbiflow.runtime.threads import imported_torch, use_one_thread

Function = Callable[[Any, Callable[[Any], None], Cancel], Any]
"""What a worker does with an item, a function that takes its news, and a token that stops it."""

POLL_SECONDS = 0.05
"""Seconds between looks at the token while no worker says anything."""

GRACE_SECONDS = 2.0
"""Seconds that workers have to end by themselves when they are told to stop."""

STOPS = {signal.SIGINT, signal.SIGTERM}
"""What ends a run early: a worker ignores the first, which its parent hears, and dies of the second."""


@dataclass(frozen=True, eq=False)
class News:
    """What a worker tells, or its result.

    - `index`: The number of the item that it works on, from 0.
    - `value`: What it tells, or the result.
    - `done`: Whether it is the result.
    - `died`: Whether there is none, because all workers that were given the item died; `done`, too.
    """

    index: int
    value: Any
    done: bool
    died: bool = False


def process_context(preload: Sequence[str] = ("torch",)) -> Any:
    """Return how workers start: forked where that is safe, which saves seconds of imports.

    A fork is safe if this process has no other thread and torch has not been allowed any. Otherwise
    workers are forked from a server, where there is one, which first imports the modules of `preload`;
    there is one server per process, and its first call decides.
    """
    methods = multiprocessing.get_all_start_methods()
    torch = imported_torch()
    one_thread = torch is None or torch.get_num_threads() == 1
    if "fork" in methods and one_thread and threading.active_count() == 1:
        return multiprocessing.get_context("fork")
    context = multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")
    if context.get_start_method() == "forkserver":
        context.set_forkserver_preload(list(preload))
    return context


def work(
    function: Function,
    items: Iterable[Any],
    workers: int,
    *,
    context: Any = None,
    cancel: Cancel | None = None,
    tries: int | None = None,
) -> Generator[News, None, None]:
    """Do `function(item, tell, cancel)` for each item in processes; yield their news in this thread.

    Workers have one torch thread and ignore Ctrl-C: this process decides. They end when the generator
    is closed, and also when this process dies. When they are told to stop, they have two seconds to say
    what they have found; the generator then ends without the other results.

    Args:
        function: A function of a module, or a `functools.partial` of one; each worker gets it once.
        items: Taken in order, one at a time, by whichever worker is free.
        workers: Maximum number of processes.
        context: How they start, from `process_context`.
        cancel: Stops the work; the workers' tokens follow it.
        tries: Number of workers that may die of an item. Each is replaced by a new one; the news of an
            item that has killed so many say `died`. None: no worker may die.
    """
    pool = _Pool(function, items, context or process_context(), cancel or Cancel(), tries)
    try:
        pool.start(workers)
        yield from pool.news()
    finally:
        pool.close()


@dataclass(frozen=True)
class _Order:
    index: int
    item: Any
    tried: int = 0  # workers that have died of it


@dataclass(eq=False)
class _Pool:
    function: Function
    items: Iterable[Any]
    context: Any
    cancel: Cancel
    tries: int | None

    def __post_init__(self) -> None:
        self.left = (_Order(index, item) for index, item in enumerate(self.items))
        self.again: deque[_Order] = deque()
        self.processes: dict[Connection, Any] = {}
        self.orders: dict[Connection, _Order] = {}
        self.ended: list[Any] = []
        self.stop_by: float | None = None

    def start(self, count: int) -> None:
        first = [order for order in (self._next() for _ in range(count)) if order is not None]
        channels = [self._new_worker() for _ in first]
        for channel, order in zip(channels, first, strict=True):
            self._feed(channel, order)

    def news(self) -> Iterator[News]:
        while self._go_on():
            for channel in wait(list(self.processes), POLL_SECONDS):
                assert isinstance(channel, Connection)
                order = self.orders[channel]
                try:
                    what, value = channel.recv()
                except (EOFError, OSError) as error:
                    given_up = self._lost(channel, order, error)
                    if given_up:
                        yield News(order.index, None, True, died=True)
                    continue
                if what == "raised":
                    raise value
                news = News(order.index, value, what == "done")
                self._listen()
                if news.done:
                    self._feed(channel, self._next())
                yield news

    def close(self) -> None:
        """End the workers without waiting for their work."""
        for channel in list(self.processes):
            self._ended(channel)
        for process in self.ended:
            process.terminate()
        for process in self.ended:
            process.join()

    def _next(self) -> _Order | None:
        """Return what is to be done next, or None at the end."""
        if self.stop_by is not None:
            return None
        return self.again.popleft() if self.again else next(self.left, None)

    def _new_worker(self) -> Connection:
        ours, theirs = self.context.Pipe()
        # a fork inherits our ends: a worker would never learn that this process has gone
        method = self.context.get_start_method()
        inherited = (ours, *self.processes) if method == "fork" else ()
        process = self.context.Process(
            target=_serve, args=(theirs, inherited, self.function), daemon=True
        )
        # a fork server would hand the blocked signal on to other people's processes
        shielded = contextlib.nullcontext() if method == "forkserver" else _without_interrupts()
        with warnings.catch_warnings(), shielded:
            # of newer Pythons, about forks beside a numerical library
            warnings.simplefilter("ignore", DeprecationWarning)
            process.start()
        theirs.close()
        self.processes[ours] = process
        return ours

    def _go_on(self) -> bool:
        self._listen()
        return bool(self.processes) and (self.stop_by is None or time.monotonic() < self.stop_by)

    def _listen(self) -> None:
        """Tell the workers to stop, once, if this process was told to."""
        if self.cancel.cancelled and self.stop_by is None:
            self.stop_by = time.monotonic() + GRACE_SECONDS
            for channel in self.orders:
                _send(channel, None)

    def _feed(self, channel: Connection, order: _Order | None) -> None:
        """Give a free worker its next item, or let it end."""
        _send(channel, None if order is None else (order.item,))
        if order is None:
            self._ended(channel)
        else:
            self.orders[channel] = order

    def _lost(self, channel: Connection, order: _Order, error: Exception) -> bool:
        """Whether the item that a worker died of is given up; otherwise another worker tries it."""
        self._listen()  # Ctrl-C may have ended a worker that was only just starting
        if self.stop_by is None and self.tries is None:
            raise OrbiflowError(
                "a worker process died: was memory short, or is the script that called this "
                'without `if __name__ == "__main__":`? Try workers=1'
            ) from error
        self._ended(channel)
        if self.stop_by is not None or self.tries is None:
            return False
        given_up = order.tried + 1 >= self.tries
        if not given_up:
            self.again.append(replace(order, tried=order.tried + 1))
        following = self._next()
        if following is not None:
            self._feed(self._new_worker(), following)
        return given_up

    def _ended(self, channel: Connection) -> None:
        self.ended.append(self.processes.pop(channel))
        self.orders.pop(channel, None)
        channel.close()


def _serve(channel: Connection, inherited: Iterable[Connection], function: Function) -> None:
    """Do what a worker does until it is told to end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, STOPS)
    for other in inherited:
        other.close()
    use_one_thread()
    cancel = Polled(channel.poll)  # any word from its parent means stop, and its death
    with contextlib.suppress(EOFError, OSError, Cancelled):  # nobody listens any more
        while (order := channel.recv()) is not None:
            try:
                answer = "done", function(order[0], lambda n: channel.send(("told", n)), cancel)
            except Cancelled:
                raise
            except Exception as error:
                answer = "raised", _portable(error)
            channel.send(answer)


def _portable(error: Exception) -> Exception:
    """Return an error with its traceback as a note, as a plain error if it cannot be pickled."""
    error.add_note("in a worker process:\n" + traceback.format_exc())
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError("\n".join([f"{type(error).__name__}: {error}", *error.__notes__]))
    return error


def _send(channel: Connection, value: Any) -> None:
    with contextlib.suppress(OSError):  # a worker that has died is noticed when it is read from
        channel.send(value)


@contextlib.contextmanager
def _without_interrupts() -> Generator[None]:
    """Let Ctrl-C and SIGTERM wait while a process starts, until the process handles them itself."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, STOPS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
