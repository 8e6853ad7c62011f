"""How a text file is laid out: its lines, their delimiter, the header, and how cells are written."""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from orbiflow.density.data import (
    UNITS,
    is_angle_named,
    is_count_named,
    is_other_quantity,
    pairs_of,
    words_of,
)
from orbiflow.density.tables import table as tables
from orbiflow.density.tables.cells import (
    COMPASS,
    OTHER,
    Mark,
    Marks,
    are_times,
    bare,
    is_like_angle,
    is_time,
    kind_of,
    marks_of,
    plain,
    unit_of_cell,
    unit_of_cells,
    with_minus,
)
from orbiflow.density.tables.table import TableError, check_count, quote
from orbiflow.errors import InputFileError, literal

MAX_LINE = 2**20
"""Characters of a line at most."""

_UNDECODED = re.compile("[\udc80-\udcff]")
# what spreadsheets write in a cell without a value, which begins no comment
_SHEET_ERROR = re.compile(r"#(?:N/?A|NULL!|DIV/0!|VALUE!|REF!|NAME\?|NUM!)", re.IGNORECASE)
_SPACED = re.compile(r'"[^"]*"(?=\s|$)|\S+')
"""Cells between spaces, which may be quoted."""

SEPARATOR = re.compile(r'"?sep=(.)"?', re.IGNORECASE)
"""Excel's first line, which says what separates cells."""


CHANNEL_TEXT = "Channel Text File"
"""First line of a .ctf file, whose header is the first line that names Euler angles."""

ANG_NAMES = ("phi1", "Phi", "phi2", "x", "y", "iq", "ci", "phase", "sem", "fit")
"""First columns of an .ang file, which has no header; its angles are in radians."""


def is_utf16(head: bytes) -> bool:
    """Return whether a file's first bytes are the byte-order mark of UTF-16, and not of UTF-32."""
    return head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) and head[2:4] != b"\0\0"


def encoding_of(path: Path) -> str:
    """Return the encoding of a text file: UTF-16 if it has its byte-order mark, or else UTF-8."""
    with path.open("rb") as file:
        return "utf-16" if is_utf16(file.read(4)) else "utf-8-sig"


def text_lines(path: Path) -> Iterator[tuple[int, str, bool]]:
    """Yield the number and text of every line that is not blank, and whether it is a comment.

    Excel's first line "sep=;" counts as one, and so do the lines above the header of a .ctf file.
    """
    is_above = False
    try:
        with path.open(encoding=encoding_of(path), errors="surrogateescape") as file:
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
                is_above = (number == 1 and text == CHANNEL_TEXT) or is_above
                is_above = is_above and "euler1" not in text.casefold()
                if text:
                    is_comment = (
                        is_above
                        or (text[0] == "#" and not _SHEET_ERROR.match(text))
                        or (number == 1 and SEPARATOR.fullmatch(line.rstrip("\r\n")))
                    )
                    yield number, line.rstrip("\n"), bool(is_comment)
    except UnicodeError as exc:
        raise InputFileError(f"{path}: not UTF-16 text, as it begins; save it as UTF-8") from exc
    except OSError as exc:
        raise InputFileError(f"{path}: cannot be read ({exc.strerror}); check it") from exc


def split_line(path: Path, number: int, line: str, delimiter: str) -> list[str]:
    """Return the cells of a line, with plain minus signs before numbers."""
    line = with_minus(line)
    if delimiter == " ":
        return [cell.strip('"') for cell in _SPACED.findall(line)] if '"' in line else line.split()
    if '"' not in line:
        return line.split(delimiter)
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True, strict=True))
    except csv.Error as exc:
        raise InputFileError(
            f"{path}: line {number}: {quote(line)} has a quotation mark without its pair ({exc}); "
            "a quoted cell must end on its line"
        ) from exc


