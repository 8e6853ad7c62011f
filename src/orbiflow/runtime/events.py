"""Events that an operation sends while it runs, and the token that stops it.

`Started` comes first; then `Note`, `Table`, `Progress`, `Preview` (at most one, before any
`TileFound`), `TileFound`, `ClassFailed`, `ItemDone` and `Written` as they happen; last `Finished` or
`Failed`. The `share` of `Progress` never falls, nor does its `class_share` within a class. Each class
of a search has exactly one outcome after its last `Progress`: `TileFound` or `ClassFailed`. `ItemDone`
comes when the folder of an item has its final name, and `Written` when a file has.

All events come in the thread that called the operation, or from `CallProcess.events`.
"""

from __future__ import annotations

import dataclasses
import json
import re
import typing
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, Literal

from orbiflow.errors import Advice, SettingError, literal
from orbiflow.runtime.files import is_object
from orbiflow.settings import Field, check_names, described


class Event:
    """Base of all events."""

    kind: ClassVar[str]
    """The name of the class in JSON, such as "tile-found"."""

    def __init_subclass__(cls) -> None:
        cls.kind = re.sub(r"(?<=[a-z])(?=[A-Z])", "-", cls.__name__).lower()

    def to_json(self) -> dict[str, Any]:
        """Return the event as JSON has it; `event_from_json` restores an equal one.

        A text that names settings has its `template` beside it.
        """
        values = {
            name: str(value) if isinstance(value, Path) else value
            for name, value in vars(self).items()
        }
        templates = [value.template for value in values.values() if isinstance(value, Advice)]
        return {"kind": self.kind, **values, **({"template": templates[0]} if templates else {})}


@dataclass(frozen=True)
class Started(Event):
    """An operation of this name has begun."""

    operation: str


@dataclass(frozen=True)
class Note(Event):
    """Something that the user should know, in words.

    - `warning`: Whether it is something that went wrong, rather than what was done.
    """

    text: str
    warning: bool = False


@dataclass(frozen=True)
class Table(Event):
    """A small table of results to look at, as words; the summary of `Finished` has the figures.

    - `columns`: The headings.
    - `rows`: The cells of each row.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Progress(Event):
    """How far the operation is.

    - `share`: The share of the work that is done, from 0 to 1.
    - `what`: What is being done.
    - `class_name`: In a search, the class that moved on.
    - `class_share`: How far this class is.
    - `loss`: Its best result so far in the method's own measure (for the descent 1 - IoU); None if it
      is not known.
    """

    share: float
    what: str
    class_name: str | None = None
    class_share: float | None = None
    loss: float | None = None


@dataclass(frozen=True)
class Preview(Event):
    """A first certified tile, `seconds` after the start; the search is going to improve on it."""

    class_name: str
    iou: float
    seconds: float


@dataclass(frozen=True)
class TileFound(Event):
    """The best tile of a class."""

    class_name: str
    iou: float
    score: float
    certified: bool


@dataclass(frozen=True)
class ClassFailed(Event):
    """A class that gave no tile, or was interrupted."""

    class_name: str
    reason: str


@dataclass(frozen=True)
class ItemDone(Event):
    """An item of a batch has finished.

    - `name`: The name of its folder among the results.
    - `what`: Its result, or why it has none, in words.
    """

    name: str
    state: Literal["done", "nothing found", "failed"]
    what: str


@dataclass(frozen=True)
class Written(Event):
    """A file is complete and has its final name."""

    path: Path


State = Literal["done", "nothing found", "cancelled"]


@dataclass(frozen=True)
class Finished(Event):
    """The end of an operation.

    - `state`: "cancelled" if it was stopped; what was found by then is written.
    - `summary`: What was done, as JSON has it; each operation has its own.
    """

    state: State
    summary: dict[str, Any]

    def __post_init__(self) -> None:
        # the same here as where it comes from another process
        plain = json.loads(json.dumps(self.summary, allow_nan=False))
        object.__setattr__(self, "summary", plain)


@dataclass(frozen=True)
class Failed(Event):
    """The end of an operation without a result.

    - `failure`: "mistake" for what the user can mend, "error" for a fault of orbiflow, "died" for a
      process that ended without a word.
    """

    message: str
    failure: Literal["mistake", "error", "died"]


EVENTS: dict[str, type[Event]] = {event.kind: event for event in Event.__subclasses__()}


def event_from_json(document: object) -> Event:
    """Return the event that a JSON object of `Event.to_json` describes.

    Raises:
        SettingError: If it is not such an object.

    >>> event_from_json({"kind": "note", "text": "dark on light"})
    Note(text='dark on light', warning=False)
    """
    if not is_object(document):
        raise SettingError(f"an event is a JSON object, got {literal(described(document))}")
    kind = document.get("kind")
    if not isinstance(kind, str) or kind not in EVENTS:
        raise SettingError(
            f"unknown kind of event {literal(described(kind))}; there are {', '.join(EVENTS)}"
        )
    values = {name: value for name, value in document.items() if name not in ("kind", "template")}
    fields = _fields(EVENTS[kind])
    check_names(values, fields.values(), kind)
    read = {name: _read(fields[name], value) for name, value in values.items()}
    template = document.get("template")
    for name in ("text", "message"):
        if isinstance(template, str) and name in read:
            read[name] = Advice(template)
    return EVENTS[kind](**read)


@cache
def _fields(event: type[Event]) -> dict[str, Field]:
    hints = typing.get_type_hints(event)
    return {
        entry.name: Field(entry.name, hints[entry.name], entry.default, str)
        for entry in dataclasses.fields(typing.cast(Any, event))
    }


def _read(field: Field, value: Any) -> Any:
    if field.name != "summary":
        return field.read(value)
    with suppress(TypeError, ValueError):
        if is_object(value) and json.dumps(value, allow_nan=False):
            return value
    raise SettingError(f"{{summary}} must be a JSON object, got {literal(described(value))}")


class Cancelled(Exception):
    """The work was stopped by its token. No mistake, hence no `OrbiflowError`."""


class Cancel:
    """A token that stops work: it is handed down and looked at between steps.

    It can be cancelled from any thread or from a signal handler.

    >>> cancel = Cancel()
    >>> cancel.check()
    >>> cancel.cancel()
    >>> cancel.cancelled
    True
    """

    def __init__(self) -> None:
        # no lock: a signal handler may come while this very thread holds it
        self._told = False

    def cancel(self) -> None:
        """Ask for the end; there is no way back."""
        self._told = True

    @property
    def cancelled(self) -> bool:
        """Whether the end was asked for."""
        return self._told

    def check(self) -> None:
        """Raise `Cancelled` if the end was asked for; to be called between steps."""
        if self.cancelled:
            raise Cancelled


class Polled(Cancel):
    """A token that is also cancelled once `poll` returns true, or fails as the system does."""

    def __init__(self, poll: Callable[[], bool]) -> None:
        super().__init__()
        self._poll = poll

    @property
    def cancelled(self) -> bool:
        if not self._told:
            try:
                self._told = self._poll()
            except OSError:
                self._told = True
        return self._told


NEVER = Cancel()
"""The default of functions that take a token: nobody cancels it."""
