"""Kinds of values that a setting may have, compiled from the annotation of its field.

A kind reads a value from Python or JSON (`read`) and from the command line (`parse`), writes it as
JSON (`plain`), and describes itself in words and as JSON Schema. Annotations may be built from `bool`,
`int`, `float` (always finite), `str`, `Path`, `Literal`, tuples, unions of these and None, and
`Annotated` with `Range`, `Unit`, `Parsed` and `Repeated`.
"""

from __future__ import annotations

import types
import typing
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import repeat
from numbers import Integral, Real
from pathlib import Path
from typing import Any, Literal, Union, cast

from orbiflow.arguments import ANY, Range, described, meant, number_wanted, one_of, path_text
from orbiflow.errors import OrbiflowError


@dataclass(frozen=True)
class Unit:
    """The unit of a number, for help and schema, such as "mm", "s" or "degrees"."""

    name: str


@dataclass(frozen=True)
class Parsed:
    """Text is read by a function, wherever it comes from; other values as the annotated type.

    - `read`: The function; it raises an `OrbiflowError` for what it cannot read.
    - `wanted`: What the text must be, such as "a length such as 40mm".
    - `metavar`: What stands for it in the help, such as "LENGTH".
    - `values`: Which values there are, for the help, such as "delft, ink, or your own".
    - `needs`: Another field, whose value the function takes, too, such as "dpi". The text is then read
      when all fields are known.
    """

    read: Callable[..., Any]
    wanted: str
    metavar: str = "TEXT"
    values: str = ""
    needs: str = ""


@dataclass(frozen=True)
class Repeated:
    """A tuple whose option is repeated on the command line, once for each entry.

    Without it the entries of a tuple are separated by commas.
    """


class Refused(ValueError):
    """A value that a kind does not take.

    - `reason`: What is wrong with it, as a sentence that begins with the value. Default: that it is
      not what is `wanted`.
    - `wanted`: What it must be, where that is not all that its kind wants.
    - `hint`: What to do, added to the usual message.
    """

    def __init__(self, reason: str = "", *, wanted: str = "", hint: str = "") -> None:
        super().__init__(reason or wanted or hint)
        self.reason = reason
        self.wanted = wanted
        self.hint = hint


class Kind(ABC):
    """A kind of value."""

    unit: str = ""
    metavar: str = "TEXT"
    choices: tuple[str, ...] = ()
    repeated: bool = False
    needs: str = ""

    @property
    @abstractmethod
    def wanted(self) -> str:
        """What a value must be, in words."""

    @property
    def limits(self) -> str:
        """Which values are allowed, where the help should say so."""
        return ""

    @abstractmethod
    def read(self, value: Any) -> Any:
        """Return a value from Python or JSON as it will be used; raise `Refused` otherwise."""

    def parse(self, text: str) -> Any:
        """Return a text of the command line as it will be used; raise `Refused` otherwise."""
        return self.read(text)

    def finish(self, text: str, known: Any) -> Any:
        """Return what a text means, given the value of the field that the kind `needs`."""
        raise NotImplementedError

    def plain(self, value: Any) -> Any:
        """Return a value as JSON has it."""
        return value

    @property
    @abstractmethod
    def schema(self) -> dict[str, Any]:
        """The kind as JSON Schema."""


class TextKind(Kind):
    """Any text."""

    @property
    def wanted(self) -> str:
        return "text"

    def read(self, value: Any) -> str:
        if not isinstance(value, str):
            raise Refused
        return str(value)

    @property
    def schema(self) -> dict[str, Any]:
        return {"type": "string"}


class PathKind(Kind):
    """The path of a file or folder."""

    metavar = "PATH"

    @property
    def wanted(self) -> str:
        return "a path"

    def read(self, value: Any) -> Path:
        text = path_text(value)
        if text is None:
            raise Refused
        return Path(text)

    def plain(self, value: Any) -> str:
        return str(value)

    @property
    def schema(self) -> dict[str, Any]:
        return {"type": "string", "minLength": 1, "format": "path"}


class FlagKind(Kind):
    """True or false."""

    @property
    def wanted(self) -> str:
        return "true or false"

    def read(self, value: Any) -> bool:
        if not isinstance(value, bool):
            raise Refused
        return value

    def parse(self, text: str) -> bool:
        known = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}
        if text.lower() not in known:
            raise Refused
        return known[text.lower()]

    @property
    def schema(self) -> dict[str, Any]:
        return {"type": "boolean"}


@dataclass(frozen=True)
class NumberKind(Kind):
    """A finite number in a range; a Boolean is not a number."""

    allowed: Range = ANY
    whole: bool = False
    unit: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "metavar", "INT" if self.whole else "NUMBER")

    @property
    def wanted(self) -> str:
        return number_wanted(self.allowed, whole=self.whole)

    @property
    def limits(self) -> str:
        limits = str(self.allowed)
        return f"{limits} {self.unit}" if limits and self.unit else limits or self.unit

    def read(self, value: Any) -> float:
        abstract: type = Integral if self.whole else Real
        if isinstance(value, bool) or not isinstance(value, abstract):
            raise Refused
        given: Any = value
        try:
            number = int(given) if self.whole else float(given)
        except (OverflowError, ValueError):
            raise Refused from None
        if number not in self.allowed:
            raise Refused(wanted=number_wanted(self.allowed, number, whole=self.whole))
        return number

    def parse(self, text: str) -> float:
        try:
            number = int(text) if self.whole else float(text)
        except ValueError:
            raise Refused from None
        return self.read(number)

    @property
    def schema(self) -> dict[str, Any]:
        return {"type": "integer" if self.whole else "number", **self.allowed.schema}