def check_lengths(
    path: Path, rows: Iterable[tuple[int, list[str]]], first: int, expected: int, delimiter: str
) -> None:
    """Check that rows, each with the number of its line, have as many cells as the first line."""
    found = [
        f"line {number} has {len(row)} cell{'s' * (len(row) != 1)}"
        for number, row in rows
        if len(row) != expected
    ]
    if found:
        spaced = "; a name with a space in it counts as two" if delimiter == " " else ""
        raise InputFileError(
            f"{path}: {found[0]} and line {first} has {expected}{and_others(found[1:])}; "
            f"give every line as many{spaced}"
        )


def and_others(faults: Sequence[str]) -> str:
    """Return what a message of the first fault of a file says of the others, in brackets.

    >>> and_others(["line 4 has 2 cells"]), and_others([])
    (' (also, line 4 has 2 cells)', '')
    """
    listed = ", ".join(faults[:MAX_LISTED])
    more = f", and {len(faults) - MAX_LISTED} more" * (len(faults) > MAX_LISTED)
    return f" (also, {listed}{more})" if faults else ""


MAX_LISTED = 6
"""Faults of a file that are listed after the first."""


SAMPLE = 100
"""Rows looked at to find the layout."""

_LONE_COMMA = re.compile(r"[+-]?\d+(\.\d{3})*(,\d+)?")
_LEADING_ZERO = re.compile(r",0\d")
_WHOLE = re.compile(r"[+-]?\d+")


@dataclass(frozen=True)
class Layout:
    """The layout of a text file.

    - `delimiter`: The mark between cells, " " for runs of whitespace.
    - `header`: The names in the header line, None if there is none.
    - `header_line`: The number of that line, which may be a comment.
    - `names`: The columns' names. `numeric`: Which columns hold numbers.
    - `spoiled`: Columns called after angles that are text, by name, each with a cell that is no number.
    - `units`: The unit that the cells of each column write, or None.
    - `first`: The number of the first line that is no comment.
    - `marks`: How numbers are written.
    """

    delimiter: str
    header: tuple[str, ...] | None
    header_line: int | None
    names: tuple[str, ...]
    numeric: tuple[bool, ...]
    units: tuple[str | None, ...]
    spoiled: Mapping[str, str]
    first: int
    marks: Marks

    @property
    def decimal(self) -> Mark:
        """The mark before decimals."""
        return self.marks.decimal

    def of_table(self) -> dict[str, Any]:
        """Return what a table says of its layout, by the names of its fields."""
        units = zip(self.names, self.units, strict=True)
        found = {name: "degrees" if own == COMPASS else own for name, own in units if own}
        names = ("header", "header_line", "delimiter", "decimal")
        return {**{name: getattr(self, name) for name in names}, "units": found}


def layout_of(
    path: Path,
    columns: Sequence[str] | None,
    has_header: bool | None = None,
    decimal: Mark | None = None,
) -> Layout:
    """Find the layout of a text file from its first rows."""
    comments, sample = _first_lines(path)
    if not sample:
        raise InputFileError(f"{path}: only comments and blank lines; export it again")
    first = sample[0][0]
    delimiter = _delimiter_of(path, [line for _, line in sample])
    rows = [split_line(path, number, line, delimiter) for number, line in sample]
    check_count(path, len(rows[0]), tables.MAX_COLUMNS, "columns")
    if has_header is not False and _has_row_names(rows):
        rows[0] = ["", *rows[0]]
    numbers = [number for number, _ in sample]
    check_lengths(path, zip(numbers, rows, strict=True), first, len(rows[0]), delimiter)
    written = list(zip(*rows, strict=True))
    units = tuple(unit_of_cells(column) for column in written)
    cells = [[bare(cell, own) for cell, own in zip(row, units, strict=True)] for row in rows]
    marks = marks_of(cells, delimiter if len(rows[0]) > 1 else "", decimal)
    # a word on top is a name, but for "VRB" in a first row of numbers
    is_row = any(kind_of(plain(cell, marks.decimal)) == "number" for cell in cells[0])
    classes = [
        tuple(
            kind_of(plain(cell, marks.decimal), is_top=row == 0 and not is_row)
            for row, cell in enumerate(column)
        )
        for column in zip(*cells, strict=True)
    ]
    header, header_line = None, None
    if has_header is None:
        has_header = _has_header(path, first, rows[0], classes, columns)
        if not has_header:
            header, header_line = _header_among(comments, len(rows[0]), delimiter)
    if has_header:
        header, header_line = tuple(cell.strip().strip('"').strip() for cell in rows[0]), first
        if len(rows) == 1:
            raise InputFileError(f"{path}: line {first} is a header and no row follows; add rows")
        classes = [column[1:] for column in classes]
    if header is None and path.suffix.lower() == ".ang" and len(classes) >= len(ANG_NAMES):
        more = (f"column{i}" for i in range(len(ANG_NAMES) + 1, len(classes) + 1))
        header = (*ANG_NAMES, *more)
    names = tuple(name or f"column{i}" for i, name in enumerate(header or [""] * len(classes), 1))
    numeric = _numeric(names, written, units, classes)
    spoiled = _spoiled(names, written, classes, numeric)
    return Layout(delimiter, header, header_line, names, numeric, units, spoiled, first, marks)


