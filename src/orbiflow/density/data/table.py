"""Tables: columns of a file, a data frame or an array, and how one is found by its name or number."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from numbers import Real
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.density.data.frames import (
    as_numbers,
    cells_of,
    check_lengths,
    columns_of,
    has_categories,
    is_missing,
)
from orbiflow.density.data.units import number_of
from orbiflow.errors import InputFileError, OrbiflowError, SettingError, literal
from orbiflow.settings import is_a

MAX_LISTED = 6
"""Faults of a file that are listed after the first."""

MISSING = (
    "", "NA", "N/A", "<NA>", "NaN", "null", "none", "-", "--", "#N/A", "#NA", "#VALUE!", "#NULL!",
    "#DIV/0!", "#REF!", "#NAME?", "#NUM!", "?", ".", "*", "\\N", "-1.#IND", "1.#QNAN", "-nan",
)  # fmt: skip
"""What stands for a missing value in any text, whatever its case."""

_MISSING = frozenset(word.casefold() for word in MISSING)


class TableError(SettingError, InputFileError):
    """A table that cannot be read as the settings say; the message names those in braces."""


class MissingCellsError(TableError):
    """An error for cells that are empty, NaN or infinite in rows that must be complete."""


class UndeclaredError(SettingError):
    """An error for columns of which nothing says what they are.

    - `columns`: Their names.
    - `proposal`: What to give as `columns`, if it is right.
    """

    def __init__(self, template: str, columns: Sequence[str], proposal: str) -> None:
        super().__init__(template)
        self.columns = tuple(columns)
        self.proposal = proposal

    def __str__(self) -> str:
        """Return the message with what is to be declared as Python has it."""
        shown = rf"declare: (\w+) (?:'{re.escape(self.proposal)}'|{re.escape(self.proposal)})"
        return re.sub(shown, lambda m: f"declare: {m[1]}={self.proposal!r}", super().__str__())


def is_missing_word(text: str) -> bool:
    """Return whether a cell of text stands for a missing value in any table.

    >>> is_missing_word(" n/a"), is_missing_word("0")
    (True, False)
    """
    return text.strip().casefold() in _MISSING


class TextForm(NamedTuple):
    """How a table stands in a text file.

    - `lines`: The number (N,) of each row's line, from 1.
    - `header_line`: The number of the line of names, which may be a comment, None if there is none.
    """

    delimiter: str
    decimal: str
    lines: NDArray[np.int64]
    header_line: int | None


@dataclass(frozen=True, eq=False)
class DataTable:
    """Columns of a table.

    - `names`: What they are called: "column3", after its number, without a name.
    - `is_named`: Whether they have names of their own.
    - `columns`: The cells (N,) of each: numbers or words.
    - `where`: What messages begin with, such as "wind.csv: ".
    - `path`: The file that it is in, if it is in one.
    - `is_array`: Whether it is an array, whose columns are angles in radians unless declared.
    - `numeric`: Which columns are of numbers, if that is known without their cells.
    - `codes`: What stands for missing values as well, numbers or words.
    - `categories`: Which columns of a frame hold categories, which are words even if they are numbers.
    - `text`: How it stands in a text file, None of others.
    """

    names: tuple[str, ...]
    is_named: bool
    columns: Sequence[Any]
    where: str = ""
    path: Path | None = None
    is_array: bool = False
    numeric: frozenset[int] | None = None
    codes: tuple[str, ...] = ()
    categories: frozenset[int] = frozenset()
    text: TextForm | None = None
    _parsed: dict[int, Array] = field(default_factory=dict[int, Array], init=False, repr=False)

    @classmethod
    def of(cls, data: Any, names: Sequence[str] | None = None) -> DataTable:
        """Return the columns of an array (N, k), which may get names, or of a data frame.

        Raises `OrbiflowError` for data that are neither.
        """
        columns = columns_of(data, "data")
        if columns is None:
            values = as_numbers(data, "data")
            require_table(values)
            called = tuple(names or numbered(values.shape[1]))
            return cls(called, names is not None, tuple(values.T), is_array=True)
        parts = tuple(np.asarray(cells_of(cells)) for _, cells in columns)
        check_lengths(parts, "data")
        called = tuple(name for name, _ in columns)
        is_named = all(is_a(name, str) for name in called)
        called = called if is_named else tuple(numbered(len(called)))
        categories = frozenset(k for k, (_, column) in enumerate(columns) if has_categories(column))
        return cls(called, is_named, parts, categories=categories)

    @property
    def is_file(self) -> bool:
        """Whether it is in a file, which may have codes for missing values."""
        return self.path is not None

    def place(self, row: int) -> str:
        """Return where a row, from 0, is: "line 7"."""
        return f"row {row + 1}" if self.text is None else f"line {self.text.lines[row]}"

    def is_numeric(self, column: int) -> bool:
        """Return whether a column, from 0, is of numbers, but for cells that must then be corrected."""
        if self.numeric is not None:
            return column in self.numeric
        cells = self.columns[column]
        if cells.dtype.kind != "O" or self.text is None:
            return cells.dtype.kind in "fiu" or (cells.dtype.kind == "O" and _are_numbers(cells))
        there = ~self._missing(column)
        return 2 * int(np.isfinite(self._floats(column)[there]).sum()) > max(1, int(there.sum()))

    def has_numbers_as_text(self, column: int) -> bool:
        """Return whether most cells of a frame's column, from 0, are the text of a number."""
        cells = self.columns[column]
        if self.is_file or column in self.categories or cells.dtype.kind not in "OUT":
            return False
        texts = [c for c in cells.tolist() if is_a(c, str) and not is_missing_word(c)]
        return 2 * sum(math.isfinite(number_of(text)) for text in texts) > max(len(texts), 1)

    def _floats(self, column: int) -> Array:
        """Return a column of words of text (N,) as numbers, NaN where they are none."""
        if column not in self._parsed and self.text is not None:
            mark = self.text.decimal
            self._parsed[column] = np.array([number_of(c, mark) for c in self.columns[column]])
        return self._parsed[column]

    def _missing(self, column: int) -> NDArray[np.bool_]:
        return np.array([is_missing_word(cell) for cell in self.columns[column]], dtype=bool)

    def numbers(self, column: int) -> Array:
        """Return a column (N,) as numbers, NaN where they are missing; refuse what holds no numbers."""
        cells = self.columns[column]
        if self.text is not None and cells.dtype.kind == "O":
            self._refuse_words(column)
            return self._floats(column)
        try:
            values = as_numbers(cells, f"{self.where or 'data: '}column {self.names[column]!r}")
        except OrbiflowError as error:
            if not self.is_file:
                raise
            cure = "; correct it, or choose another with {columns}"
            raise TableError(literal(str(error)) + cure) from error
        codes = [number_of(code) for code in self.codes]
        return np.where(np.isin(values, codes), np.nan, values) if codes else values

    def _refuse_words(self, column: int) -> None:
        """Refuse cells of a text that are no numbers."""
        assert self.text is not None
        bad = np.flatnonzero(np.isnan(self._floats(column)) & ~self._missing(column)).tolist()
        if not bad:
            return
        cells = {row: str(self.columns[column][row]).strip() for row in bad}
        faults = [
            f"{self.place(row)}: column {self.names[column]!r}: {short(cell)!r}"
            for row, cell in cells.items()
        ]
        mark, cell = self.text.decimal, cells[bad[0]]
        words = sorted(set(cells.values()))[:MAX_LISTED]
        codes = ",".join(words) if all(map(str.isalpha, words)) else "VALUE"
        cure = (
            "write numbers alone, in degrees negative to the south and west; if that stands for a "
        )
        cure += f"missing value, give {{missing_codes}} {literal(codes)} {{drop_missing}}"
        if is_clock(cell):
            cure = HOURS
        elif mark == "." and re.fullmatch(r"[+-]?\d*,\d+", cell):
            cure = "write decimal points, or specify {decimal} , if commas stand before decimals"
        elif mark == "," and re.fullmatch(r"[+-]?\d*\.\d+", cell):
            cure = "write decimal commas, or leave {decimal} out if points stand before decimals"
        also = and_others(faults[1:])
        raise TableError(literal(f"{self.where}{faults[0]} is not a number{also}; ") + cure)

    def cells(self, column: int) -> NDArray[Any]:
        """Return the cells (N,) of a column as they are: numbers or words."""
        return self.columns[column]