@dataclass(frozen=True)
class ChoiceKind(Kind):
    """One of several words."""

    choices: tuple[str, ...]

    @property
    def wanted(self) -> str:
        return one_of(self.choices)

    def read(self, value: Any) -> str:
        if not isinstance(value, str) or value not in self.choices:
            raise Refused(hint=meant(value, self.choices))
        return str(value)

    @property
    def schema(self) -> dict[str, Any]:
        return {"enum": list(self.choices)}


@dataclass(frozen=True)
class ListKind(Kind):
    """A tuple of any length; a list in JSON."""

    item: Kind
    repeated: bool = False
    may_be_empty: bool = True

    def __post_init__(self) -> None:
        if self.repeated:
            object.__setattr__(self, "metavar", self.item.metavar)

    @property
    def wanted(self) -> str:
        entries = "" if self.may_be_empty else " of one or more entries"
        return f"a list{entries}, each {self.item.wanted}"

    @property
    def limits(self) -> str:
        limits = self.item.limits or ", ".join(self.item.choices)
        return f"each {limits}" if limits else ""

    def read(self, value: Any) -> tuple[Any, ...]:
        return self._whole(_entries(_sequence(value), repeat(self.item), _read))

    def parse(self, text: str) -> tuple[Any, ...]:
        parts = [text] if self.repeated else [part.strip() for part in text.split(",")]
        return self._whole(_entries(list(filter(None, parts)), repeat(self.item), _parse))

    def _whole(self, entries: tuple[Any, ...]) -> tuple[Any, ...]:
        if not entries and not self.may_be_empty:
            raise Refused
        return entries

    def plain(self, value: Any) -> list[Any]:
        return [self.item.plain(part) for part in value]

    @property
    def schema(self) -> dict[str, Any]:
        least = {} if self.may_be_empty else {"minItems": 1}
        return {"type": "array", "items": self.item.schema, **least}


@dataclass(frozen=True)
class TupleKind(Kind):
    """A tuple of a fixed length; a list in JSON."""

    items: tuple[Kind, ...]
    unit: str = ""

    @property
    def wanted(self) -> str:
        return f"{len(self.items)} values, each {self.items[0].wanted}"

    @property
    def limits(self) -> str:
        limits = self.items[0].limits
        return f"each {limits}{self.unit and ' ' + self.unit}" if limits else self.unit

    def read(self, value: Any) -> tuple[Any, ...]:
        return self._taken(_sequence(value), _read)

    def parse(self, text: str) -> tuple[Any, ...]:
        parts = [part.strip() for part in text.split(",")]
        return self._taken(parts, _parse)

    def _taken(self, parts: Sequence[Any], take: Callable[[Kind, Any], Any]) -> tuple[Any, ...]:
        if len(parts) != len(self.items):
            raise Refused
        return _entries(parts, self.items, take)

    def plain(self, value: Any) -> list[Any]:
        return [item.plain(part) for item, part in zip(self.items, value, strict=True)]

    @property
    def schema(self) -> dict[str, Any]:
        size = len(self.items)
        items = [item.schema for item in self.items]
        return {"type": "array", "prefixItems": items, "minItems": size, "maxItems": size}


@dataclass(frozen=True)
class EitherKind(Kind):
    """A value of the first of several kinds that takes it."""

    kinds: tuple[Kind, ...]
    unit: str = ""

    @property
    def wanted(self) -> str:
        return " or ".join(kind.wanted for kind in self.kinds)

    @property
    def limits(self) -> str:
        return " or ".join(kind.limits or ", ".join(kind.choices) for kind in self.kinds)

    def read(self, value: Any) -> Any:
        return self._first(lambda kind: kind.read(value))[1]

    def parse(self, text: str) -> Any:
        return self._first(lambda kind: kind.parse(text))[1]

    def plain(self, value: Any) -> Any:
        kind, value = self._first(lambda kind: kind.read(value))
        return kind.plain(value)

    def _first(self, take: Callable[[Kind], Any]) -> tuple[Kind, Any]:
        for kind in self.kinds:
            try:
                return kind, take(kind)
            except Refused:
                continue
        raise Refused

    @property
    def schema(self) -> dict[str, Any]:
        return {"anyOf": [kind.schema for kind in self.kinds]}


