"""Numbers as people write them in text: decimal commas, parted thousands, typographic minus signs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple

_MINUS = re.compile(r"[\u2010-\u2013\u2212\ufe63\uff0d](?=[\d.,])")
_SPACED = re.compile(r"[+-]?\d{1,3}(?:[\u00a0\u202f\u2009 '\u2019]\d{3})+(?:[.,]\d*)?")
_SPACES = re.compile(r"[\u00a0\u202f\u2009 '\u2019]")
_MISSING = frozenset(
    {"", "na", "n/a", "<na>", "nan", "null", "none", "-", "--", "#n/a", "#na", "#value!", "#null!"}
    | {"?", ".", "*", "\\n", "-1.#ind", "1.#qnan", "-nan", "nan(ind)", "-nan(ind)"}
)
_MISSING_WORDS = frozenset({"vrb", "mm", "m", "nil", "missing"})
"""Words that are missing values among numbers, and names on top of them."""

Mark = Literal[".", ","]
OTHER: dict[str, Mark] = {".": ",", ",": "."}


class Marks(NamedTuple):
    """How numbers are written.

    - `decimal`: The mark before decimals; the other one may part thousands.
    - `parted`: A number whose thousands are parted, if there is one.
    - `doubtful`: The columns, from 0, whose numbers may be a thousand times what they are, each with a
      number of them.
    - `is_asked`: Whether the user said which mark is before decimals.
    """

    decimal: Mark
    parted: str | None = None
    doubtful: tuple[tuple[int, str], ...] = ()
    is_asked: bool = False


def with_minus(text: str) -> str:
    """Return text with plain minus signs before numbers.

    >>> with_minus("\u22123,5")
    '-3,5'
    """
    return text if text.isascii() else _MINUS.sub("-", text)


def plain(cell: str, decimal: str) -> str:
    """Return a cell as Python writes a number, if it is one.

    >>> plain("1.025,2", ","), plain("1,025", "."), plain("48,2", "."), plain("1 025.5", ".")
    ('1025.2', '1025', '48,2', '1025.5')
    """
    cell = cell.strip()
    if cell.casefold() in _MISSING:
        return cell
    if (not cell.isascii() or " " in cell or "'" in cell) and _SPACED.fullmatch(cell):
        cell = _SPACES.sub("", cell)
    other = OTHER[decimal]
    if other in cell:
        if not _parted(other).fullmatch(cell):
            return cell if decimal == "." else cell.replace(".", "?")
        cell = cell.replace(other, "")
    return cell.replace(decimal, ".")


def kind_of(cell: str, *, is_top: bool = False) -> Literal["missing", "number", "word"]:
    """Return what a cell is that `plain` returned; one on top of a column may be its name.

    >>> kind_of("M"), kind_of("M", is_top=True)
    ('missing', 'word')
    """
    word = cell.strip().casefold()
    if word in _MISSING or (word in _MISSING_WORDS and not is_top):
        return "missing"
    try:
        float(cell)
    except ValueError:
        return "word"
    return "word" if "_" in cell else "number"


def marks_of(rows: Sequence[Sequence[str]], delimiter: str, asked: Mark | None) -> Marks:
    """Return how the numbers of rows of cells are written, by the evidence of all of them.

    >>> marks_of([["1.025,2", "7"]], ";", None).decimal, marks_of([["1,025.2"]], ",", None).decimal
    (',', '.')
    >>> marks_of([["1,025"], ["1,100"]], ",", None).doubtful
    ((0, '1,025'),)
    >>> marks_of([["1.025"], ["1.100"], ["998"]], ";", None).doubtful
    ((0, '1.025'),)
    """
    cells = [cell.strip() for row in rows for cell in row]
    comma, point = (_evidence(cells, mark) for mark in (",", "."))
    decimals = {",": comma.decimal or point.parted, ".": point.decimal or comma.parted}
    parted = {".": comma.parted or comma.either, ",": point.parted or point.either}
    if asked is not None:
        return Marks(asked, parted[asked], is_asked=True)
    if decimals[","] and not decimals["."]:
        return Marks(",", parted[","])
    if decimals["."] and not decimals[","]:
        return Marks(".", parted["."])
    if not comma.either:
        return Marks(".", None, _like_thousands(rows))
    if delimiter == ";" and not point.either and not decimals["."]:
        return Marks(",")  # it parts cells because commas are in them
    doubtful: list[tuple[int, str]] = []
    for k, column in enumerate(zip(*rows, strict=False)):
        own = [cell.strip() for cell in column]
        cell = _evidence(own, ",").either
        if cell is not None and (decimals["."] or not _leaves_whole(own)):
            doubtful.append((k, cell))
    return Marks(".", comma.either, tuple(doubtful))


def _like_thousands(rows: Sequence[Sequence[str]]) -> tuple[tuple[int, str], ...]:
    """Return the columns whose points seem to part thousands, though decimals have points as a rule."""
    found: list[tuple[int, str]] = []
    for k, column in enumerate(zip(*rows, strict=False)):
        own = [cell.strip() for cell in column]
        points = [cell for cell in own if _PARTED["."].fullmatch(cell)]
        others = [cell for cell in own if cell not in points and any(c.isdigit() for c in cell)]
        zeros = any(cell.endswith("0") for cell in points)
        if zeros and others and all(cell.isdigit() and len(cell) > 1 for cell in others):
            found.append((k, points[0]))
    return tuple(found)


class _Evidence(NamedTuple):
    """A cell in which a mark is before decimals, one in which it parts thousands, one of either."""

    decimal: str | None
    parted: str | None
    either: str | None


def _parted(mark: str) -> re.Pattern[str]:
    return _PARTED[mark]


_PARTED = {
    mark: re.compile(rf"[+-]?[1-9]\d{{0,2}}(?:\{mark}\d{{3}})+(?:\{other}\d*)?")
    for mark, other in OTHER.items()
}
_DECIMAL = {
    mark: re.compile(rf"[+-]?(?:\d+\{mark}\d*|\{mark}\d+)(?:e[+-]?\d+)?", re.IGNORECASE)
    for mark in OTHER
}


def _evidence(cells: Iterable[str], mark: str) -> _Evidence:
    found: dict[str, str] = {}
    for cell in cells:
        if mark not in cell:
            continue
        if _PARTED[mark].fullmatch(cell):
            sure = cell.count(mark) > 1 or OTHER[mark] in cell
            found.setdefault("parted" if sure else "either", cell)
        elif _DECIMAL[mark].fullmatch(cell):
            found.setdefault("decimal", cell)
    return _Evidence(*(found.get(name) for name in _Evidence._fields))


def _leaves_whole(column: Sequence[str]) -> bool:
    """Return whether commas part thousands in a column: numbers below have none, and zeros are kept.

    Decimals would have commas everywhere, or else no zeros at their ends.

    >>> _leaves_whole(["998", "1,025", "1,100"]), _leaves_whole(["1,025", "1,100"])
    (True, False)
    """
    whole = [cell for cell in column if cell.isascii() and cell.isdigit() and len(cell) > 1]
    zeros = any(cell.endswith("0") for cell in column if "," in cell)
    return bool(whole) and (zeros or 10 * len(whole) >= len(column))
