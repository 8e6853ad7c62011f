"""Tables in text files, read in two passes.

The first looks at 100 rows to find the delimiter, the header and the columns of numbers. The second
turns blocks of cells into numbers, and only a block that fails is searched cell by cell for the one
at fault. Memory holds the numbers and one block of text.
"""

from __future__ import annotations

import csv
import math
import re
from array import array
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np

from orbiflow.density.tables import table as tables
from orbiflow.density.tables.numerals import (
    OTHER,
    Mark,
    Marks,
    kind_of,
    marks_of,
    plain,
    with_minus,
)
from orbiflow.density.tables.table import (
    BLOCK,
    Reading,
    Table,
    TableError,
    check_count,
    listing,
    quote,
)
from orbiflow.errors import InputFileError, literal

MAX_LINE = 2**20
"""Characters of a line at most."""

DEGREES = "write decimal degrees, negative in the south and in the west"
_IN_DEGREES = re.compile(r"\d.*[°'\"NSEWO]\s*$|^[NSEWO]\s*\d")

SAMPLE = 100
"""Rows looked at to find the layout."""

DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+(e[+-]?\d+)?", re.IGNORECASE)
_LONE_COMMA = re.compile(r"[+-]?\d+(\.\d{3})*(,\d+)?")
_LEADING_ZERO = re.compile(r",0\d")
_WHOLE = re.compile(r"[+-]?\d+")
_UNDECODED = re.compile("[\udc80-\udcff]")
# what spreadsheets write in a cell without a value, which begins no comment
_SHEET_ERROR = re.compile(r"#(?:N/?A|NULL!|DIV/0!|VALUE!|REF!|NAME\?|NUM!)", re.IGNORECASE)
_SEPARATOR = re.compile(r'"?sep=(.)"?', re.IGNORECASE)
"""Excel's first line, which says what separates cells."""


@dataclass(frozen=True)
class Layout:
    """The layout of a text file.

    - `delimiter`: The mark between cells, " " for runs of whitespace.
    - `header`: The names in the header line, None if there is none.
    - `names`: The columns' names. `numeric`: Which columns hold numbers.
    - `first`: The number of the first line that is no comment.
    - `marks`: How numbers are written.
    """

    delimiter: str
    header: tuple[str, ...] | None
    names: tuple[str, ...]
    numeric: tuple[bool, ...]
    first: int
    marks: Marks

    @property
    def decimal(self) -> Mark:
        """The mark before decimals."""
        return self.marks.decimal


def read_text(path: Path, reading: Reading) -> Table:
    """Read a table from a text file."""
    layout = layout_of(path, reading.columns, reading.has_header, reading.decimal)
    picked, notes = tables.choose(path, layout.names, layout.numeric, reading)
    _refuse_doubtful(path, layout, picked)
    names = tuple(layout.names[i] for i in picked)
    values, lines, comments = array("d"), array("q"), 0
    cells: list[str] = []
    for number, line, is_comment in text_lines(path):
        if is_comment or (number == layout.first and layout.header is not None):
            comments += is_comment
            continue
        row = split_line(path, number, line, layout.delimiter)
        _check_length(path, number, row, layout.first, len(layout.names), layout.delimiter)
        lines.append(number)
        cells.extend([row[i] for i in picked])
        if len(cells) >= BLOCK * len(picked):
            values.extend(_numbers(path, cells, lines, names, layout.marks))
            cells.clear()
            check_count(path, len(lines), reading.max_rows, "rows")
    values.extend(_numbers(path, cells, lines, names, layout.marks))
    check_count(path, len(lines), reading.max_rows, "rows")
    rows, at = np.frombuffer(values).reshape(-1, len(picked)), np.frombuffer(lines, dtype=np.int64)
    named = {name: getattr(layout, name) for name in ("header", "delimiter", "decimal")}
    table = tables.finished(path, rows, at, names, reading, notes, named)
    notes = list(table.notes)
    if layout.decimal == ",":
        notes.append("read decimal commas")
    if layout.marks.parted:
        value = float(plain(layout.marks.parted, layout.decimal))
        notes.append(f"read thousands: {layout.marks.parted} as {value:.10g}")
    if layout.header is not None:
        notes.append(f"took line {layout.first} as the header: {listing(layout.header)}")
    if comments:
        notes.append(f"skipped {comments} comment line{'s' * (comments > 1)}")
    return replace(table, notes=tuple(notes))


