"""The header of a text file, and the mark between its cells."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

from orbiflow.density.data import TableError
from orbiflow.density.tables.lines import is_missing_word, number_of
from orbiflow.errors import literal


def delimiter_of(lines: Sequence[str], decimal: str) -> str:
    r"""Return the mark that splits all lines into as many cells, or else splits most of them.

    A comma that stands before decimals is none, and a header may lack the name of the first column.

    >>> delimiter_of(["lat;lon", "1,5;2"], "."), delimiter_of(["1 2", "3\t4"], ".")
    (';', ' ')
    >>> delimiter_of(["1,5 2", "3 4,25"], ","), delimiter_of(["Direction (deg)", "10", "20.5"], ".")
    (' ', ',')
    """
    marks = [mark for mark in "\t;|," if mark != decimal]
    lines = [re.sub(r'"[^"]*"', "_", line) for line in lines]
    for mark in (*marks, " "):
        first, *others = (len(line.split(None if mark == " " else mark)) for line in lines)
        rest = set(others) or {first}
        if first > 1 and rest in ({first}, {first + 1}):
            return mark
    for mark in marks:
        if 2 * sum(mark in line for line in lines) > len(lines):
            return mark
    spaced = 2 * sum(len(line.split()) > 1 for line in lines) > len(lines)
    return " " if spaced else ";" if decimal == "," else ","


def _is_number(cell: str) -> bool:
    """Return whether a cell is a number with any mark before decimals, and so none of a header."""
    return not math.isnan(number_of(cell.strip().strip('"').replace(",", "."), "."))


def _is_word(cell: str) -> bool:
    return not is_missing_word(cell.strip('"')) and not _is_number(cell)


def is_header(
    path: Path,
    number: int,
    top: Sequence[str],
    rows: Sequence[Sequence[str]],
    wanted: Sequence[str],
    codes: Sequence[str],
) -> bool:
    """Return whether the first line names the columns; `codes` stand for missing values in rows."""
    words = [_is_word(cell) and cell.strip() not in codes for cell in top]
    if not any(words):
        return False
    if all(words) or not any(_is_number(cell) for cell in top):
        return True
    below = zip(*(row for row in rows if len(row) == len(top)), strict=True)
    for is_word, own in zip(words, below, strict=False):
        if is_word and any(_is_number(cell) for cell in own):
            return True
    # `Paris,48.9,2.4` above `Rome,41.9,12.5` is a row; `city,2019,2020` above it is a header
    names = {cell.strip().casefold() for cell in top}
    if wanted and all(name.casefold() in names for name in wanted):
        return True
    raise TableError(
        literal(
            f"{path}: line {number} may be a header or a row, as its numbers stand above numbers "
        )
        + "and its words above words; specify with {header} which it is, put a header line of names "
        "above it, or choose columns by the names in it with {columns}"
    )


def header_among(
    comments: Sequence[tuple[int, str]], width: int, delimiter: str
) -> tuple[tuple[str, ...] | None, int | None]:
    """Return the last comment that names as many columns, as numpy.savetxt writes it, and its line.

    >>> header_among([(1, "# by me"), (2, "# lon, lat"), (3, "# 1, 2")], 2, ",")
    (('lon', 'lat'), 2)
    """
    for number, line in reversed(comments):
        text = re.sub(r"^\w+:\s+", "", line.strip().lstrip("#").strip())  # such as "Columns: "
        words = re.split(r"\s*[,;\t]\s*|\s+", text)
        cells = words if delimiter == " " else text.split(delimiter)
        cells = words if len(cells) != width else cells
        names = tuple(cell.strip().strip('"').strip() for cell in cells)
        if len(set(names)) == len(names) == width and all(_is_word(n) for n in names):
            return names, number
    return None, None


def lacks_first_name(top: Sequence[str], rows: Sequence[Sequence[str]], delimiter: str) -> bool:
    """Return whether a header lacks the name of the first column, the rows' names, as R writes it."""
    if delimiter not in " \t" or {len(row) for row in rows} != {len(top) + 1}:
        return False
    if not all(_is_word(cell) for cell in top):
        return False
    names = [row[0] for row in rows]
    return len(set(names)) == len(names) and all(row[-1].strip() for row in rows)
