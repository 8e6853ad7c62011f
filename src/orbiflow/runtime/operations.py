"""Operations: public functions from which a command line, a JSON form and a reference are derived.

**To add an operation**, write a function in a light module (heavy libraries are imported inside it)
and name it in `orbiflow.settings.commands`::

    @operation("export")
    def export(
        result: Path,
        settings: ExportSettings = ExportSettings(),
        *,
        out: Annotated[Path | None, Option("-o"), DefaultText("named after the tile")] = None,
        on_event: Sink = ignore,
        cancel: Cancel = NEVER,
    ) -> Outcome:
        \"\"\"Write a tiling in real size.

        Args:
            result: A search's folder, or its result.json.
            out: The file.
        \"\"\"

Parameters are paths, simple values and settings classes, annotated like the fields of those; a
parameter that can be given by position and has no default is an argument of the command, every other
one an option. Settings are flattened, so names must be unique within an operation. The body is
read, call, write; it returns an `Outcome`, and raises `SettingError` for a mistake, before it imports
anything heavy where that is possible.

When called, arguments are checked; `on_event` gets `Started`, then what the body sends, then
`Finished` or `Failed`.
"""

from __future__ import annotations

import inspect
import re
import typing
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field
from functools import cache, cached_property, wraps
from importlib import import_module
from typing import Any, Literal, ParamSpec, TypeVar, cast

from orbiflow.errors import OrbiflowError, SettingError, advice_of, literal
from orbiflow.runtime.events import (
    Cancel,
    Cancelled,
    Event,
    Failed,
    Finished,
    Note,
    Progress,
    Started,
)
from orbiflow.settings import (
    Field,
    Positional,
    Settings,
    as_instance,
    check_names,
    check_rules,
    described,
    fields_of,
    meant,
    naming_extras,
)

SCHEMA_VERSION = 2
SCHEMA = "https://json-schema.org/draft/2020-12/schema"
OWN_PARAMETERS = ("on_event", "cancel")
"""Parameters that every operation may have and no user sets by name."""

Sink = Callable[[Event], None]
P = ParamSpec("P")
R = TypeVar("R", bound="Outcome")


def ignore(_event: Event) -> None:
    """Ignore an event."""


@dataclass(frozen=True)
class Outcome:
    """What came of an operation.

    - `summary`: What was done, as JSON has it.
    - `state`: "done", "nothing found", or "cancelled" if it was stopped and kept what it had.
    - `failed`: The number of items, of many, that have no result.
    """

    summary: dict[str, Any] = field(default_factory=dict[str, Any])
    state: Literal["done", "nothing found", "cancelled"] = "done"
    failed: int = 0

    @property
    def exit_status(self) -> int:
        """The status with which the command ends."""
        return {"done": int(self.failed > 0), "nothing found": 1, "cancelled": 130}[self.state]


