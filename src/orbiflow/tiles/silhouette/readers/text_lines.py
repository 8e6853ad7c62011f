"""Lines of text and their cells, as lists and tables of points have them."""

import re
from typing import NamedTuple

from orbiflow.errors import InputFileError
from orbiflow.tiles.silhouette.readers.reading import Source, read_bytes

MAX_BYTES = 16 * 2**20
_NUMBER = re.compile(r"[+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d+)?")


class Line(NamedTuple):
    """A line that is neither blank nor a comment."""

    number: int  # in the file, from 1
    text: str
    run: int  # how many times blank lines came before it


def lines_of(path: Source) -> list[Line]:
    """Return lines that are neither blank nor comments."""
    try:
        text = read_bytes(path, MAX_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as exc:
        raise InputFileError(
            f"{path}: not a text file (byte {exc.start} is not UTF-8); a list of points is one"
        ) from exc
    lines: list[Line] = []
    run = after_blank = 0
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip():
            after_blank = 1
        elif not line.lstrip().startswith("#"):
            run += after_blank if lines else 0
            after_blank = 0
            lines.append(Line(number, line, run))
    if not lines:
        raise InputFileError(f"{path}: the file holds only blank lines; export it again")
    return lines


def cells_of(text: str) -> list[str]:
    """Return the cells of a line: parted by semicolons, tabs, commas or blanks, the first that it has.

    Where blanks part them, every number may have a decimal comma.
    """
    text = text.strip()
    for separator in (";", "\t"):
        if separator in text:
            return [cell.strip() for cell in text.rstrip(separator).split(separator)]
    words = text.split()
    if len(words) > 1 and all(re.fullmatch(r"[+-]?\d+,\d+", word) for word in words):
        return words
    if "," in text:
        return [cell.strip() for cell in text.rstrip(",").split(",")]
    return words


def value_of(cell: str) -> float | None:
    """Return the number that a cell holds, perhaps in quotes or with a decimal comma, or None."""
    cell = cell.strip().strip('"').replace("\u2212", "-")
    if not _NUMBER.fullmatch(cell):
        return None
    return float(cell.replace(",", "."))
