"""Kinds of values that a setting may have, compiled from the annotation of its field.

A kind reads a value from Python, JSON or the command line (`read`), writes it as JSON (`plain`), and
describes itself in words and as JSON Schema. Annotations may be built from `bool`, `int`, `float`
(always finite), `str`, `Path`, `Literal`, tuples, unions of one of these and None, and `Annotated` with
`Range`, `Unit`, `Parsed` and `Repeated`.
"""

from __future__ import annotations

import types
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import repeat
from numbers import Integral, Real
from pathlib import Path
from typing import Any, Literal, Union, cast

from orbiflow.errors import OrbiflowError
from orbiflow.settings.arguments import (
    ANY,
    Range,
    described,
    meant,
    number_wanted,
    one_of,
    path_text,
)


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


@dataclass(frozen=True, eq=False)
class OneOf:
    """A text that is one of the names in a table, which may have grown by the time it is looked up.

    - `names`: The table.
    """

    names: Mapping[str, Any]


@dataclass(frozen=True)
class InMemory:
    """A path to something that was saved, or in Python the thing itself, annotated `Any`.

    - `wanted`: What lies at the path.
    """

    wanted: str


class RefusedValue(ValueError):
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


class Kind:
    """A kind of value."""

    wanted = ""
    """What a value must be, in words."""
    schema: Mapping[str, Any]
    """The kind as JSON Schema."""
    limits = ""
    """Which values are allowed, where the help should say so."""
    unit = ""
    metavar = "TEXT"
    """What stands for it in the help."""
    choices: tuple[str, ...] = ()
    """The words that are allowed, if there are only some."""
    repeated = False
    """Whether its option is repeated."""
    needs = ""
    """A field without whose value a text cannot be read."""

    def read(self, value: Any, *, text: bool = False) -> Any:
        """Return a value from Python or JSON as it will be used; raise `RefusedValue` otherwise.

        With `text`, it is one that the command line gives.
        """
        raise NotImplementedError

    def finish(self, text: str, *known: Any) -> Any:
        """Return what a text means, given the value of the field that the kind `needs`."""
        raise NotImplementedError

    def plain(self, value: Any) -> Any:
        """Return a value as JSON has it."""
        return value


class TextKind(Kind):
    """Any text."""

    wanted, schema = "text", {"type": "string"}

    def read(self, value: Any, *, text: bool = False) -> str:  # noqa: ARG002
        if not isinstance(value, str):
            raise RefusedValue
        return str(value)


class PathKind(Kind):
    """The path of a file or folder."""

    wanted, metavar = "a path", "PATH"
    schema: Mapping[str, Any] = {"type": "string", "minLength": 1, "format": "path"}

    def read(self, value: Any, *, text: bool = False) -> Path:  # noqa: ARG002
        path = path_text(value)
        if path is None:
            raise RefusedValue
        return Path(path)

    def plain(self, value: Any) -> str:
        return str(value)


class SavedKind(PathKind):
    """A path to something that was saved, or the thing itself, which its taker checks."""

    def __init__(self, wanted: str) -> None:
        self.wanted = wanted

    def read(self, value: Any, *, text: bool = False) -> Any:
        return super().read(value) if text or path_text(value) is not None else value

    def plain(self, value: Any) -> str:
        if path_text(value) is None:
            raise OrbiflowError(f"{described(value)} is in memory; save it and give its path")
        return str(value)


class FlagKind(Kind):
    """True or false."""

    wanted, schema = "true or false", {"type": "boolean"}

    def read(self, value: Any, *, text: bool = False) -> bool:
        words = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}
        flag = words.get(value.lower()) if text else value
        if not isinstance(flag, bool):
            raise RefusedValue
        return flag


