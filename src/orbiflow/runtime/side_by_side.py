"""Functions that run in threads of this process, side by side."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache, partial
from queue import SimpleQueue
from typing import Any, Self, TypeVar

from orbiflow.runtime.events import Cancelled
from orbiflow.runtime.threads import cores, one_core, one_thread

T = TypeVar("T")
Tell = Callable[..., None]
"""A function that is called with news of what runs."""


class SideBySide:
    """Functions that run in threads, as many at a time as there are `cores`.

    Threads are safe in any script or notebook, and torch computes in several at once. With one core
    each function runs in the caller's thread when its result is asked for. Functions that share nothing
    have the same results either way. What they tell is heard in the thread that waits for them; if
    hearing it fails, such as by `Cancelled`, all end with their next word.

    >>> with SideBySide() as work:
    ...     results = [work.begin(lambda tell, n=n: n * n) for n in range(3)]
    ...     [result() for result in results]
    [0, 1, 4]
    """

    def __init__(self) -> None:
        count = cores()
        self._pool = ThreadPoolExecutor(count) if count > 1 else None
        self._words: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._stopping = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        """End what still runs."""
        self._stopping = True
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)

    def begin(self, function: Callable[[Tell], T], tell: Tell = lambda *_: None) -> Callable[[], T]:
        """Begin a function, which is given what tells its news; return what waits for its result."""
        if self._pool is None:
            return cache(partial(function, tell))
        future = self._pool.submit(self._run, function, tell)
        future.add_done_callback(lambda _: self._words.put(None))
        return partial(self._result, future)

    def _run(self, function: Callable[[Tell], Any], tell: Tell) -> Any:
        def say(*news: Any) -> None:
            if self._stopping:
                raise Cancelled
            self._words.put(partial(tell, *news))

        with one_core(), one_thread():
            return function(say)

    def _result(self, future: Future[Any]) -> Any:
        while not (future.done() and self._words.empty()):
            word = self._words.get()  # None at the end of each function
            if word is not None:
                word()
        return future.result()