@dataclass(frozen=True, eq=False)
class Operation:
    """A public function that is known by name.

    - `name`: What the command line and JSON call it; a space separates a group from its command.
    - `function`: The function as it was written.
    - `keeps_partial`: Whether it can be stopped and keeps what it has.
    - `starts_processes`: Whether it forks, so that no thread may run beside it.
    """

    name: str
    function: Callable[..., Outcome]
    keeps_partial: bool = False
    starts_processes: bool = False

    @cached_property
    def fields(self) -> tuple[Field, ...]:
        """All parameters, settings flattened, in the order of the signature."""
        entries: list[Field] = []
        for part in self._parts.values():
            entries += [part] if isinstance(part, Field) else fields_of(part)
        names = [entry.name for entry in entries]
        if len(set(names)) < len(names):
            raise TypeError(f"settings of {self.name} share a name: {sorted(names)}")
        return tuple(entries)

    @cached_property
    def _parts(self) -> dict[str, Field | type[Settings]]:
        """A field for each simple parameter, its class for each that is of settings."""
        hints = typing.get_type_hints(self.function, include_extras=True)
        parts: dict[str, Field | type[Settings]] = {}
        for name, parameter in inspect.signature(self.function).parameters.items():
            if name in OWN_PARAMETERS:
                continue
            hint = hints[name]
            if isinstance(hint, type) and issubclass(hint, Settings):
                parts[name] = hint
                continue
            required = parameter.default is parameter.empty
            is_argument = required and parameter.kind is parameter.POSITIONAL_OR_KEYWORD
            metadata = cast(tuple[Any, ...], getattr(cast(Any, hint), "__metadata__", ()))
            parts[name] = Field(
                name,
                hint,
                MISSING if required else parameter.default,
                lambda name=name: self._argument_docs.get(name, ""),
                positional=is_argument or Positional() in metadata,
            )
        return parts

    @cached_property
    def doc(self) -> str:
        """The description in the docstring, without its sections."""
        return re.split(r"\n(?:Args|Returns|Raises):\n", inspect.getdoc(self.function) or "")[
            0
        ].strip()

    @cached_property
    def _argument_docs(self) -> dict[str, str]:
        text = inspect.getdoc(self.function) or ""
        section = re.search(r"\nArgs:\n((?:    .*\n?|\n)*)", text)
        entries = re.split(r"^    (?=\w+: )", section[1] if section else "", flags=re.MULTILINE)
        return dict(entry.split(": ", 1) for entry in entries if ": " in entry)

    def call(self, given: Mapping[str, Any]) -> Call:
        """Return a call with these parameters and settings, all in one mapping, checked."""
        check_names(given, self.fields, self.name)
        arguments: dict[str, Any] = {}
        for name, part in self._parts.items():
            if isinstance(part, Field):
                arguments[name] = part.read(given[name]) if name in given else part.default
            else:
                names = {entry.name for entry in fields_of(part)}
                arguments[name] = part(**{key: given[key] for key in given if key in names})
        return self._ruled(Call(self, arguments, frozenset(given)))

    def bound(self, arguments: Mapping[str, Any]) -> Call:
        """Return a call with these arguments of the function, checked."""
        checked = dict(arguments)
        names: set[str] = set()
        for name, part in self._parts.items():
            if name not in arguments:
                continue
            if isinstance(part, Field):
                checked[name] = part.read(arguments[name])
                names.add(name)
            else:
                names |= as_instance(arguments[name], part, name).fields_given
        return self._ruled(Call(self, checked, frozenset(names)))

    def _ruled(self, call: Call) -> Call:
        simple = [part for part in self._parts.values() if isinstance(part, Field)]
        defaults = {entry.name: entry.default for entry in simple}
        check_rules(simple, {**defaults, **call.flat}, call.given)
        return call

    @property
    def schema(self) -> dict[str, Any]:
        """The JSON form as JSON Schema."""
        required = [entry.name for entry in self.fields if entry.required]
        return {
            "$schema": SCHEMA,
            "title": self.name,
            "description": self.doc,
            "type": "object",
            "properties": {
                "schema_version": {"const": SCHEMA_VERSION},
                "operation": {"const": self.name},
                **{entry.name: entry.schema for entry in self.fields},
            },
            "required": ["schema_version", "operation", *required],
            "additionalProperties": False,
        }


@dataclass(frozen=True)
class Call:
    """An operation with its arguments, checked: what can be run, written down and sent elsewhere.

    - `arguments`: Those of the function.
    - `given`: The names of parameters and settings that were given.
    """

    operation: Operation
    arguments: dict[str, Any]
    given: frozenset[str]

    def run(self, on_event: Sink = ignore, cancel: Cancel | None = None) -> Outcome:
        """Run the operation and send its events."""
        broken = False  # whether the sink has failed, so that it gets no `Failed`

        def send(event: Event) -> None:
            nonlocal broken
            broken = True
            on_event(event)
            broken = False

        send(Started(self.operation.name))
        try:
            called = self.operation
            with naming_extras(f"orbiflow {called.name}"):
                outcome = called.function(
                    **self.arguments, on_event=send, cancel=cancel or Cancel()
                )
        except Cancelled:
            send(Finished("cancelled", {}))
            raise
        except Exception as error:
            is_mistake = isinstance(error, OrbiflowError)
            message = advice_of(error) if is_mistake else f"{type(error).__name__}: {error}"
            if not broken:
                send(Failed(message, "mistake" if is_mistake else "error"))
            raise
        send(Finished(outcome.state, outcome.summary))
        return outcome

    @property
    def flat(self) -> dict[str, Any]:
        """All parameters and settings by name, whether given or not."""
        flat: dict[str, Any] = {}
        for name, value in self.arguments.items():
            if isinstance(value, Settings):
                flat |= {entry.name: getattr(value, entry.name) for entry in fields_of(type(value))}
            else:
                flat[name] = value
        return flat

    def to_json(self) -> dict[str, Any]:
        """Return the JSON form, with what was given; `call_from_json` restores an equal call."""
        flat = self.flat
        return {
            "schema_version": SCHEMA_VERSION,
            "operation": self.operation.name,
            **{
                entry.name: entry.kind.plain(flat[entry.name])
                for entry in self.operation.fields
                if entry.name in self.given
            },
        }

    def __reduce__(self) -> tuple[Any, ...]:
        return call_from_json, (self.to_json(),)