def text_lines(path: Path) -> Iterator[tuple[int, str, bool]]:
    """Yield the number and text of every line that is not blank, and whether it is a comment.

    Excel's first line "sep=;" counts as one.
    """
    try:
        with path.open(encoding="utf-8-sig", errors="surrogateescape") as file:
            for number, line in enumerate(iter(partial(file.readline, MAX_LINE), ""), start=1):
                if not line.isascii() and _UNDECODED.search(line):
                    raise InputFileError(
                        f"{path}: line {number}: not UTF-8 text; save the file as UTF-8"
                    )
                if len(line) == MAX_LINE and line[-1] != "\n":
                    raise InputFileError(
                        f"{path}: line {number} is longer than {MAX_LINE} characters; this is not "
                        "a table of numbers, or its line ends are lost"
                    )
                text = line.strip()
                if text:
                    is_comment = (text[0] == "#" and not _SHEET_ERROR.match(text)) or (
                        number == 1 and _SEPARATOR.fullmatch(line.rstrip("\r\n"))
                    )
                    yield number, line.rstrip("\n"), bool(is_comment)
    except OSError as exc:
        raise InputFileError(f"{path}: cannot be read ({exc.strerror}); check it") from exc


def layout_of(
    path: Path,
    columns: Sequence[str] | None,
    has_header: bool | None = None,
    decimal: Mark | None = None,
) -> Layout:
    """Find the layout of a text file from its first rows."""
    lines = (line[:2] for line in text_lines(path) if not line[2])
    sample = list(islice(lines, SAMPLE))
    said = next((_SEPARATOR.fullmatch(line) for _, line, _ in text_lines(path)), None)
    if not sample:
        raise InputFileError(f"{path}: only comments and blank lines; export it again")
    first = sample[0][0]
    delimiter = said[1] if said else _delimiter([with_minus(line) for _, line in sample])
    rows = [split_line(path, number, line, delimiter) for number, line in sample]
    check_count(path, len(rows[0]), tables.MAX_COLUMNS, "columns")
    for (number, _), row in zip(sample, rows, strict=True):
        _check_length(path, number, row, first, len(rows[0]), delimiter)
    marks = marks_of(rows, delimiter if len(rows[0]) > 1 else "", decimal)
    classes = [
        tuple(kind_of(plain(cell, marks.decimal)) for cell in column)
        for column in zip(*rows, strict=True)
    ]
    header = None
    if has_header is None:
        has_header = _has_header(path, first, rows[0], classes, columns)
    if has_header:
        header = tuple(cell.strip().strip('"').strip() for cell in rows[0])
        if len(rows) == 1:
            raise InputFileError(f"{path}: line {first} is a header and no row follows; add rows")
        classes = [column[1:] for column in classes]
    names = tuple(name or f"column{i}" for i, name in enumerate(header or [""] * len(classes), 1))
    numeric = tuple(c.count("number") >= max(1, c.count("word")) for c in classes)
    return Layout(delimiter, header, names, numeric, first, marks)


def _refuse_doubtful(path: Path, layout: Layout, picked: Sequence[int]) -> None:
    """Refuse columns whose commas may be before decimals or thousands."""
    for column, cell in layout.marks.doubtful:
        if column in picked:
            raise _two_ways(path, layout.names[column], cell)


def _two_ways(path: Path, name: str, cell: str) -> TableError:
    """Return what to say of a number that may have decimals or thousands."""
    mark = "," if "," in cell else "."
    right, other = cell.replace(mark, ""), cell.replace(mark, ".")
    return TableError(
        literal(f"{path}: column {quote(name)}: {cell!r} may be {right} or {other}")
        + "; say with {decimal} which mark is before decimals, . or ,"
    )


def _delimiter(lines: list[str]) -> str:
    r"""Return the mark that splits all lines into as many cells, or else splits most of them.

    The semicolon is tried before the comma, which may be a decimal one. It also stands for none, where
    a single column has decimal commas.

    >>> _delimiter(["lat;lon", "1,5;2"]), _delimiter(["1, 2", "3, 4"]), _delimiter(["1 2", "3\t4"])
    (';', ',', ' ')
    >>> _delimiter(["angle", "1.025,2", "998,7"])
    ';'
    """
    first, *rest = lines
    lone = all(_LONE_COMMA.fullmatch(line.strip()) for line in rest)
    if lone and any("," in line for line in rest):
        headed = "," not in first
        # no second column of whole numbers has zeros in front
        if headed or (
            _LONE_COMMA.fullmatch(first.strip()) and _LEADING_ZERO.search(",".join(lines))
        ):
            return ";"
    if _is_spaced(lines[len(lines) > 1 :]):
        return " "
    counts = {mark: [line.count(mark) for line in lines] for mark in "\t;,"}
    for mark, count in counts.items():
        if count[0] and len(set(count)) == 1:
            return mark
    for mark, count in counts.items():
        if 2 * sum(map(bool, count)) > len(lines):
            return mark
    return " " if any(len(line.split()) > 1 for line in lines) else ","