class NumberKind(Kind):
    """A finite number in a range; a Boolean is not a number."""

    def __init__(self, allowed: Range, unit: str, *, whole: bool) -> None:
        self.allowed, self.whole, self.unit = allowed, whole, unit
        self.wanted = number_wanted(allowed, whole=whole)
        self.limits = " ".join(filter(None, (str(allowed), unit)))
        self.metavar = "INT" if whole else "NUMBER"
        self.schema = {"type": "integer" if whole else "number", **allowed.schema}

    def read(self, value: Any, *, text: bool = False) -> float:
        made, abstract = (int, Integral) if self.whole else (float, Real)
        if not text and (isinstance(value, bool) or not isinstance(value, abstract)):
            raise RefusedValue
        untyped: Any = value
        try:
            number = made(untyped)
        except (OverflowError, ValueError):
            raise RefusedValue from None
        if number not in self.allowed:
            raise RefusedValue(wanted=number_wanted(self.allowed, number, whole=self.whole))
        return number


class ChoiceKind(Kind):
    """One of several words."""

    def __init__(self, choices: tuple[str, ...]) -> None:
        self.choices, self.wanted, self.schema = choices, one_of(choices), {"enum": list(choices)}

    def read(self, value: Any, *, text: bool = False) -> str:  # noqa: ARG002
        if not isinstance(value, str) or value not in self.choices:
            raise RefusedValue(hint=meant(value, self.choices))
        return str(value)


class ListKind(Kind):
    """A tuple of any length; a list in JSON."""

    def __init__(self, item: Kind, *, repeated: bool, may_be_empty: bool = True) -> None:
        self.item, self.may_be_empty, self.repeated = item, may_be_empty, repeated
        entries = "" if may_be_empty else " of one or more entries"
        self.wanted = f"a list{entries}, each {item.wanted}"
        limits = item.limits or ", ".join(item.choices)
        self.limits = f"each {limits}" if limits else ""
        self.metavar = item.metavar if repeated else "TEXT"
        self.schema = {"type": "array", "items": item.schema, "minItems": int(not may_be_empty)}

    def read(self, value: Any, *, text: bool = False) -> tuple[Any, ...]:
        parts: Sequence[Any] = [value] if text and self.repeated else _parts(value, text)
        if text:
            parts = [part for part in parts if part]
        if not parts and not self.may_be_empty:
            raise RefusedValue
        return _entries(parts, repeat(self.item), text)

    def plain(self, value: Any) -> list[Any]:
        return [self.item.plain(part) for part in value]


class TupleKind(Kind):
    """A tuple of a fixed length; a list in JSON."""

    def __init__(self, items: tuple[Kind, ...], unit: str) -> None:
        self.items, self.unit, limits = items, unit, items[0].limits
        self.wanted = f"{len(items)} values, each {items[0].wanted}"
        self.limits = " ".join(filter(None, (f"each {limits}" if limits else "", unit)))
        schema = {"type": "array", "prefixItems": [item.schema for item in items]}
        self.schema = {**schema, "minItems": len(items), "maxItems": len(items)}

    def read(self, value: Any, *, text: bool = False) -> tuple[Any, ...]:
        parts = _parts(value, text)
        if len(parts) != len(self.items):
            raise RefusedValue
        return _entries(parts, self.items, text)

    def plain(self, value: Any) -> list[Any]:
        return [item.plain(part) for item, part in zip(self.items, value, strict=True)]


class OptionalKind(Kind):
    """A value of a kind, or None."""

    def __init__(self, inner: Kind) -> None:
        for name in ("wanted", "limits", "unit", "metavar", "choices", "repeated", "needs"):
            setattr(self, name, getattr(inner, name))
        self.inner, self.finish = inner, inner.finish
        self.schema = {"anyOf": [inner.schema, {"type": "null"}]}

    def read(self, value: Any, *, text: bool = False) -> Any:
        return None if value is None else self.inner.read(value, text=text)

    def plain(self, value: Any) -> Any:
        return None if value is None else self.inner.plain(value)


