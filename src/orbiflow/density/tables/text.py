"""Tables in text files: their rows and names; pandas reads the cells."""

from __future__ import annotations

import importlib
import io
import re
from array import array
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.density.data import TableError, short
from orbiflow.density.tables.headers import delimiter_of, header_among, is_header, lacks_first_name
from orbiflow.density.tables.lines import (
    MISSING,
    SEPARATOR,
    is_missing_word,
    number_of,
    split_line,
    text_lines,
    with_minus,
)
from orbiflow.errors import InputFileError, literal

MAX_ROWS, MAX_COLUMNS = 20_000_000, 10_000

SAMPLE = 100
"""Rows looked at to find the mark between cells."""

MAX_LISTED = 6
"""Faults of a file that are listed after the first."""


@dataclass(frozen=True, eq=False)
class TextTable:
    """The columns of a text file: a `Source`.

    - `lines`: The number (N,) of each row's line, from 1.
    - `columns`: The cells (N,) of each column: numbers where all are, or else words.
    - `header_line`: The number of the line of names, which may be a comment, None if there is none.
    """

    path: Path
    names: tuple[str, ...]
    is_named: bool
    lines: NDArray[np.int64]
    columns: tuple[NDArray[Any], ...]
    delimiter: str
    decimal: str
    header_line: int | None

    is_array: bool = False
    _floats: dict[int, Array] = field(default_factory=dict[int, Array], init=False, repr=False)

    @property
    def where(self) -> str:
        """What messages begin with."""
        return f"{self.path}: "

    def place(self, row: int) -> str:
        """Return the line of a row."""
        return f"line {self.lines[row]}"

    def is_numeric(self, column: int) -> bool:
        """Return whether a column is of numbers, but for cells that must then be corrected."""
        cells = self.columns[column]
        if cells.dtype.kind == "f":
            return True
        known = ~self._missing(column)
        return 2 * int(np.isfinite(self._parsed(column)[known]).sum()) > max(1, int(known.sum()))

    def _parsed(self, column: int) -> Array:
        """Return a column of words (N,) as numbers, NaN where they are none."""
        if column not in self._floats:
            cells = self.columns[column]
            self._floats[column] = np.array([number_of(cell, self.decimal) for cell in cells])
        return self._floats[column]

    def _missing(self, column: int) -> NDArray[np.bool_]:
        return np.array([is_missing_word(str(cell)) for cell in self.columns[column]], dtype=bool)

    def numbers(self, column: int) -> Array:
        """Return a column (N,), NaN where cells are missing; refuse cells that are no numbers."""
        cells = self.columns[column]
        if cells.dtype.kind == "f":
            return cells
        found = self._parsed(column)
        bad = np.flatnonzero(np.isnan(found) & ~self._missing(column))
        if not len(bad):
            return found
        of = f"column {self.names[column]!r}"
        faults = [f"{self.place(row)}: {of}: {short(str(cells[row]))!r}" for row in bad.tolist()]
        raise TableError(
            literal(f"{self.path}: {faults[0]} is not a number{and_others(faults[1:])}; ")
            + _cure([str(cells[row]) for row in bad.tolist()], self.decimal)
        )

    def cells(self, column: int) -> NDArray[Any]:
        """Return the cells (N,) of a column, numbers as numbers."""
        return self.columns[column]


def _cure(cells: Sequence[str], decimal: str) -> str:
    """Return what to do with cells that are no numbers."""
    if decimal == "." and re.fullmatch(r"[+-]?\d*,\d+", cells[0].strip()):
        return "write decimal points, or specify {decimal} , if commas stand before decimals"
    if decimal == "," and re.fullmatch(r"[+-]?\d*\.\d+", cells[0].strip()):
        return "write decimal commas, or leave {decimal} out if points stand before decimals"
    words = sorted({cell.strip() for cell in cells})[:MAX_LISTED]
    listed = ",".join(words) if all(map(str.isalpha, words)) else "VALUE"
    return (
        "write numbers alone, in degrees negative to the south and west; if that stands for a missing "
        f"value, give {{missing_codes}} {literal(listed)} {{drop_missing}}"
    )


