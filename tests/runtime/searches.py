"""Small searches, and the order that events must come in."""

import json
from contextlib import suppress
from pathlib import Path
from typing import Any

from orbiflow.runtime import (
    Call,
    Cancel,
    Cancelled,
    ClassFailed,
    Event,
    Failed,
    Finished,
    Note,
    Preview,
    Progress,
    Sink,
    Started,
    Table,
    TileFound,
    Written,
    find,
    ignore,
)

BOOT = [(60, 20), (210, 20), (230, 80), (170, 95), (160, 190), (100, 145), (45, 80)]


def boot_call(folder: Path, *classes: str, **more: Any) -> Call:
    """Search for likeness, which imports no torch; small with `small_searches`."""
    path = folder / "boot.json"
    path.write_text(json.dumps(BOOT))
    given = {"image": path, "out": folder / "out", "classes": classes, "effort": "fast"}
    return find("escherize").call({**given, "workers": 1, **more})


def run(call: Call, sink: Sink = ignore, cancel: Cancel | None = None) -> Finished:
    """Run a call and return its last event, cancelled or not."""
    last: list[Event] = []

    def keep(event: Event) -> None:
        last[:] = [event]
        sink(event)

    with suppress(Cancelled):
        call.run(keep, cancel)
    assert isinstance(last[0], Finished)
    return last[0]


def check_order(events: list[Event], *classes: str) -> None:
    """What the documentation of `orbiflow.runtime.events` promises."""
    kinds = [type(event) for event in events]
    assert kinds[0] is Started
    assert kinds[-1] in (Finished, Failed)
    assert set(kinds[1:-1]) <= {*(Note, Table, Progress, Preview, TileFound, ClassFailed, Written)}
    assert kinds.count(Preview) <= 1
    if Preview in kinds and TileFound in kinds:
        assert kinds.index(Preview) < kinds.index(TileFound)
    shares = [event.share for event in events if isinstance(event, Progress)]
    assert shares == sorted(shares)
    assert all(0 <= share <= 1 for share in shares)
    for name in classes:
        own = [
            event
            for event in events
            if isinstance(event, Progress | TileFound | ClassFailed) and event.class_name == name
        ]
        assert isinstance(own[-1], TileFound | ClassFailed)
        steps = [event for event in own if isinstance(event, Progress)]
        assert len(steps) == len(own) - 1
        parts = [event.class_share or 0.0 for event in steps]
        assert parts == sorted(parts)
    if Written in kinds:
        assert all(
            kind in (Note, Table, Written, Finished, Failed)
            for kind in kinds[kinds.index(Written) :]
        )
