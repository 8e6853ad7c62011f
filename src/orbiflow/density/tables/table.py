"""A table of numbers, the choice of its columns, and the check of its rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbiflow.density.tables.cells import Mark
from orbiflow.errors import InputFileError, SettingError, literal

MAX_COLUMNS = 10_000
BLOCK = 65_536
"""Rows read at a time."""


@dataclass(frozen=True)
class Reading:
    """What is read of a table: see `orbiflow.density.tables.read_table`."""

    columns: Sequence[str] | None
    width: int | None
    max_rows: int = 20_000_000
    has_header: bool | None = None
    drop_missing: bool = False
    keep_missing: bool = False
    missing_codes: Sequence[float] = ()
    decimal: Mark | None = None


@dataclass(frozen=True, eq=False)
class Table:
    """The chosen columns of a file.

    - `values`: Numbers (N, k), float64, all finite; NaN for missing values, if they were asked for.
    - `columns`: Names of the k columns; one without a name is called "column3", after its number.
    - `lines`: Number (N,) of each row's line, from 1 (of the row, in npy and Parquet).
    - `notes`: What was decided for the user, in plain words.
    - `header`: Names of all columns in a text file's header line, None if there is none.
    - `delimiter`: Delimiter of a text file, " " for runs of whitespace; None for npy and Parquet.
    - `header_line`: The number of that line, which may be a comment.
    - `units`: Units that the cells of a text file write, by the columns' names.
    - `decimal`: Mark before the decimals of a text file, "." or ",".
    - `dropped`: Numbers of the lines that were left out because a value was missing.
    """

    values: NDArray[np.float64]
    columns: tuple[str, ...]
    lines: NDArray[np.int64]
    notes: tuple[str, ...] = ()
    header: tuple[str, ...] | None = None
    delimiter: str | None = None
    decimal: str = "."
    header_line: int | None = None
    units: Mapping[str, str] = field(default_factory=dict[str, str])
    dropped: frozenset[int] = frozenset()

    @property
    def unit(self) -> str | None:
        """The unit that cells of the columns write, None if they write none.

        Raises:
            TableError: If there are several.
        """
        own = {name: self.units[name] for name in self.columns if name in self.units}
        if len(set(own.values())) > 1:
            listed = ", ".join(f"{name} in {unit}" for name, unit in own.items())
            raise TableError(literal(f"the cells are in different units ({listed}): convert them"))
        return next(iter(own.values()), None)

    def only(self, kept: NDArray[np.bool_]) -> Table:
        """Return the rows that are kept, (N,) of bool; the others are dropped."""
        dropped = self.dropped | frozenset(self.lines[~kept].tolist())
        return replace(self, values=self.values[kept], lines=self.lines[kept], dropped=dropped)

    def complete(self, path: Path, **missing: Any) -> Table:
        """Return the table as `read_table` does, once it is known which columns are wanted.

        `missing` says what is done with missing values, as there.
        """
        return finished(path, self, Reading(None, len(self.columns), **missing))

    def without(self, column: int) -> Table:
        """Return the table without a column, by its number from 0."""
        names = self.columns[:column] + self.columns[column + 1 :]
        return replace(self, values=np.delete(self.values, column, axis=1), columns=names)

    def in_order(self, names: Sequence[str]) -> Table:
        """Return the table with its columns in another order, by their names."""
        order = [self.columns.index(name) for name in names]
        return replace(self, values=self.values[:, order], columns=tuple(names))


class TableError(SettingError, InputFileError):
    """A table that cannot be read as the settings say; the message names those in braces."""


class MissingCellsError(TableError):
    """An error for cells that are empty, NaN or infinite in rows that must be complete."""


def choose(
    path: Path,
    names: Sequence[str],
    numeric: Sequence[bool],
    reading: Reading,
    kinds: Sequence[object] | None = None,
) -> tuple[list[int], list[str]]:
    """Return the numbers, from 0, of the columns that are read, and notes.

    Where the file says of what kind each column is, others than numbers are refused.
    """
    columns, width = reading.columns, reading.width
    if columns is not None:
        picked = [find(path, names, wanted) for wanted in columns]
        if len(set(picked)) < len(picked):
            raise TableError(
                literal(f"{path}: ") + "{columns} names a column twice; name each once"
            )
    else:
        # if there are just `width` columns all are meant, and a bad cell is named rather than ignored
        picked = [i for i, ok in enumerate(numeric) if ok or len(names) == width]
    if not picked or (width is not None and len(picked) != width):
        got = f"{{columns}} names {len(picked)}" if columns is not None else f"it has {len(picked)}"
        count = "" if width is None else f"{width} "
        raise TableError(
            literal(f"{path}: ")
            + f"{count}column{'s' * (width != 1)} of numbers must be taken and {got} (its columns: "
            + literal(f"{listing(names)})")
            + "; choose with {columns}"
        )
    for i in picked:
        if kinds is not None and not numeric[i]:
            raise TableError(
                literal(f"{path}: column {quote(names[i])} holds {quote(str(kinds[i]))}")
                + ", not numbers; choose another with {columns}"
            )
    taken = [names[i] for i in picked]
    if columns is not None or [find(path, names, name) for name in taken] == list(
        range(len(names))
    ):
        return picked, []
    return picked, [f"took the columns of numbers: {listing(taken)}"]


def find(path: Path, names: Sequence[str], wanted: str) -> int:
    """Return the number, from 0, of the column with this name or, counted from 1, number."""
    key = wanted.strip()
    hits = [i for i, name in enumerate(names) if name == key]
    hits = hits or [i for i, name in enumerate(names) if name.casefold() == key.casefold()]
    if len(hits) == 1:
        return hits[0]
    if hits:
        numbers = " and ".join(str(i + 1) for i in hits[:8])
        raise TableError(
            literal(f"{path}: columns {numbers} are all called {quote(key)}")
            + f"; rename them, or choose by number with {{columns}} {hits[0] + 1}"
        )
    if is_number(key, len(names)):
        return int(key) - 1
    raise InputFileError(
        f"{path}: no column {quote(wanted)}; it has {listing(names)}: choose by name, or by number "
        f"from 1 to {len(names)}"
    )


def is_number(text: str, n: int) -> bool:
    """Return whether `text` is a column's number, from 1."""
    return text.isascii() and text.isdigit() and len(text) < 9 and 1 <= int(text) <= n


