"""Tables in text files: their lines and names; pandas reads the cells."""

from __future__ import annotations

import codecs
import csv
import importlib
import io
import re
from array import array
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.density.data import (
    MISSING,
    DataTable,
    TableError,
    TextForm,
    and_others,
    is_missing_word,
    number_of,
    numbered,
    object_array,
    short,
)
from orbiflow.errors import InputFileError, literal, system_errors

MAX_ROWS, MAX_COLUMNS = 20_000_000, 10_000

MAX_LINE = 2**20
"""Characters of a line at most."""

SAMPLE = 100
"""Rows looked at to find the mark between cells."""

_UNDECODED = re.compile("[\udc80-\udcff]")
_MINUS = re.compile(r"[\u2010-\u2013\u2212\ufe63\uff0d](?=[\d.,])")

SEPARATOR = re.compile(r'"?sep=(.)"?', re.IGNORECASE)
"""Excel's first line, which says what separates cells."""


def is_utf16(head: bytes) -> bool:
    """Return whether a file's first bytes are the byte-order mark of UTF-16, and not of UTF-32."""
    return head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) and head[2:4] != b"\0\0"


def with_minus(text: str) -> str:
    """Return text with plain minus signs before numbers.

    >>> with_minus("\u22123,5")
    '-3,5'
    """
    return text if text.isascii() else _MINUS.sub("-", text)


def check_size(path: Path, rows: int, columns: int) -> None:
    """Refuse a table that is too large."""
    for count, most, what in ((rows, MAX_ROWS, "rows"), (columns, MAX_COLUMNS, "columns")):
        if count > most:
            raise InputFileError(
                f"{path}: more than {most} {what}, the most that is read; save a part of the table"
            )


def text_lines(path: Path) -> Iterator[tuple[int, str, bool]]:
    """Yield the number and text of every line that is not blank, and whether it is a comment.

    Excel's first line "sep=;" counts as one.
    """
    try:
        with system_errors(InputFileError, f"{path}: cannot be read", "check it"):
            with path.open("rb") as file:
                encoding = "utf-16" if is_utf16(file.read(4)) else "utf-8-sig"
            with path.open(encoding=encoding, errors="surrogateescape") as file:
                for number, line in enumerate(iter(partial(file.readline, MAX_LINE), ""), start=1):
                    _check_line(f"{path}: line {number}", line)
                    if text := line.strip():
                        is_comment = number == 1 and SEPARATOR.fullmatch(line.rstrip("\r\n"))
                        if text[0] == "#":  # as Excel's #N/A, which is a cell
                            is_comment = not is_missing_word(
                                re.split(r"[\s,;]", text, maxsplit=1)[0]
                            )
                        yield number, line.rstrip("\n"), bool(is_comment)
    except UnicodeError as exc:
        raise InputFileError(f"{path}: not UTF-16 text, as it begins; save it as UTF-8") from exc


def _check_line(where: str, line: str) -> None:
    if not line.isascii() and _UNDECODED.search(line):
        raise InputFileError(f"{where}: not UTF-8 text; save the file as UTF-8")
    if "\0" in line:
        raise InputFileError(
            f"{where}: a null byte, which no text has; the file is binary or damaged: save it as CSV "
            "in UTF-8"
        )
    if len(line) == MAX_LINE and line[-1] != "\n":
        raise InputFileError(
            f"{where} is longer than {MAX_LINE} characters; this is no table of numbers, or its line "
            "ends are lost"
        )


def split_line(path: Path, number: int, line: str, delimiter: str) -> list[str]:
    """Return the cells of a line; spaces between them count once."""
    line = " ".join(line.split()) if delimiter == " " else line
    if '"' not in line:
        return line.split(delimiter)
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True, strict=True))
    except csv.Error as exc:
        raise InputFileError(
            f"{path}: line {number}: {short(line)!r} has a quotation mark without its pair, or too "
            "long a cell; a quoted cell must end on its line, before the next cell"
        ) from exc


def delimiter_of(lines: Sequence[str], decimal: str) -> str:
    r"""Return the mark that splits all lines into as many cells, or else splits most of them.

    A comma that stands before decimals is none, and a header may lack the name of the first column.

    >>> delimiter_of(["lat;lon", "1,5;2"], "."), delimiter_of(["1 2", "3\t4"], ".")
    (';', ' ')
    >>> delimiter_of(["1,5 2", "3 4,25"], ","), delimiter_of(["Direction (deg)", "10", "20.5"], ".")
    (' ', ',')
    """
    marks = [mark for mark in "\t;|, " if mark != decimal]
    lines = [re.sub(r'"[^"]*"', "_", line) for line in lines]
    counts = {m: [len(line.split(None if m == " " else m)) for line in lines] for m in marks}
    for mark, (first, *others) in counts.items():
        if first > 1 and (set(others) or {first}) in ({first}, {first + 1}):
            return mark
    often = (mark for mark in marks if 2 * sum(k > 1 for k in counts[mark]) > len(lines))
    return next(often, ";" if decimal == "," else ",")