def _is_spaced(lines: list[str]) -> bool:
    """Return whether all lines are numbers separated by spaces, some with decimal commas.

    >>> _is_spaced(["1,5 2", "3 4,25"]), _is_spaced(["1, 2", "3, 4"])
    (True, False)
    """
    cells = [line.split() for line in lines]
    flat = [cell for row in cells for cell in row]
    numbers = all(DECIMAL_COMMA.fullmatch(cell) or _WHOLE.fullmatch(cell) for cell in flat)
    some = any("," in cell for cell in flat)
    return numbers and some and all(len(row) > 1 for row in cells) and "\t" not in "".join(lines)


def split_line(path: Path, number: int, line: str, delimiter: str) -> list[str]:
    """Return the cells of a line, with plain minus signs before numbers."""
    line = with_minus(line)
    if delimiter == " ":
        return line.split()
    if '"' not in line:
        return line.split(delimiter)
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True, strict=True))
    except csv.Error as exc:
        raise InputFileError(
            f"{path}: line {number}: {quote(line)} has a quotation mark without its pair ({exc}); "
            "a quoted cell must end on its line"
        ) from exc


def _has_header(
    path: Path,
    first: int,
    row: list[str],
    classes: list[tuple[str, ...]],
    columns: Sequence[str] | None,
) -> bool:
    tops = [column[0] for column in classes]
    if "word" not in tops:
        return False
    if "number" not in tops or len(classes[0]) == 1:
        return True
    if any(column[0] == "word" and "number" in column[1:] for column in classes):
        return True
    # `Paris,48.9,2.4` above `Rome,41.9,12.5` is a row; `city,2019,2020` above it is a header
    names = {cell.strip().casefold() for cell in row}
    wanted = [name.strip() for name in columns or ()]
    by_number = all(tables.is_number(name, len(row)) for name in wanted)
    if not by_number and all(name.casefold() in names for name in wanted):
        return True
    raise TableError(
        literal(
            f"{path}: line {first} may be a header or a row, as its numbers stand above numbers "
        )
        + "and its words above words; say with {header} which it is, put a header line of names above "
        "it, or choose columns by the names in it with {columns}"
    )


def _numbers(
    path: Path, cells: list[str], lines: array[int], names: tuple[str, ...], marks: Marks
) -> list[float]:
    """Return the cells of the last of `lines`, row after row, as floats; NaN for missing ones."""
    text, decimal = "".join(cells), marks.decimal
    if "_" not in text and text.isascii() and (decimal == "." or "." not in text):
        # float takes 1_000 and other digits than ASCII's
        plainly = cells if decimal == "." else [cell.replace(",", ".") for cell in cells]
        with suppress(ValueError):
            return list(map(float, plainly))
    k, start = len(names), len(lines) - len(cells) // len(names)
    return [
        _number(path, lines[start + i // k], names[i % k], cell, marks)
        for i, cell in enumerate(cells)
    ]


def _number(path: Path, line: int, name: str, cell: str, marks: Marks) -> float:
    decimal, other = marks.decimal, OTHER[marks.decimal]
    number = plain(cell, decimal)
    kind = kind_of(number)
    if kind == "missing":
        return math.nan
    if kind == "number":
        either = cell.count(other) == 1 and decimal not in cell
        if either and marks.parted is None and not marks.is_asked:
            raise _two_ways(path, name, cell)  # the first rows have shown nothing of the kind
        return float(number)
    comma = kind_of(plain(cell, other)) == "number"
    right, wrong = ("points", "commas") if decimal == "." else ("commas", "points")
    hint = f"write decimal {right}, not {wrong}, or say with {{decimal}} that they are {wrong}"
    raise TableError(
        literal(f"{path}: line {line}: column {quote(name)}: {quote(cell)} is not a number; ")
        + (
            hint
            if comma
            else DEGREES
            if _IN_DEGREES.search(cell)
            else "correct it or drop the line"
        )
    )


def _check_length(
    path: Path, number: int, row: list[str], first: int, expected: int, delimiter: str
) -> None:
    if (n := len(row)) != expected:
        spaced = "; a name with a space in it counts as two" if delimiter == " " else ""
        raise InputFileError(
            f"{path}: line {number} has {n} cell{'s' * (n != 1)} and line {first} has {expected}; "
            f"give every line as many{spaced}"
        )