def _first_lines(path: Path) -> tuple[list[tuple[int, str]], list[tuple[int, str]]]:
    """Return the comments above the first rows, and these, with the numbers of their lines."""
    comments: list[tuple[int, str]] = []
    sample: list[tuple[int, str]] = []
    for number, line, is_comment in text_lines(path):
        if not is_comment:
            sample.append((number, line))
        elif not sample:
            comments.append((number, line))
        if len(sample) == SAMPLE:
            break
    return comments, sample


def _header_among(
    comments: Sequence[tuple[int, str]], width: int, delimiter: str
) -> tuple[tuple[str, ...] | None, int | None]:
    """Return the last comment that names as many columns, as numpy.savetxt writes it, and its line.

    >>> _header_among([(1, "# by me"), (2, "# lon, lat"), (3, "# 1, 2")], 2, ",")
    (('lon', 'lat'), 2)
    """
    for number, line in reversed(comments):
        text = re.sub(r"^\w+:\s+", "", line.strip().lstrip("#").strip())  # such as "Columns: "
        words = re.split(r"\s*[,;\t]\s*|\s+", text)
        cells = words if delimiter == " " else text.split(delimiter)
        if len(cells) != width:
            if not any(map(is_angle_named, words)):  # a sentence
                continue
            cells = words
        elif cells == words and _is_sentence(words):
            continue
        names = tuple(cell.strip().strip('"').strip() for cell in cells)
        is_named = all(kind_of(plain(name, "."), is_top=True) == "word" for name in names)
        if is_named and len(set(names)) == len(names) == width:
            return names, number
    return None, None


def _is_sentence(words: Sequence[str]) -> bool:
    """Return whether words name no angle or place, and one would have its column left out."""
    known = any(map(is_angle_named, words)) or bool(pairs_of(words))
    return not known and any(is_other_quantity(word) or is_count_named(word) for word in words)


def _numeric(
    names: Sequence[str],
    written: Sequence[Sequence[str]],
    units: Sequence[str | None],
    classes: Sequence[Sequence[str]],
) -> tuple[bool, ...]:
    """Return which columns hold numbers, or what is refused by cause where no other does.

    Compass words may be labels: they are numbers if the name is an angle's, or there are no others.
    """
    found = [c.count("number") >= max(1, c.count("word")) for c in classes]
    sure = [
        own and (unit != COMPASS or is_angle_named(name))
        for own, unit, name in zip(found, units, names, strict=True)
    ]
    if any(sure):
        return tuple(sure)
    return tuple(found) if any(found) else tuple(map(are_times, written))