def and_others(faults: Sequence[str]) -> str:
    """Return what a message of the first fault of a file says of the others, in brackets.

    >>> and_others(["line 4 has 2 cells"]), and_others([])
    (' (also, line 4 has 2 cells)', '')
    """
    listed = ", ".join(faults[:MAX_LISTED])
    more = f", and {len(faults) - MAX_LISTED} more" * (len(faults) > MAX_LISTED)
    return f" (also, {listed}{more})" if faults else ""


def read_text(
    path: Path,
    *,
    has_header: bool | None = None,
    decimal: str | None = None,
    codes: Sequence[str] = (),
    wanted: Sequence[str] = (),
) -> TextTable:
    """Read a text file.

    Cells are separated by tabs, semicolons, bars, commas or whitespace. Blank lines and lines that
    begin with # are skipped. The first other line is a header if a cell in it is neither a number nor
    missing, or else the last comment above it that has a name for each column.

    Args:
        path: The file.
        has_header: Whether the first line names the columns, None to look.
        decimal: The mark before decimals, a point if it is not said.
        codes: What stands for a missing value as well, numbers or words.
        wanted: Names of columns, which help to tell a header from a row.

    Raises:
        InputFileError: For a file that cannot be read, and lines of different numbers of cells.
    """
    mark = decimal or "."
    comments: list[tuple[int, str]] = []
    head: list[tuple[int, str]] = []
    delimiter, source = None, text_lines(path)
    for number, line, is_comment in source:
        if not is_comment:
            head.append((number, with_minus(line)))
            if len(head) == SAMPLE:
                break
            continue
        said = SEPARATOR.fullmatch(line.strip()) if number == 1 else None
        delimiter = said[1] if said else delimiter
        comments += [] if head else [(number, line)]
    if not head:
        raise InputFileError(f"{path}: only comments and blank lines; export it again")
    if delimiter is not None and (delimiter == mark or not delimiter.isascii()):
        raise InputFileError(
            f"{path}: line 1 says that {delimiter!r} separates cells, which it cannot where decimals "
            f"stand after {mark!r}; save the file with semicolons"
        )
    delimiter = delimiter or delimiter_of([line for _, line in head], mark)
    first = head[0][0]
    top, *sample = [split_line(path, number, line, delimiter) for number, line in head]
    if has_header is not False and lacks_first_name(top, sample, delimiter):
        top = ["", *top]
    width = len(top)
    if width > MAX_COLUMNS:
        raise InputFileError(
            f"{path}: more than {MAX_COLUMNS} columns, the most that is read; save a part of the table"
        )
    header, header_line = None, None
    if has_header is None:
        has_header = is_header(path, first, top, sample, wanted, codes)
        if not has_header:
            header, header_line = header_among(comments, width, delimiter)
    if has_header:
        header, header_line = tuple(cell.strip().strip('"').strip() for cell in top), first
        if len(head) == 1:
            raise InputFileError(f"{path}: line {first} is a header and no row follows; add rows")
    rest = ((number, with_minus(line)) for number, line, is_comment in source if not is_comment)
    rows = islice(chain(head, rest), int(has_header), None)
    at, text = _rows_as_text(path, rows, first, width, delimiter)
    names = tuple(name or f"column{k}" for k, name in enumerate(header or [""] * width, start=1))
    columns = _cells(path, text, (len(at), width), delimiter, mark, codes)
    return TextTable(path, names, header is not None, at, columns, delimiter, mark, header_line)


def _rows_as_text(
    path: Path, rows: Iterable[tuple[int, str]], first: int, width: int, delimiter: str
) -> tuple[NDArray[np.int64], io.BytesIO]:
    """Return the numbers (N,) of lines, and their text for pandas.

    Lines with quotation marks and of cells between spaces are written anew, so that whatever they hold,
    pandas finds the cells that were counted here. Refuses lines of more or fewer cells than the first.
    """
    numbers, text, faults = array("q"), io.BytesIO(), list[str]()
    mark = _mark(delimiter)
    for number, line in rows:
        if delimiter != " " and '"' not in line:
            count = line.count(delimiter) + 1
        else:
            cells = split_line(path, number, line, delimiter)
            count, line = len(cells), mark.join(_as_cell(cell, mark) for cell in cells)
        if count != width:
            faults.append(f"line {number} has {count} cell{'s' * (count != 1)}")
        numbers.append(number)
        if len(numbers) > MAX_ROWS:
            raise InputFileError(
                f"{path}: more than {MAX_ROWS} rows, the most that is read; save a part of the table"
            )
        if not faults:
            text.write(f"{line}\n".encode())
    if faults:
        also = "; a name with a space in it counts as two" if delimiter == " " else ""
        also = (
            ", or specify {decimal} , if commas stand before decimals" if delimiter == "," else also
        )
        raise TableError(
            literal(f"{path}: {faults[0]} and line {first} has {width}{and_others(faults[1:])}; ")
            + f"give every line as many{also}"
        )
    text.seek(0)
    return np.array(numbers, dtype=np.int64), text


