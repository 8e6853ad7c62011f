"""Lines of text files, their cells, and the numbers that these are."""

from __future__ import annotations

import codecs
import csv
import math
import re
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path

from orbiflow.density.data import short
from orbiflow.errors import InputFileError

MAX_LINE = 2**20
"""Characters of a line at most."""

MISSING = (
    "", "NA", "N/A", "<NA>", "NaN", "null", "none", "-", "--", "#N/A", "#NA", "#VALUE!", "#NULL!",
    "#DIV/0!", "#REF!", "#NAME?", "#NUM!", "?", ".", "*", "\\N", "-1.#IND", "1.#QNAN", "-nan",
)  # fmt: skip
"""What stands for a missing value in any table, whatever its case."""

_MISSING = frozenset(word.casefold() for word in MISSING)
_UNDECODED = re.compile("[\udc80-\udcff]")
_MINUS = re.compile(r"[\u2010-\u2013\u2212\ufe63\uff0d](?=[\d.,])")
_SPACED = re.compile(r'"[^"]*"(?=\s|$)|\S+')
"""Cells between spaces, which may be quoted."""

_OPEN = re.compile(r'"$|".*[^"]$')
"""A cell that begins with a quotation mark and does not end with one."""

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


def is_missing_word(text: str) -> bool:
    """Return whether a cell stands for a missing value in any table.

    >>> is_missing_word(" n/a"), is_missing_word("0")
    (True, False)
    """
    return text.strip().casefold() in _MISSING


def text_lines(path: Path) -> Iterator[tuple[int, str, bool]]:
    """Yield the number and text of every line that is not blank, and whether it is a comment.

    Excel's first line "sep=;" counts as one.
    """
    try:
        with path.open("rb") as file:
            encoding = "utf-16" if is_utf16(file.read(4)) else "utf-8-sig"
        with path.open(encoding=encoding, errors="surrogateescape") as file:
            for number, line in enumerate(iter(partial(file.readline, MAX_LINE), ""), start=1):
                if not line.isascii() and _UNDECODED.search(line):
                    raise InputFileError(
                        f"{path}: line {number}: not UTF-8 text; save the file as UTF-8"
                    )
                if "\0" in line:
                    raise InputFileError(
                        f"{path}: line {number}: a null byte, which no text has; the file is binary "
                        "or damaged: save it as CSV in UTF-8"
                    )
                if len(line) == MAX_LINE and line[-1] != "\n":
                    raise InputFileError(
                        f"{path}: line {number} is longer than {MAX_LINE} characters; this is not "
                        "a table of numbers, or its line ends are lost"
                    )
                if text := line.strip():
                    is_comment = text[0] == "#" and not is_missing_word(
                        re.split(r"[\s,;]", text, maxsplit=1)[0]
                    )
                    said = number == 1 and SEPARATOR.fullmatch(line.rstrip("\r\n"))
                    yield number, line.rstrip("\n"), bool(is_comment or said)
    except UnicodeError as exc:
        raise InputFileError(f"{path}: not UTF-16 text, as it begins; save it as UTF-8") from exc
    except OSError as exc:
        raise InputFileError(f"{path}: cannot be read ({exc.strerror}); check it") from exc


def split_line(path: Path, number: int, line: str, delimiter: str) -> list[str]:
    """Return the cells of a line."""
    if delimiter == " ":
        cells = _SPACED.findall(line) if '"' in line else line.split()
        if not any(_OPEN.match(cell) for cell in cells):
            return [cell.strip('"') for cell in cells]
    elif '"' not in line:
        return line.split(delimiter)
    else:
        with suppress(csv.Error):
            return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True, strict=True))
    raise InputFileError(
        f"{path}: line {number}: {short(line)!r} has a quotation mark without its pair, or too long a "
        "cell; a quoted cell must end on its line, before the next cell"
    )


def number_of(cell: str, decimal: str) -> float:
    """Return the number that a cell is, NaN of words.

    >>> number_of("-1,5", ","), number_of("1.500", ","), number_of("1_000", ".")
    (-1.5, nan, nan)
    """
    if decimal == ",":
        cell = "" if "." in cell else cell.replace(",", ".")
    try:
        return math.nan if "_" in cell else float(cell)
    except ValueError:
        return math.nan
