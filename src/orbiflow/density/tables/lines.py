"""The lines of a text file and their cells."""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from orbiflow.density.tables.numerals import with_minus
from orbiflow.density.tables.table import quote
from orbiflow.errors import InputFileError

MAX_LINE = 2**20
"""Characters of a line at most."""

_UNDECODED = re.compile("[\udc80-\udcff]")
# what spreadsheets write in a cell without a value, which begins no comment
_SHEET_ERROR = re.compile(r"#(?:N/?A|NULL!|DIV/0!|VALUE!|REF!|NAME\?|NUM!)", re.IGNORECASE)
_SPACED = re.compile(r'"[^"]*"(?=\s|$)|\S+')
"""Cells between spaces, which may be quoted."""

SEPARATOR = re.compile(r'"?sep=(.)"?', re.IGNORECASE)
"""Excel's first line, which says what separates cells."""


def is_utf16(head: bytes) -> bool:
    """Return whether a file's first bytes are the byte-order mark of UTF-16, and not of UTF-32."""
    return head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) and head[2:4] != b"\0\0"


def encoding_of(path: Path) -> str:
    """Return the encoding of a text file: UTF-16 if it has its byte-order mark, or else UTF-8."""
    with path.open("rb") as file:
        return "utf-16" if is_utf16(file.read(4)) else "utf-8-sig"


def text_lines(path: Path) -> Iterator[tuple[int, str, bool]]:
    """Yield the number and text of every line that is not blank, and whether it is a comment.

    Excel's first line "sep=;" counts as one.
    """
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
                if text:
                    is_comment = (text[0] == "#" and not _SHEET_ERROR.match(text)) or (
                        number == 1 and SEPARATOR.fullmatch(line.rstrip("\r\n"))
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


def check_length(
    path: Path, number: int, row: list[str], first: int, expected: int, delimiter: str
) -> None:
    """Check that a row has as many cells as the first line."""
    if (n := len(row)) != expected:
        spaced = "; a name with a space in it counts as two" if delimiter == " " else ""
        raise InputFileError(
            f"{path}: line {number} has {n} cell{'s' * (n != 1)} and line {first} has {expected}; "
            f"give every line as many{spaced}"
        )