def _mark(delimiter: str) -> str:
    """Return what separates cells for pandas."""
    return "\t" if delimiter == " " else delimiter


def _as_cell(cell: str, mark: str) -> str:
    return '"' + cell.replace('"', '""') + '"' if mark in cell or '"' in cell else cell


def _cells(
    path: Path,
    text: io.BytesIO,
    shape: tuple[int, int],
    delimiter: str,
    decimal: str,
    codes: Sequence[str],
) -> tuple[NDArray[Any], ...]:
    """Return the cells of lines by column: float64 where all are numbers, or else words."""
    pandas = importlib.import_module("pandas")
    missing = {form for word in MISSING for form in (word, word.casefold(), word.upper())}
    exact: dict[str, Any] = {}
    if tuple(map(int, pandas.__version__.split(".")[:2])) < (3, 1):  # later ones always are
        exact = {"float_precision": "round_trip"}
    try:
        frame = pandas.read_csv(
            text,
            sep=_mark(delimiter),
            header=None,
            names=list(range(shape[1])),
            index_col=False,
            decimal=decimal,
            na_values=[*missing, *codes],
            keep_default_na=False,
            skip_blank_lines=False,
            skipinitialspace=True,
            low_memory=False,
            **exact,
        )
    except (ValueError, OverflowError) as error:  # pandas' errors of parsing are such
        raise InputFileError(
            f"{path}: cannot be read as a table ({error}); save it again"
        ) from error
    if frame.shape != shape:
        raise InputFileError(
            f"{path}: {shape[0]} lines were read as {frame.shape[0]} rows; save it again without "
            "quotation marks"
        )
    found: list[NDArray[Any]] = []
    for column in range(shape[1]):
        cells = frame[column]
        if cells.dtype.kind in "fiu":
            found.append(cells.to_numpy(np.float64))
        else:
            words = ["" if cell != cell else str(cell).strip() for cell in cells.tolist()]
            found.append(np.array([*words, None], dtype=object)[:-1])
    return tuple(found)


def append_to_text(table: TextTable, columns: dict[str, Array], rows: NDArray[np.int64]) -> bytes:
    """Return the source file with more columns, as UTF-8 text that ends its lines with a newline.

    Values are written with 10 significant digits, for the rows of the table with these numbers (N,),
    from 0; others get an empty cell. The file keeps its delimiter, its other columns and its comments,
    and loses its blank lines; it gets the new names only if it has a header.
    """
    path, end, out = table.path, table.delimiter, bytearray()
    place = dict(zip(table.lines[rows].tolist(), range(len(rows)), strict=True))
    known = set(table.lines.tolist())
    for number, line, is_comment in text_lines(path):
        if number == table.header_line:
            cells = [name_cell(name, end) for name in columns]
            if is_comment and end not in line:  # of other marks than the rows
                line, cells = " ".join([line, *cells]), []
        elif is_comment:
            cells = []
        elif number in place:
            own = place[number]
            values = (
                f"{column[own]:.10g}".replace(".", table.decimal) for column in columns.values()
            )
            cells = [f'"{cell}"' if table.decimal == end else cell for cell in values]
            del place[number]
        elif number in known:
            cells = ["nan" if end == " " else ""] * len(columns)
        else:
            break
        out += f"{end.join([line, *cells])}\n".encode()
    else:
        if not place:
            return bytes(out)
    raise InputFileError(f"{path}: the file changed after it was read; run this again")


def name_cell(name: str, delimiter: str) -> str:
    """Return a column's name as a cell of a header."""
    words = name.split()
    if delimiter == " ":
        return "_".join(words)
    name = " ".join(words)
    if name.startswith("#") or delimiter in name or '"' in name:
        return '"' + name.replace('"', '""') + '"'
    return name