class ParsedKind(Kind):
    """Text that a function reads, or what the function returns."""

    def __init__(self, parsed: Parsed, inner: Kind) -> None:
        self.parsed, self.inner, self.plain = parsed, inner, inner.plain
        self.wanted = ", ".join(filter(None, (parsed.wanted, inner.limits)))
        self.limits = parsed.values or inner.limits
        self.unit, self.metavar, self.needs = inner.unit, parsed.metavar, parsed.needs
        text = {"type": "string", "description": parsed.wanted}
        self.schema = text if isinstance(inner, TextKind) else {"anyOf": [inner.schema, text]}

    def read(self, value: Any, *, text: bool = False) -> Any:  # noqa: ARG002
        if not isinstance(value, str):
            return self.inner.read(value)
        return value if self.needs else self.finish(value)

    def finish(self, text: str, *known: Any) -> Any:
        try:
            value = self.parsed.read(text, *known)
        except OrbiflowError as error:
            raise RefusedValue(str(error)) from error
        return self.inner.read(value)


def kind_of(annotation: Any) -> Kind:
    """Return the kind of value that an annotation asks for.

    >>> kind_of(Literal["svg", "pdf"] | None).wanted
    'svg or pdf'
    """
    marks: dict[type, Any] = {}
    if typing.get_origin(annotation) is typing.Annotated:
        annotation, *metadata = typing.get_args(annotation)
        marks = {type(entry): entry for entry in metadata}
    if OneOf in marks:
        return ChoiceKind(tuple(marks[OneOf].names))
    saved = marks.get(InMemory)
    kind = SavedKind(saved.wanted) if saved else _plain_kind(annotation, marks)
    return ParsedKind(marks[Parsed], kind) if Parsed in marks else kind


def _plain_kind(annotation: Any, marks: Mapping[type, Any]) -> Kind:
    """Return the kind that a type asks for, given what is annotated, by its class."""
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    unit, repeated = marks[Unit].name if Unit in marks else "", Repeated in marks
    if annotation in (int, float):
        return NumberKind(marks.get(Range, ANY), unit, whole=annotation is int)
    simple = {str: TextKind, Path: PathKind, bool: FlagKind}
    if annotation in simple:
        return simple[annotation]()
    if origin is Literal:
        return ChoiceKind(arguments)
    if origin is tuple and arguments[-1] is ...:
        return ListKind(kind_of(arguments[0]), repeated=repeated)
    if origin is tuple:
        return TupleKind(tuple(map(kind_of, arguments)), unit)
    if origin in (Union, types.UnionType) and len(arguments) == 2 and type(None) in arguments:
        (part,) = (part for part in arguments if part is not type(None))
        is_own = typing.get_origin(part) is typing.Annotated
        kind = kind_of(part) if is_own else _plain_kind(part, marks)
        if isinstance(kind, ListKind):  # None is for nothing
            kind = ListKind(kind.item, repeated=kind.repeated, may_be_empty=False)
        return OptionalKind(kind)
    raise TypeError(f"no setting can be annotated {annotation!r}")


def _entries(parts: Sequence[Any], kinds: Iterable[Kind], text: bool) -> tuple[Any, ...]:
    """Return what kinds take of the entries of a list; a refusal says which entry."""
    taken: list[Any] = []
    for part, kind in zip(parts, kinds, strict=False):
        try:
            taken.append(kind.read(part, text=text))
        except RefusedValue as error:
            wrong = f"must be {error.wanted or kind.wanted}, got {described(part)}"
            more = f"; {error.hint}" if error.hint else ""
            raise RefusedValue(f"entry {len(taken) + 1}: {error.reason or wrong + more}") from error
    return tuple(taken)


def _parts(value: Any, text: bool) -> Sequence[Any]:
    """Return the entries of a list, or those that a text has between commas."""
    if text:
        return [part.strip() for part in value.split(",")]
    if not isinstance(value, list | tuple):
        raise RefusedValue
    return cast(Sequence[Any], value)