def _is_number(cell: str) -> bool:
    """Return whether a cell is a number with any mark before decimals, and so none of a header."""
    return not np.isnan(number_of(cell.strip().strip('"').replace(",", ".")))


def _is_word(cell: str) -> bool:
    return not is_missing_word(cell.strip('"')) and not _is_number(cell)


def _is_header(
    where: str, top: Sequence[str], rows: Sequence[Sequence[str]], codes: Sequence[str]
) -> bool:
    """Return whether the first line names the columns; `codes` stand for missing values in rows."""
    are_words = [_is_word(cell) and cell.strip() not in codes for cell in top]
    if not any(are_words) or not any(map(_is_number, top)):
        return any(are_words)
    below = zip(*(row for row in rows if len(row) == len(top)), strict=True)
    for is_word, column in zip(are_words, below, strict=False):
        if is_word and any(map(_is_number, column)):
            return True
    raise TableError(
        literal(
            f"{where} may be a header or a row, as its numbers stand above numbers and its words "
        )
        + "above words; specify with {header} which it is"
    )


def _header_among(
    comments: Sequence[tuple[int, str]], width: int, delimiter: str
) -> tuple[list[str] | None, int | None]:
    """Return the last comment that names as many columns, as numpy.savetxt writes it, and its line.

    >>> _header_among([(1, "# by me"), (2, "# lon, lat"), (3, "# 1, 2")], 2, ",")
    (['lon', 'lat'], 2)
    """
    for number, line in reversed(comments):
        text = re.sub(r"^\w+:\s+", "", line.strip().lstrip("#").strip())  # such as "Columns: "
        words = re.split(r"\s*[,;\t]\s*|\s+", text)
        cells = words if delimiter == " " else text.split(delimiter)
        names = [cell.strip().strip('"').strip() for cell in (cells, words)[len(cells) != width]]
        if len(set(names)) == len(names) == width and all(map(_is_word, names)):
            return names, number
    return None, None


def _lacks_first_name(top: Sequence[str], rows: Sequence[Sequence[str]], delimiter: str) -> bool:
    """Return whether a header lacks the name of the first column, the rows' names, as R writes it."""
    are_longer = {len(row) for row in rows} == {len(top) + 1} and delimiter in " \t"
    return (
        are_longer
        and all(map(_is_word, top))
        and len({row[0] for row in rows}) == len(rows)
        and all(row[-1].strip() for row in rows)
    )


def read_text(
    path: Path,
    *,
    has_header: bool | None = None,
    decimal: str | None = None,
    codes: Sequence[str] = (),
) -> DataTable:
    """Read a text file.

    Cells are separated by tabs, semicolons, bars, commas or whitespace. Blank lines and lines that
    begin with # are skipped. The first other line is a header if a cell in it is neither a number nor
    missing, or else the last comment above it that has a name for each column.

    Args:
        path: The file.
        has_header: Whether the first line names the columns, None to look.
        decimal: The mark before decimals, a point if it is not said.
        codes: What stands for a missing value as well, numbers or words.

    Raises:
        InputFileError: For a file that cannot be read, and lines of different numbers of cells.
    """
    mark, lines = decimal or ".", text_lines(path)
    comments: list[tuple[int, str]] = []
    head: list[tuple[int, str]] = []
    for number, line, is_comment in lines:
        if not is_comment:
            head.append((number, with_minus(line)))
        elif not head:
            comments.append((number, line))
        if len(head) == SAMPLE:
            break
    if not head:
        raise InputFileError(f"{path}: only comments and blank lines; export it again")
    separator = SEPARATOR.fullmatch(comments[0][1].strip()) if comments else None
    delimiter = separator[1] if separator else delimiter_of([line for _, line in head], mark)
    if delimiter == mark or not delimiter.isascii():
        raise InputFileError(
            f"{path}: line 1 says that {delimiter!r} separates cells, which it cannot where decimals "
            f"stand after {mark!r}; save the file with semicolons"
        )
    first = head[0][0]
    top, *sample = [split_line(path, number, line, delimiter) for number, line in head]
    if has_header is not False and _lacks_first_name(top, sample, delimiter):
        top = ["", *top]
    check_size(path, 0, len(top))
    if has_header is None:
        has_header = _is_header(f"{path}: line {first}", top, sample, codes)
    if not has_header:
        header, header_line = _header_among(comments, len(top), delimiter)
    elif len(head) == 1:
        raise InputFileError(f"{path}: line {first} is a header and no row follows; add rows")
    else:
        header, header_line = [cell.strip().strip('"').strip() for cell in top], first
    rest = ((number, with_minus(line)) for number, line, is_comment in lines if not is_comment)
    rows = islice(chain(head, rest), int(has_header), None)
    numbers, text = _rows_as_text(path, rows, (first, len(top)), delimiter)
    columns = _cells(path, text, (len(numbers), len(top)), mark, codes)
    pairs = zip(header or [""] * len(top), numbered(len(top)), strict=True)
    names, form = tuple(n or k for n, k in pairs), TextForm(delimiter, mark, numbers, header_line)
    return DataTable(
        names, header is not None, columns, f"{path}: ", path, codes=tuple(codes), text=form
    )


