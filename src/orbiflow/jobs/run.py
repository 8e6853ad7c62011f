"""Running a request in this process."""

from __future__ import annotations

import dataclasses
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
    find,
)

Sink = Callable[[Event], None]

# a module each, imported when it runs: requests can be made and checked without them
_MODULES = {
    "escherize": "escherize",
    "density-fit": "density_fit",
    "batch": "batch",
    "density-batch": "batch",
    "density-cv": "density_cv",
    "density-fold": "density_fold",
}

_OPERATIONS = ("density-plot", "density-compare", "density-region", "density-patches")
"""Kinds of requests that operations fulfil."""


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


def _fulfil(request: Request, tell: Sink, cancel: Cancel) -> Finished:
    """Call the operation that a request stands for, with what differs from its defaults."""
    operation = find(request.KIND.replace("-", " "))
    values = request.to_json()
    given = {
        entry.name: values[entry.name]
        for entry in dataclasses.fields(request)  # pyright: ignore[reportArgumentType]
        if getattr(request, entry.name) != entry.default
    }
    call = operation.call(given)
    outcome = operation.function(**call.arguments, on_event=tell, cancel=cancel)
    return Finished(outcome.state, outcome.summary)


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
    if request.KIND in _OPERATIONS:
        return _fulfil
    module = import_module(f"orbiflow.jobs.{_MODULES[request.KIND]}")
    return getattr(module, request.KIND.replace("-", "_"))