def operation(
    name: str, *, keeps_partial: bool = False, starts_processes: bool = False
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Make a function an operation: its arguments are checked and its events sent.

    Args:
        name: The name by which `orbiflow.settings.commands` knows it.
        keeps_partial: Whether it can be stopped and keeps what it has.
        starts_processes: Whether it forks, so that no thread may run beside it.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        made = Operation(name, function, keeps_partial, starts_processes)
        signature = inspect.signature(function)

        @wraps(function)
        def checked(*args: P.args, **kwargs: P.kwargs) -> R:
            arguments = dict(signature.bind(*args, **kwargs).arguments)
            on_event: Any = arguments.pop("on_event", ignore)
            cancel: Any = arguments.pop("cancel", None)
            return cast(R, made.bound(arguments).run(on_event, cancel))

        checked.__dict__["operation"] = made
        return checked

    return decorate


def progress_events(send: Sink, cancel: Cancel) -> Callable[[float, str], None]:
    """Return a function that sends the share of the work done and what is being done.

    The share that is sent never falls. The function raises `Cancelled` if the work is to stop.
    """
    reached = 0.0

    def progress(share: float, what: str) -> None:
        nonlocal reached
        cancel.check()
        reached = max(reached, share)
        send(Progress(min(1.0, reached), what))

    return progress


def as_part(send: Sink, begin: float = 0.0, end: float = 1.0) -> Sink:
    """Return a sink for an operation that another one calls, which is a part of its work.

    It passes on notes, and progress as from one share of the whole to another; nothing else.

    >>> events = []
    >>> as_part(events.append, 0.5, 1.0)(Progress(0.5, "drawing"))
    >>> events[0].share
    0.75
    """

    def pass_on(event: Event) -> None:
        if isinstance(event, Progress):
            send(Progress(begin + (end - begin) * event.share, event.what))
        elif isinstance(event, Note):
            send(event)

    return pass_on


@cache
def find(name: str) -> Operation:
    """Return the operation that `orbiflow.settings.commands` has under a name, importing its module.

    Raises `SettingError` if there is none.
    """
    from orbiflow.settings import OPERATIONS, WORK

    place = {**OPERATIONS, **WORK}.get(name)
    if place is None:
        hint = meant(name, list(OPERATIONS)) or f"there are {', '.join(OPERATIONS)}"
        raise SettingError(f"unknown operation {literal(described(name))}; {literal(hint)}")
    module, function = place.split(":")
    with naming_extras(f"orbiflow {name}"):
        return getattr(import_module(module), function).operation


def call_from_json(document: object) -> Call:
    """Return the call that a JSON object of `Call.to_json` describes.

    Raises `SettingError` if it is not such an object, or a setting in it is not allowed.
    """
    if not isinstance(document, dict):
        raise SettingError(f"expected a JSON object, got {literal(described(document))}")
    values = dict(cast(dict[str, Any], document))
    version, name = values.pop("schema_version", None), values.pop("operation", None)
    if version != SCHEMA_VERSION:
        raise SettingError(
            f"{{schema_version}} must be {SCHEMA_VERSION}, got {literal(described(version))}; "
            "write the file again with this version of orbiflow"
        )
    if not isinstance(name, str):
        raise SettingError(f"{{operation}} must be a name, got {literal(described(name))}")
    return find(name).call(values)
