"""What a job tells while it runs.

In this order: `Started`; then `Note`, `Progress`, `Preview` (one at most, before any `TileFound`),
`TileFound`, `ClassFailed`, `ItemDone` and `Written` as they happen; last either `Finished` or `Failed`.
The `share` of `Progress` never falls, nor does its `class_share` within a class. Each class of a search
has exactly one outcome after its last `Progress`: `TileFound` or `ClassFailed`. `ItemDone` comes when
the folder of one of many has its final name; `Written` when a file has: after the work, before
`Finished`.

All come in the thread that called `run`, or out of `Job.events`.
"""

from __future__ import annotations

import reprlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from orbiflow.jobs.records import Record, kind_of
from orbiflow.runtime import is_object


class Event(Record):
    """Base of all events."""


@dataclass(frozen=True)
class Started(Event):
    """Always first. `job`: the request's kind."""

    KIND = "started"

    job: str


@dataclass(frozen=True)
class Note(Event):
    """Something that the user should know, in words."""

    KIND = "note"

    text: str


@dataclass(frozen=True)
class Progress(Event):
    """How far it is.

    - `share`: of the work done, 0 to 1. `what`: is being done.
    - `class_name`, `class_share`, `loss`: in a search, the class that moved on, how far it is, and
      the best so far in the method's own measure (for the descent 1 - IoU), None if not known.
    """

    KIND = "progress"

    share: float
    what: str
    class_name: str | None = None
    class_share: float | None = None
    loss: float | None = None


@dataclass(frozen=True)
class Preview(Event):
    """A first certified tile, which the search is going to improve on; `seconds` after its start."""

    KIND = "preview"

    class_name: str
    iou: float
    seconds: float


@dataclass(frozen=True)
class TileFound(Event):
    """The best tile of a class."""

    KIND = "tile-found"

    class_name: str
    iou: float
    score: float
    certified: bool


@dataclass(frozen=True)
class ClassFailed(Event):
    """A class that gave no tile, or was interrupted."""

    KIND = "class-failed"

    class_name: str
    reason: str


@dataclass(frozen=True)
class ItemDone(Event):
    """One of many is done with, in a batch.

    - `name`: of its folder among the results. `what`: came of it, in words.
    """

    KIND = "item-done"

    name: str
    state: Literal["done", "nothing found", "failed"]
    what: str


@dataclass(frozen=True)
class Written(Event):
    """A file is there, whole."""

    KIND = "written"

    path: Path


State = Literal["done", "nothing found", "cancelled"]


@dataclass(frozen=True)
class Finished(Event):
    """The end.

    - `state`: "cancelled" if it was told to stop; what was found by then is written.
    - `summary`: what came of it, by the request's kind; see its module.
    """

    KIND = "finished"

    state: State
    summary: dict[str, Any]


@dataclass(frozen=True)
class Failed(Event):
    """The end without a result.

    - `failure`: "mistake" for what the user can mend, "error" for a fault of orbiflow, "died" for a
      process that ended without a word.
    """

    KIND = "failed"

    message: str
    failure: Literal["mistake", "error", "died"]


EVENTS: dict[str, type[Event]] = {
    kind.KIND: kind
    for kind in (
        Started,
        Note,
        Progress,
        Preview,
        TileFound,
        ClassFailed,
        ItemDone,
        Written,
        Finished,
        Failed,
    )
}


def event_from_json(document: object) -> Event:
    """An event from what its `to_json` gave.

    Raises:
        RecordError: if it is no event.

    >>> event_from_json({"kind": "note", "text": "dark on light"})
    Note(text='dark on light')
    """
    kind = kind_of(document, EVENTS, "event")
    assert issubclass(kind, Event)
    assert is_object(document), reprlib.repr(document)
    return kind.of_fields({name: value for name, value in document.items() if name != "kind"})
