"""Columns of a table, whoever holds them, and how one is found by its name or number."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, Protocol

from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.errors import SettingError, literal


class Source(Protocol):
    """Columns of a table, whoever holds them."""

    @property
    def names(self) -> tuple[str, ...]:
        """What they are called: "column3", after its number, without a name."""
        ...

    @property
    def is_named(self) -> bool:
        """Whether they have names of their own."""
        ...

    @property
    def is_array(self) -> bool:
        """Whether it is an array, whose angles are radians, and no table."""
        ...

    @property
    def where(self) -> str:
        """What messages begin with, such as "wind.csv: "."""
        ...

    def is_numeric(self, column: int) -> bool:
        """Return whether a column, by its number from 0, is of numbers."""
        ...

    def numbers(self, column: int) -> Array:
        """Return a column (N,) as numbers, NaN where they are missing; refuse others."""
        ...

    def cells(self, column: int) -> NDArray[Any]:
        """Return the cells (N,) of a column as they are: numbers or words."""
        ...

    def place(self, row: int) -> str:
        """Return where a row, from 0, is: "line 7"."""
        ...


class UndeclaredError(SettingError):
    """An error for columns of which nothing says what they are.

    - `columns`: Their names.
    - `proposal`: What to give as `columns`, if it is right.
    """

    def __init__(self, template: str, columns: Sequence[str], proposal: str) -> None:
        super().__init__(template)
        self.columns = tuple(columns)
        self.proposal = proposal


def found_column(source: Source, key: str | int) -> int:
    """Return the number, from 0, of a column by its name, as text by its number from 1, or by number.

    Raises:
        SettingError: If there is none, or there are several.
    """
    names, count = source.names, len(source.names)
    if not isinstance(key, str):
        if -count <= key < count:
            return key % count
        raise SettingError(
            literal(source.where) + f"no column {key}: there are {count}, numbered from 0"
        )
    hits = [k for k, name in enumerate(names) if name == key]
    hits = hits or [k for k, name in enumerate(names) if name.casefold() == key.casefold()]
    if len(hits) == 1:
        return hits[0]
    if hits:
        numbers = " and ".join(str(k + 1) for k in hits[:8])
        raise SettingError(
            literal(f"{source.where}columns {numbers} are all called {key!r}")
            + f"; rename them, or choose by number with {{columns}} {hits[0] + 1}"
        )
    if re.fullmatch(r"\d{1,8}", key, re.ASCII) and 1 <= int(key) <= count:
        return int(key) - 1
    raise SettingError(
        literal(f"{source.where}no column {key!r}; it has {listing(names)}")
        + f": choose by name, or by number from 1 to {count}"
    )


def listing(names: Sequence[str]) -> str:
    """Return names for a message: the first twenty, and how many more there are."""
    shown = ", ".join(short(name) for name in names[:20])
    return shown if len(names) <= 20 else f"{shown} and {len(names) - 20} more"


def short(text: str) -> str:
    """Return text for a message: at most 40 characters, on one line."""
    text = text.strip()
    return ascii(text if len(text) <= 40 else text[:37] + "...")[1:-1]


def is_number_name(name: str) -> bool:
    """Return whether a column is called after its number, as one without a name is.

    >>> is_number_name("column3"), is_number_name("phi")
    (True, False)
    """
    return re.fullmatch(r"(column|angle)\d+", name) is not None