def _spoiled(
    names: Sequence[str],
    written: Sequence[Sequence[str]],
    classes: Sequence[Sequence[str]],
    numeric: Sequence[bool],
) -> dict[str, str]:
    """Return the text columns that are called after angles and seem to be such, each with a cell."""
    found: dict[str, str] = {}
    for name, cells, kinds, is_number in zip(names, written, classes, numeric, strict=True):
        own = cells[len(cells) - len(kinds) :]
        if not is_number and is_angle_named(name) and 2 * sum(map(is_like_angle, own)) > len(own):
            words = [cell for cell, kind in zip(own, kinds, strict=True) if kind == "word"]
            found[name] = min(words, key=is_like_angle, default="")
    return found


def _delimiter_of(path: Path, lines: Sequence[str]) -> str:
    """Return the mark between cells that the file says, as Excel does, or else that its lines show."""
    _, top, _ = next(text_lines(path))
    said = SEPARATOR.fullmatch(top)
    return said[1] if said else _delimiter([with_minus(line) for line in lines])


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
        + "and its words above words; specify with {header} which it is, put a header line of names "
        "above it, or choose columns by the names in it with {columns}"
    )


def _delimiter(lines: list[str]) -> str:
    r"""Return the mark that splits all lines into as many cells, or else splits most of them.

    Marks that make numbers of all cells are first. The semicolon is tried before the comma, which may
    be a decimal one. It also stands for none, where a single column has decimal commas or units.

    >>> _delimiter(["lat;lon", "1,5;2"]), _delimiter(["1, 2", "3, 4"]), _delimiter(["1 2", "3\t4"])
    (';', ',', ' ')
    >>> _delimiter(["angle", "1.025,2", "998,7"]), _delimiter(["wind", "70.3 deg", "1.2 deg"])
    (';', ';')
    >>> _delimiter(["1,5 2", "3 4,25"]), _delimiter(["Direction (deg)", "10", "20.5"])
    (' ', ';')
    """
    # no second column of whole numbers has zeros in front
    lone = all(_LONE_COMMA.fullmatch(line.strip()) for line in lines)
    if lone and _LEADING_ZERO.search(",".join(lines)):
        return ";"
    words = lines[0].split()
    units = [UNITS.keys() >= {*words_of(word)} for word in words]
    several = len(words) > 1 and all(map(is_angle_named, words)) and not any(units)
    several = several or re.search(r"[;,|\t]", lines[0]) is not None
    even: list[str] = []
    for mark in "\t;|, \n":
        rows = [line.split(None if mark == " " else mark) for line in lines]
        if len(set(map(len, rows))) > 1 or (len(rows[0]) == 1) != (mark == "\n"):
            continue
        even.append(mark)
        if all(map(_is_value, (cell for row in rows[1:] or rows for cell in row))):
            if mark != "\n":
                return mark
            if not several:
                return ";"
    if even and even[0] in "\t;|,":
        return even[0]
    for mark in "\t;|,":
        if 2 * sum(mark in line for line in lines) > len(lines):
            return mark
    return " " if any(len(line.split()) > 1 for line in lines) else ","


def _is_value(cell: str) -> bool:
    """Return whether a cell is a number, with a unit or without, missing, or a time."""
    known = unit_of_cell(cell) is not None or is_time(cell)
    bared = cell.strip().strip('"')
    return known or any(kind_of(plain(bared, mark)) != "word" for mark in OTHER)


def _has_row_names(rows: Sequence[Sequence[str]]) -> bool:
    """Return whether a header lacks the name of the first column, the rows' names, as R writes it.

    >>> _has_row_names([["phi", "psi"], ["1", "60.5", "-45"], ["2", "61", "-44"]])
    True
    >>> _has_row_names([["phi", "psi"], ["60.5", "-45", "1"], ["60.5", "-44", "2"]])
    False
    """
    top, *rest = rows
    if {len(row) for row in rest} != {len(top) + 1}:
        return False
    if any(kind_of(cell.strip('"'), is_top=True) != "word" for cell in top):
        return False
    if not all("number" in map(kind_of, row[1:]) for row in rest):  # a number and its unit, perhaps
        return False
    names = [row[0] for row in rest]
    are_words = all(kind_of(name) == "word" or _WHOLE.fullmatch(name) for name in names)
    return are_words and len(set(names)) == len(names)