@dataclass(frozen=True)
class OptionalKind(Kind):
    """A value of a kind, or None."""

    inner: Kind

    def __post_init__(self) -> None:
        for name in ("unit", "metavar", "choices", "repeated", "needs"):
            object.__setattr__(self, name, getattr(self.inner, name))

    @property
    def wanted(self) -> str:
        return self.inner.wanted

    @property
    def limits(self) -> str:
        return self.inner.limits

    def read(self, value: Any) -> Any:
        return None if value is None else self.inner.read(value)

    def parse(self, text: str) -> Any:
        return self.inner.parse(text)

    def finish(self, text: str, known: Any) -> Any:
        return self.inner.finish(text, known)

    def plain(self, value: Any) -> Any:
        return None if value is None else self.inner.plain(value)

    @property
    def schema(self) -> dict[str, Any]:
        return {"anyOf": [self.inner.schema, {"type": "null"}]}


@dataclass(frozen=True)
class ParsedKind(Kind):
    """Text that a function reads, or what the function returns."""

    parsed: Parsed
    inner: Kind

    def __post_init__(self) -> None:
        object.__setattr__(self, "unit", self.inner.unit)
        object.__setattr__(self, "metavar", self.parsed.metavar)
        object.__setattr__(self, "needs", self.parsed.needs)

    @property
    def wanted(self) -> str:
        return f"{self.parsed.wanted}{self.inner.limits and ', ' + self.inner.limits}"

    @property
    def limits(self) -> str:
        return self.parsed.values or self.inner.limits

    def read(self, value: Any) -> Any:
        return self.parse(value) if isinstance(value, str) else self.inner.read(value)

    def parse(self, text: str) -> Any:
        return text if self.needs else self._meaning(text)

    def finish(self, text: str, known: Any) -> Any:
        return self._meaning(text, known)

    def _meaning(self, text: str, *known: Any) -> Any:
        try:
            value = self.parsed.read(text, *known)
        except OrbiflowError as error:
            raise Refused(str(error)) from error
        return self.inner.read(value)

    def plain(self, value: Any) -> Any:
        return self.inner.plain(value)

    @property
    def schema(self) -> dict[str, Any]:
        text = {"type": "string", "description": self.parsed.wanted}
        inner = self.inner.schema
        return text if inner == {"type": "string"} else {"anyOf": [inner, text]}


def kind_of(annotation: Any) -> Kind:
    """Return the kind of value that an annotation asks for.

    >>> kind_of(Literal["svg", "pdf"] | None).wanted
    'svg or pdf'
    """
    metadata: tuple[Any, ...] = ()
    if typing.get_origin(annotation) is typing.Annotated:
        annotation, *extra = typing.get_args(annotation)
        metadata = tuple(extra)
    unit = next((entry.name for entry in metadata if isinstance(entry, Unit)), "")
    allowed = next((entry for entry in metadata if isinstance(entry, Range)), ANY)
    repeated = any(isinstance(entry, Repeated) for entry in metadata)
    kind = _plain_kind(annotation, allowed, unit, repeated)
    parsed = next((entry for entry in metadata if isinstance(entry, Parsed)), None)
    return kind if parsed is None else ParsedKind(parsed, kind)


def _plain_kind(annotation: Any, allowed: Range, unit: str, repeated: bool) -> Kind:
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if annotation in (int, float):
        return NumberKind(allowed, annotation is int, unit)
    simple: dict[Any, type[Kind]] = {
        str: TextKind, Path: PathKind, bool: FlagKind
    }  # fmt: skip
    if annotation in simple:
        return simple[annotation]()
    if origin is Literal:
        return ChoiceKind(arguments)
    if origin is tuple and arguments[-1] is ...:
        return ListKind(kind_of(arguments[0]), repeated)
    if origin is tuple:
        return TupleKind(tuple(map(kind_of, arguments)), unit)
    if origin in (Union, types.UnionType):
        # a range or a unit of the whole union is of its numbers
        plain = [part for part in arguments if part is not type(None)]
        kinds = [
            _plain_kind(part, allowed, unit, repeated) if part in (int, float) or repeated
            else kind_of(part)
            for part in plain
        ]  # fmt: skip
        kind = kinds[0] if len(kinds) == 1 else EitherKind(tuple(kinds), unit)
        if len(plain) == len(arguments):
            return kind
        if isinstance(kind, ListKind):  # None is for nothing
            kind = replace(kind, may_be_empty=False)
        return OptionalKind(kind)
    raise TypeError(f"no setting can be annotated {annotation!r}")


def _entries(
    parts: Sequence[Any], kinds: Iterable[Kind], take: Callable[[Kind, Any], Any]
) -> tuple[Any, ...]:
    """What kinds take of the entries of a list; a refusal says which entry."""
    taken: list[Any] = []
    for part, kind in zip(parts, kinds, strict=False):
        try:
            taken.append(take(kind, part))
        except Refused as error:
            wrong = f"must be {error.wanted or kind.wanted}, got {described(part)}"
            more = f"; {error.hint}" if error.hint else ""
            raise Refused(f"entry {len(taken) + 1}: {error.reason or wrong + more}") from error
    return tuple(taken)


def _read(kind: Kind, value: Any) -> Any:
    return kind.read(value)


def _parse(kind: Kind, text: str) -> Any:
    return kind.parse(text)


def _sequence(value: object) -> Sequence[Any]:
    if not isinstance(value, list | tuple):
        raise Refused
    return cast(Sequence[Any], value)