HOURS = "write hours with decimals, such as 18.5 for 18:30, and declare cycle:24"
"""What to do about times of day."""


def is_clock(cell: str) -> bool:
    """Return whether a cell is a time of day, such as 18:30."""
    return re.fullmatch(r"\d{1,2}:\d\d(:\d\d(\.\d+)?)?", cell) is not None


def _are_numbers(cells: NDArray[Any]) -> bool:
    there = [cell for cell in cells if not is_missing(cell)]
    return bool(there) and all(is_a(c, Real) and not is_a(c, bool) for c in there)


def numbered(count: int) -> list[str]:
    """Return what columns without names are called."""
    return [f"column{k}" for k in range(1, count + 1)]


def require_table(data: Array) -> None:
    """Refuse data that are no rows and columns."""
    if data.ndim != 2:
        cure = "; of one row write [[...]], of one column data.reshape(-1, 1) (NumPy)"
        cure = cure if data.ndim == 1 else ""
        raise OrbiflowError(f"expected data of shape (N, k), got {data.shape}{cure}")


def found_column(table: DataTable, key: str | int) -> int:
    """Return the number, from 0, of a column by its name, as text by its number from 1, or by number.

    Raises:
        SettingError: If there is none, or there are several.
    """
    names, count = table.names, len(table.names)
    if not isinstance(key, str):
        if -count <= key < count:
            return key % count
        raise SettingError(f"no column {key}: there are {count}, numbered from 0")
    hits = [k for k, name in enumerate(names) if name == key]
    hits = hits or [k for k, name in enumerate(names) if name.casefold() == key.casefold()]
    if len(hits) == 1:
        return hits[0]
    if hits:
        numbers = " and ".join(str(k + 1) for k in hits[:8])
        raise SettingError(
            literal(
                f"{table.where}columns {numbers} are all called {key!r}; rename them, or choose "
            )
            + f"by number with {{columns}} {hits[0] + 1}"
        )
    if re.fullmatch(r"\d{1,8}", key, re.ASCII) and 1 <= int(key) <= count:
        return int(key) - 1
    raise SettingError(
        literal(f"no column {key!r}; it has {listing(names)}: ")
        + f"choose by name, or by number from 1 to {count}"
    )


def listing(names: Sequence[str]) -> str:
    """Return names for a message: the first twenty, and how many more there are."""
    shown = ", ".join(short(name) for name in names[:20])
    return shown if len(names) <= 20 else f"{shown} and {len(names) - 20} more"


def short(text: str) -> str:
    """Return text for a message: at most 40 characters, on one line."""
    text = text.strip()
    text = text if len(text) <= 40 else text[:37] + "..."
    return "".join(
        letter if letter.isprintable() else "\N{REPLACEMENT CHARACTER}" for letter in text
    )


def and_others(faults: Sequence[str]) -> str:
    """Return what a message of the first fault of a file says of the others, in brackets.

    >>> and_others(["line 4 has 2 cells"]), and_others([])
    (' (also, line 4 has 2 cells)', '')
    """
    listed = ", ".join(faults[:MAX_LISTED])
    more = f", and {len(faults) - MAX_LISTED} more" * (len(faults) > MAX_LISTED)
    return f" (also, {listed}{more})" if faults else ""