def check_count(path: Path, n: int, most: int, what: str) -> None:
    """Check that there are not too many rows or columns."""
    if n > most:
        raise InputFileError(
            f"{path}: more than {most} {what}, the most that is read; save a part of the table"
        )


def finished(path: Path, table: Table, reading: Reading) -> Table:
    """Return a table, in which missing values are NaN, without the rows to leave out."""
    unit = "row" if table.delimiter is None else "line"
    values, lines, dropped = table.values, table.lines, table.dropped
    if reading.missing_codes:
        values = np.where(np.isin(values, list(reading.missing_codes)), np.nan, values)
    values, columns, left_out = _with_values(path, values, table.columns, reading)
    notes = [*table.notes, *left_out]
    if reading.drop_missing and len(values):
        whole = ~np.isnan(values).any(axis=1)
        if not whole.any():
            raise TableError(
                literal(f"{path}: ") + "every row lacks a value; choose others with {columns}"
            )
        left = lines[~whole].tolist()
        if left:
            rows = f"{len(left)} row{'s' * (len(left) > 1)}"
            notes.append(f"left out {rows} with missing values, the first in {unit} {left[0]}")
        values, lines, dropped = values[whole], lines[whole], dropped | frozenset(left)
    if not len(values):
        raise InputFileError(f"{path}: holds no rows of numbers; export it again")
    wrong = np.isinf(values) if reading.keep_missing else ~np.isfinite(values)
    rows_wrong, at = np.nonzero(wrong)
    if len(rows_wrong):
        raise MissingCellsError(
            literal(
                f"{path}: {len(rows_wrong)} cell{'s' * (len(rows_wrong) > 1)} empty, NaN or infinite, "
                f"the first in {unit} {lines[rows_wrong[0]]}, column {quote(columns[int(at[0])])}"
            )
            + "; fill them in or leave their rows out with {drop_missing}"
        )
    own: dict[str, Any] = {"values": values, "columns": columns, "lines": lines}
    return replace(table, **own, notes=tuple(notes), dropped=dropped)


def _with_values(
    path: Path, values: NDArray[np.float64], columns: tuple[str, ...], reading: Reading
) -> tuple[NDArray[np.float64], tuple[str, ...], list[str]]:
    """Return the columns that have a value in some row, and notes; refuse others that are wanted."""
    bare = np.isnan(values).all(axis=0)
    if not len(values) or not bare.any():
        return values, columns, []
    empty = [columns[k] for k in np.flatnonzero(bare)]
    several = len(empty) > 1
    fault = f"{listing(empty)} {'have' if several else 'has'} no value in any row"
    if reading.columns is None and reading.width is None and not bare.all():
        kept = tuple(columns[k] for k in np.flatnonzero(~bare))
        return values[:, ~bare], kept, [f"left out the column{'s' * several}: {fault}"]
    raise MissingCellsError(
        literal(f"{path}: column{'s' * several} {fault}") + "; choose others with {columns}"
    )


def listing(names: Sequence[str]) -> str:
    """Return names for a message: the first twenty, and how many more there are."""
    shown = ", ".join(quote(name)[1:-1] for name in names[:20])
    return shown if len(names) <= 20 else f"{shown} and {len(names) - 20} more"


def quote(text: str) -> str:
    """Return text for a message: at most 40 characters, on one line."""
    text = text.strip()
    return ascii(text if len(text) <= 40 else text[:37] + "...")
