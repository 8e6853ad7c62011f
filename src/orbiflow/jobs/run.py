"""Running a request in this process."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from orbiflow.errors import OrbiflowError
from orbiflow.jobs.request import Request
from orbiflow.jobs.requests import REQUESTS
from orbiflow.runtime import (
    Cancel,
    Cancelled,
    Event,
    Failed,
    Finished,
    Started,
)

Sink = Callable[[Event], None]

# a module each, imported when it runs: requests can be made and checked without them
_MODULES = {
    "escherize": "escherize",
    "density-fit": "density_fit",
    "density-plot": "density_plot",
    "density-compare": "density_compare",
    "density-region": "density_region",
    "density-patches": "density_use",
    "batch": "batch",
    "density-batch": "batch",
    "density-cv": "density_cv",
    "density-fold": "density_fold",
}


def run(request: Request, sink: Sink | None = None, cancel: Cancel | None = None) -> Finished:
    """Do what is asked for, and tell `sink` all that a user should see.

    Args:
        request: of one of the kinds in `REQUESTS`.
        sink: called in this thread with every event, in the order that
            `orbiflow.runtime.events` states. What it raises ends the job.
        cancel: ends the job early; a search keeps what it has found, others write nothing.

    Returns:
        The last event.

    Raises:
        OrbiflowError: for anything that the user can mend; the last event is then `Failed`.
    """
    tell = _Teller(sink)
    tell(Started(request.KIND))
    try:
        finished = _job_of(request)(request, tell, cancel or Cancel())
    except Cancelled:
        finished = Finished("cancelled", {})
    except OrbiflowError as error:
        tell.failed(Failed(str(error), "mistake"))
        raise
    except Exception as error:
        tell.failed(Failed(f"{type(error).__name__}: {error}", "error"))
        raise
    tell(finished)
    return finished


class _Teller:
    """A sink that is not told of its own failure."""

    def __init__(self, sink: Sink | None) -> None:
        self.sink = sink
        self.broken = False

    def __call__(self, event: Event) -> None:
        if self.sink is not None:
            self.broken = True
            self.sink(event)
            self.broken = False

    def failed(self, event: Failed) -> None:
        if not self.broken:
            self(event)


def _job_of(request: Request) -> Callable[[Any, Sink, Cancel], Finished]:
    if type(request) not in REQUESTS.values():
        raise OrbiflowError(f"{type(request).__name__} is no request that can be run")
    module = import_module(f"orbiflow.jobs.{_MODULES[request.KIND]}")
    return getattr(module, request.KIND.replace("-", "_"))
