"""The job of an `EscherizeRequest`, for batches."""

from __future__ import annotations

from orbiflow.jobs.run import Sink
from orbiflow.jobs.tile_requests import EscherizeRequest
from orbiflow.runtime import Cancel, Finished, find


def escherize(request: EscherizeRequest, tell: Sink, cancel: Cancel) -> Finished:
    """Run the operation of the same name."""
    document = request.to_json()
    fields = {entry.name: entry for entry in find("escherize").fields}
    given = {
        name: value
        for name, value in document.items()
        if name in fields and value is not None and value != fields[name].default
    }
    call = find("escherize").call(given)
    outcome = call.operation.function(**call.arguments, on_event=tell, cancel=cancel)
    return Finished(outcome.state, outcome.summary)