def _rows_as_text(
    path: Path, rows: Iterable[tuple[int, str]], first: tuple[int, int], delimiter: str
) -> tuple[NDArray[np.int64], io.BytesIO]:
    """Return the numbers (N,) of lines, and their text for pandas, with tabs between cells.

    All lines are written anew, so that whatever they hold, pandas finds the cells that were counted
    here. Refuses lines of other numbers of cells than the `first`, whose number and width it is.
    """
    numbers, text, faults = array("q"), io.BytesIO(), list[str]()
    for number, line in rows:
        if delimiter == " " or '"' in line or (delimiter != "\t" and "\t" in line):
            cells = split_line(path, number, line, delimiter)
            count, line = len(cells), "\t".join(map(_as_cell, cells))
        else:
            count, line = line.count(delimiter) + 1, line.replace(delimiter, "\t")
        numbers.append(number)
        check_size(path, len(numbers), 0)
        if count != first[1]:
            faults.append(f"line {number} has {count} cell{'s' * (count != 1)}")
        elif not faults:
            text.write(f"{line}\n".encode())
    if faults:
        also = {" ": "; a name with a space in it counts as two"}.get(delimiter, "")
        if delimiter == ",":
            also = ", or specify {decimal} , if commas stand before decimals"
        raise TableError(
            literal(
                f"{path}: {faults[0]} and line {first[0]} has {first[1]}{and_others(faults[1:])}"
            )
            + f"; give every line as many{also}"
        )
    text.seek(0)
    return np.array(numbers, dtype=np.int64), text


def _as_cell(cell: str) -> str:
    return '"' + cell.replace('"', '""') + '"' if "\t" in cell or '"' in cell else cell


def _cells(
    path: Path, text: io.BytesIO, shape: tuple[int, int], decimal: str, codes: Sequence[str]
) -> tuple[NDArray[Any], ...]:
    """Return the cells of lines by column: float64 where all are numbers, or else words."""
    pandas = importlib.import_module("pandas")
    missing = {form for word in MISSING for form in (word, word.casefold(), word.upper())}
    exact: dict[str, Any] = {}
    if tuple(map(int, pandas.__version__.split(".")[:2])) < (3, 1):  # later ones always are
        exact = {"float_precision": "round_trip"}
    try:
        frame = pandas.read_csv(
            text, sep="\t", header=None, names=list(range(shape[1])), index_col=False,
            decimal=decimal, na_values=[*missing, *codes], keep_default_na=False,
            skip_blank_lines=False, skipinitialspace=True, low_memory=False, **exact,
        )  # fmt: skip
    except (ValueError, OverflowError) as error:  # pandas' errors of parsing are such
        raise InputFileError(
            f"{path}: cannot be read as a table ({error}); save it again"
        ) from error
    if frame.shape != shape:
        raise InputFileError(
            f"{path}: {shape[0]} lines were read as {frame.shape[0]} rows; save it again without "
            "quotation marks"
        )
    columns = (frame[column] for column in range(shape[1]))
    return tuple(
        cells.to_numpy(np.float64)
        if cells.dtype.kind in "fiu"
        else object_array(["" if cell != cell else str(cell).strip() for cell in cells.tolist()])
        for cells in columns
    )


def append_to_text(table: DataTable, columns: dict[str, Array], rows: NDArray[np.int64]) -> bytes:
    """Return the source file with more columns, as UTF-8 text that ends its lines with a newline.

    Values are written with 10 significant digits, for the rows of the table with these numbers (N,),
    from 0; others get an empty cell. The file keeps its delimiter, its other columns and its comments,
    and loses its blank lines; it gets the new names only if it has a header.
    """
    path, form = table.path, table.text
    assert path is not None
    assert form is not None
    end, decimal, out = form.delimiter, form.decimal, bytearray()
    place = dict(zip(form.lines[rows].tolist(), range(len(rows)), strict=True))
    others = set(form.lines.tolist()) - place.keys()
    changed = InputFileError(f"{path}: the file changed after it was read; run this again")
    for number, line, is_comment in text_lines(path):
        cells: list[str] = []
        if number == form.header_line:
            cells = [name_cell(name, end) for name in columns]
            if is_comment and end not in line:  # of other marks than the rows
                line, cells = " ".join([line, *cells]), []
        elif not is_comment and number in others:
            cells = ["nan" if end == " " else ""] * len(columns)
        elif not is_comment:
            if (row := place.pop(number, None)) is None:
                raise changed
            cells = [f"{column[row]:.10g}".replace(".", decimal) for column in columns.values()]
            cells = [f'"{cell}"' if decimal == end else cell for cell in cells]
        out += f"{end.join([line, *cells])}\n".encode()
    if place:
        raise changed
    return bytes(out)


def name_cell(name: str, delimiter: str) -> str:
    """Return a column's name as a cell of a header."""
    words = name.split()
    if delimiter == " ":
        return "_".join(words)
    name = " ".join(words)
    if name.startswith("#") or delimiter in name or '"' in name:
        return '"' + name.replace('"', '""') + '"'
    return name
