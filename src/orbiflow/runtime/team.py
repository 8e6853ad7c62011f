"""Work on many items, stage after stage, in this process or in some."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from orbiflow.runtime.events import Cancel, Progress
from orbiflow.runtime.operations import Sink
from orbiflow.runtime.processes import process_context, work
from orbiflow.runtime.threads import one_blas_thread, one_thread


class Team:
    """Does one kind of work after another, in some processes, and tells how far it is.

    - `module`: The name of the module whose functions do the work.
    - `workers`: The number of processes; 1 stays in this one.
    - `on_event`: Called with `Progress`.
    - `cancel`: Checked before each item.
    - `share`: The share of the whole work that is done before.
    """

    def __init__(
        self, module: str, workers: int, on_event: Sink, cancel: Cancel, share: float = 0.0
    ) -> None:
        self.workers, self.on_event, self.cancel, self.share = workers, on_event, cancel, share
        self.context = process_context((module,)) if workers > 1 else None

    def each(
        self,
        do: Callable[[Any], Any],
        items: Sequence[Any],
        what: str,
        share: float,
        tell: Callable[[Any], object] = lambda _: None,
    ) -> list[Any]:
        """Return what is done of each item, in their order, up to a share of the whole work.

        `tell` is called with each as soon as it is done.

        Raises `Cancelled` if the token was cancelled.
        """
        results: list[Any] = [None] * len(items)
        begin, self.share = self.share, share

        def ended(count: int) -> None:
            self.on_event(Progress(begin + (share - begin) * count / max(1, len(items)), what))

        ended(0)
        if self.context is None or len(items) < 2:
            with one_thread(), one_blas_thread():
                for k, item in enumerate(items):
                    self.cancel.check()
                    results[k] = do(item)
                    tell(results[k])
                    ended(k + 1)
            return results
        job, count = partial(_job, do), 0
        running = work(job, items, self.workers, context=self.context, cancel=self.cancel)
        with contextlib.closing(running) as news:
            for event in news:
                if event.done:
                    count += 1
                    results[event.index] = event.value
                    tell(event.value)
                    ended(count)
        self.cancel.check()
        return results


def _job(do: Callable[[Any], Any], item: Any, _tell: object, _cancel: object) -> Any:
    with one_thread(), one_blas_thread():
        return do(item)
