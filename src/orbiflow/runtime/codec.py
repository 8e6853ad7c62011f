"""Dataclasses as JSON and back, by their own fields."""

from __future__ import annotations

import math
import types
import typing
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from typing import Any, Literal, cast

from orbiflow.errors import SettingError, literal
from orbiflow.settings import described, is_a


def to_json(value: Any) -> Any:
    """Return a value as JSON has it, a dataclass as its fields by name.

    A class that has a `kind` shows it, and its properties. Fields that a `repr` leaves out are left
    out, and infinite numbers are null.

    >>> from orbiflow.runtime import Note
    >>> to_json({"notes": (Note("dark on light"),), "most": math.inf})
    {'notes': [{'kind': 'note', 'text': 'dark on light', 'warning': False}], 'most': None}
    """
    if is_dataclass(value):
        names = [entry.name for entry in fields(cast(Any, value)) if entry.repr]
        if getattr(type(value), "kind", ""):
            bases = reversed(type(value).__mro__)
            members = {name: member for base in bases for name, member in vars(base).items()}
            names += [name for name, member in members.items() if isinstance(member, property)]
            names = ["kind", *names]
        return {name: to_json(getattr(value, name)) for name in names}
    if is_a(value, Mapping):
        return {str(name): to_json(entry) for name, entry in value.items()}
    if is_a(value, list) or is_a(value, tuple):
        return [to_json(entry) for entry in value]
    if hasattr(value, "tolist"):
        return to_json(value.tolist())
    if is_a(value, float) and not math.isfinite(value):
        return None
    return str(value) if is_a(value, Path) else value


def from_json(hint: Any, value: Any, place: str = "the document") -> Any:
    """Return the value of a type that `to_json` wrote; null is None, or a number that is infinite.

    A type is a dataclass, a named tuple, a tuple, a mapping of text, a union with None, a `Literal`,
    a path, text, a number or a truth value.

    Raises:
        SettingError: For a value of another type, and an entry that is missing or unknown.

    >>> from_json(tuple[int, ...], [1, 2])
    (1, 2)
    """
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    entries = getattr(hint, "_fields", ())
    if is_dataclass(cast(object, hint)) and is_a(value, dict):
        entry_hints = typing.get_type_hints(hint)
        declared = {entry.name: entry for entry in fields(hint)}
        needed = {
            name
            for name, entry in declared.items()
            if entry.default is MISSING and entry.default_factory is MISSING
        }
        wrong = sorted(set(value) - set(declared)) or sorted(needed - set(value))
        if wrong:
            which = "unknown" if wrong[0] in value else "missing"
            raise SettingError(literal(f"{place}: {which} entry {wrong[0]!r}"))
        return hint(
            **{
                name: from_json(entry_hints[name], value[name], f"{place}: {name}")
                for name in value
            }
        )
    if entries and is_a(value, list) and len(value) == len(entries):
        entry_hints = typing.get_type_hints(hint)
        return hint(
            *(from_json(entry_hints[n], v, place) for n, v in zip(entries, value, strict=True))
        )
    if origin in (typing.Union, types.UnionType):
        rest = [part for part in parts if part is not type(None)]
        return None if value is None else from_json(rest[0], value, place)
    if origin is tuple and is_a(value, list):
        each = [parts[0]] * len(value) if parts[1:] == (...,) else parts
        if len(each) == len(value):
            return tuple(from_json(h, v, place) for h, v in zip(each, value, strict=True))
    if origin is dict and is_a(value, dict):
        return {str(name): from_json(parts[1], entry, place) for name, entry in value.items()}
    if hint is Any or (origin is Literal and value in parts):
        return value
    if hint is float and value is None:
        return math.inf
    if hint is float and type(value) in (int, float) and not math.isnan(value):
        return float(value)
    if hint is Path and is_a(value, str):
        return Path(value)
    if hint in (int, str, bool) and type(value) is hint:
        return value
    name = getattr(hint, "__name__", str(hint))
    raise SettingError(literal(f"{place} must be of the type {name}, got {described(value)}"))
