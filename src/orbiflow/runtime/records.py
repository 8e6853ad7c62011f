"""Plain data that travels as JSON: frozen dataclasses whose fields are checked by their types."""

from __future__ import annotations

import json
import math
import os
import re
import reprlib
import types
import typing
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import cache
from numbers import Integral, Real
from pathlib import Path
from typing import Any, ClassVar, Literal, Self, TypeGuard, Union, cast

from orbiflow.errors import OrbiflowError
from orbiflow.runtime import is_object


class RecordError(OrbiflowError):
    """A field that cannot be used.

    Args:
        template: the message, with the names of fields in braces: "{workers} must be at least 1".
    """

    def __init__(self, template: str) -> None:
        super().__init__(template)
        self.template = template

    def __str__(self) -> str:
        return self.named(lambda field: field)

    def named(self, name: Callable[[str], str]) -> str:
        """The message, with `name` of each field: what the command line calls it, for instance."""
        return re.sub(r"\{(\w+)\}", lambda found: name(found[1]), self.template)


class Record:
    """Base of frozen dataclasses that are checked when they are made, and go to JSON and back.

    Fields may be bool, int, float (finite), str, `Path`, `Literal`, tuples of these, a JSON object
    (`dict[str, Any]`), and any of them or None.
    """

    KIND: ClassVar[str]

    def __post_init__(self) -> None:
        for name, hint in _hints(type(self)).items():
            value = getattr(self, name)
            try:
                object.__setattr__(self, name, _checked(value, hint))
            except (TypeError, ValueError):
                raise RecordError(
                    f"{{{name}}} must be {_described(hint)}, got {reprlib.repr(value)}"
                ) from None
        self.check()
        for name in _hints(type(self)):  # last: a range has the better message
            value = getattr(self, name)
            if isinstance(value, float) and not math.isfinite(value):
                raise RecordError(f"{{{name}}} must be finite, got {value}")

    def check(self) -> None:
        """What types do not say.

        Raises:
            RecordError: for a value out of range, by its field's name.
        """

    def to_json(self) -> dict[str, Any]:
        """An object for `json.dumps`: `kind`, and each field by its name."""
        values = {name: _plain(getattr(self, name)) for name in field_names(self)}
        return {"kind": self.KIND, **values}

    @classmethod
    def of_fields(cls, document: Mapping[str, Any]) -> Self:
        """From the fields of `to_json`.

        Raises:
            RecordError: for a field that is unknown, missing or of another type, by its name.
        """
        known = _hints(cls)
        unknown = [str(name) for name in document if name not in known]
        if unknown:
            raise RecordError(
                f"unknown field {reprlib.repr(unknown[0])} of {cls.KIND}; there are "
                f"{', '.join(known)}"
            )
        try:
            return cls(**document)
        except TypeError as error:
            given = set(document)
            missing = [name for name in known if name not in given]
            raise RecordError(f"{cls.KIND} lacks a field: {', '.join(missing)}") from error


def kind_of(document: object, kinds: Mapping[str, type[Record]], what: str) -> type[Record]:
    """Which of `kinds` a JSON object is.

    Raises:
        RecordError: if it is none.
    """
    if not is_object(document):
        raise RecordError(f"a {what} is a JSON object, got {reprlib.repr(document)}")
    kind = document.get("kind")
    if not isinstance(kind, str) or kind not in kinds:
        raise RecordError(
            f"unknown kind {reprlib.repr(kind)} of {what}; there are {', '.join(kinds)}"
        )
    return kinds[kind]


def field_names(record: Any) -> tuple[str, ...]:
    """Of a record or a class of them: bases are no dataclasses, what is made of them is."""
    return tuple(field.name for field in fields(record))


@cache
def _hints(cls: type[Record]) -> dict[str, Any]:
    hints = typing.get_type_hints(cls)
    return {name: hints[name] for name in field_names(cls)}


def _alternatives(hint: Any) -> tuple[Any, ...]:
    is_union = typing.get_origin(hint) in (Union, types.UnionType)
    return typing.get_args(hint) if is_union else (hint,)


def _checked(value: Any, hint: Any) -> Any:
    """`value` as plain data of the type.

    Raises:
        TypeError: if it is of another type.
        ValueError: if it is no such value.
    """
    if value is None and type(None) in _alternatives(hint):
        return None
    (hint,) = (kind for kind in _alternatives(hint) if kind is not type(None))
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is Literal:
        return arguments[arguments.index(value)]
    if origin is tuple:
        if not _is_sequence(value):
            raise TypeError
        return tuple(_checked(part, arguments[0]) for part in value)
    if origin is dict:
        return json.loads(json.dumps(value, allow_nan=False)) if is_object(value) else _no()
    return _scalar(value, hint)


def _scalar(value: Any, hint: Any) -> Any:
    if hint is Path and isinstance(value, str | os.PathLike):
        text = cast(str, os.fspath(value))
        return Path(text) if text and "\0" not in text else _no()
    if hint is str and isinstance(value, str):
        return str(value)
    if hint is bool and isinstance(value, bool):
        return value
    number = not isinstance(value, bool) and isinstance(value, Real)
    if hint is int and number and isinstance(value, Integral):
        return int(value)
    if hint is float and number:
        return float(value)
    return _no()


def _no() -> Any:
    raise TypeError


def _described(hint: Any) -> str:
    texts = {
        bool: "true or false",
        int: "a whole number",
        float: "a number",
        str: "text",
        Path: "a path",
        type(None): "nothing",
    }
    parts: list[str] = []
    for kind in _alternatives(hint):
        arguments = typing.get_args(kind)
        if typing.get_origin(kind) is Literal:
            parts.append(", ".join(map(str, arguments[:-1])) + f" or {arguments[-1]}")
        elif typing.get_origin(kind) is tuple:
            parts.append(f"a list, each entry {_described(arguments[0])}")
        else:
            parts.append(texts.get(kind, "an object of plain values"))
    return " or ".join(parts)


def _plain(value: Any) -> Any:
    if isinstance(value, Path):
        return str(value)
    return [_plain(part) for part in value] if _is_tuple(value) else value


def _is_tuple(value: object) -> TypeGuard[tuple[Any, ...]]:
    return isinstance(value, tuple)


def _is_sequence(value: object) -> TypeGuard[list[Any] | tuple[Any, ...]]:
    return isinstance(value, list | tuple)
