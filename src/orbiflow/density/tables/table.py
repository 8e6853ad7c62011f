"""A table of numbers, the choice of its columns, and what is said of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orbiflow.errors import InputFileError, SettingError, literal

MAX_COLUMNS = 10_000
BLOCK = 65_536  # rows


@dataclass(frozen=True, eq=False)
class Table:
    """The chosen columns of a file.

    - `values`: (N, k) float64, all finite; NaN where a value is missing, if that was asked for.
    - `columns`: k names; a column without one is called "column3", after its 1-based number.
    - `lines`: (N,) int64, 1-based number of each row's line (of the row, in npy and Parquet).
    - `notes`: what was decided for the user, in plain words.
    - `header`: names of all columns in a text file's header line, None where there is none.
    - `delimiter`: of a text file, " " for runs of whitespace; None for npy and Parquet.
    - `decimal`: the mark before the decimals of a text file, "." or ",".
    - `dropped`: numbers of the lines that were left out because a value was missing.
    """

    values: NDArray[np.float64]
    columns: tuple[str, ...]
    lines: NDArray[np.int64]
    notes: tuple[str, ...]
    header: tuple[str, ...] | None
    delimiter: str | None
    decimal: str = "."
    dropped: frozenset[int] = frozenset()

    def without(self, column: int) -> Table:
        """The table less a column, by its 0-based number."""
        names = self.columns[:column] + self.columns[column + 1 :]
        return replace(self, values=np.delete(self.values, column, axis=1), columns=names)


class TableError(SettingError, InputFileError):
    """A table that cannot be read as the settings say; the message names those in braces."""


class MissingCellsError(TableError):
    """Cells that are empty, NaN or infinite in rows that must not lack any."""


def choose(
    path: Path,
    names: Sequence[str],
    numeric: Sequence[bool],
    columns: Sequence[str] | None,
    width: int | None,
) -> tuple[list[int], list[str]]:
    """0-based numbers of the columns wanted, and notes."""
    if columns is not None:
        picked = [find(path, names, wanted) for wanted in columns]
        if len(set(picked)) < len(picked):
            raise TableError(
                literal(f"{path}: ") + "{columns} names a column twice; name each once"
            )
    else:
        # Of just `width` columns all are meant, so that a bad cell is named rather than passed by.
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
    if columns is not None:
        return picked, []
    taken = [names[i] for i in picked]
    for name in taken:
        find(path, names, name)
    all_of_them = len(taken) == len(names)
    return picked, [] if all_of_them else [f"took the columns of numbers: {listing(taken)}"]


def find(path: Path, names: Sequence[str], wanted: str) -> int:
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
    number = column_number(key, len(names))
    if number is None:
        raise InputFileError(
            f"{path}: no column {quote(wanted)}; it has {listing(names)}: choose by name, or by "
            f"number from 1 to {len(names)}"
        )
    return number


def column_number(text: str, n: int) -> int | None:
    """0-based number of the column that `text` counts from 1, None where there is none such."""
    if not (text.isascii() and text.isdigit() and len(text) < 9 and 1 <= int(text) <= n):
        return None
    return int(text) - 1


def check_count(path: Path, n: int, most: int, what: str) -> None:
    if n > most:
        raise InputFileError(
            f"{path}: more than {most} {what}, the most that is read; save a part of the table"
        )


def check_finite(
    path: Path,
    values: NDArray[np.float64],
    lines: NDArray[np.int64],
    columns: Sequence[str],
    unit: str,
    missing: bool = False,
) -> None:
    """
    Raises:
        InputFileError: for no rows, and for cells that are empty, NaN or infinite; with `missing`
            the first two may be.
    """
    if not len(values):
        raise InputFileError(f"{path}: holds no rows of numbers; export it again")
    rows, at = np.nonzero(np.isinf(values) if missing else ~np.isfinite(values))
    if len(rows):
        raise MissingCellsError(
            literal(
                f"{path}: {len(rows)} cell{'s' * (len(rows) > 1)} empty, NaN or infinite, the first "
                f"in {unit} {lines[rows[0]]}, column {quote(columns[int(at[0])])}"
            )
            + "; fill them in or leave their rows out with {drop_missing}"
        )


def without_missing(
    path: Path, values: NDArray[np.float64], lines: NDArray[np.int64], unit: str
) -> tuple[NDArray[np.float64], NDArray[np.int64], frozenset[int], list[str]]:
    """Rows and lines without a missing value, the lines left out, and a note of them."""
    whole = ~np.isnan(values).any(axis=1)
    if not whole.any():
        raise TableError(
            literal(f"{path}: ") + "every row lacks a value; choose others with {columns}"
        )
    left = lines[~whole].tolist()
    first = f", the first in {unit} {left[0]}" if left else ""
    rows = f"{len(left)} row{'s' * (len(left) > 1)}"
    notes = [f"left out {rows} with missing values{first}"] if left else []
    return values[whole], lines[whole], frozenset(left), notes


def listing(names: Sequence[str]) -> str:
    shown = ", ".join(quote(name)[1:-1] for name in names[:20])
    return shown if len(names) <= 20 else f"{shown} and {len(names) - 20} more"


def quote(text: str) -> str:
    """`text` for a message: at most 40 characters, and on one line."""
    text = text.strip()
    return ascii(text if len(text) <= 40 else text[:37] + "...")
