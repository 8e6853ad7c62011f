"""How cells are written: numbers with their marks, angles with a unit, compass words, times of day."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple

from orbiflow.density.data import UNITS

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
        if not _PARTED[other].fullmatch(cell):
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


COMPASS = "compass"
"""The unit of words such as NNE: bearings in degrees, north 0 and clockwise."""

_POINTS = "N,NNE,NE,ENE,E,ESE,SE,SSE,S,SSW,SW,WSW,W,WNW,NW,NNW"
_DEGREES = {point: f"{22.5 * k:g}" for k, point in enumerate(_POINTS.split(","))}
_CALM = frozenset({"CALM", "VRB", "VAR", "VARIABLE"})
"""Words for winds without a direction."""

_LONG = {"NORTH": "N", "EAST": "E", "SOUTH": "S", "WEST": "W"}

_WITH_UNIT = re.compile(r"([+-]?[\d.,](?:[^A-Za-z°]*[\d.])?(?:[eE][+-]?\d+)?)\s*([A-Za-z]+|°)\.?")
_RINGS = str.maketrans("º˚", "°°")
"""Signs that look like that of degrees."""

_TIME = re.compile(
    r"[+-]?\d{1,3}(:\d{2}(:\d{2}([.,]\d+)?)?\s*([AaPp][Mm])?|h\s*\d{1,2}m?(\s*\d{1,2}([.,]\d+)?s)?)"
)


def unit_of_cells(cells: Sequence[str]) -> str | None:
    """Return the unit that cells of a column write, `COMPASS` if they are compass words, or None.

    The first may be a name. Hemispheres, which are N or S alone, or E or W, are no compass words.

    >>> unit_of_cells(["phi", "70.3 deg", "-12.5 deg"]), unit_of_cells(["70.3", "1.2 rad"])
    ('degrees', 'radians')
    >>> unit_of_cells(["wind", "NNE", "s"]), unit_of_cells(["side", "N", "S"])
    ('compass', None)
    """
    found = next((unit for cell in cells if (unit := unit_of_cell(cell))), None)
    if found is not None:
        return found
    points = {_point(cell) for cell in cells[1:] if kind_of(bare(cell, COMPASS)) != "missing"}
    is_compass = points <= _DEGREES.keys() and not (points <= {"N", "S"} or points <= {"E", "W"})
    return COMPASS if is_compass else None


def unit_of_cell(cell: str) -> str | None:
    """Return the unit of angles after the number in a cell, or None.

    >>> unit_of_cell("70.3°"), unit_of_cell("1.2e-3 rad"), unit_of_cell("70.3"), unit_of_cell("3 km")
    ('degrees', 'radians', None, None)
    """
    found = _parted(cell)
    return UNITS.get(found[2].casefold()) if found else None


def bare(cell: str, unit: str | None) -> str:
    """Return the number in a cell of a column of this unit, or the cell if it is written otherwise.

    >>> bare("70,3 deg", "degrees"), bare("NNE", "compass"), bare("70.3", None)
    ('70,3', '22.5', '70.3')
    """
    if unit is None:
        return cell
    if unit == COMPASS:
        point = _point(cell)
        return "" if point in _CALM else _DEGREES.get(point, cell)
    found = _parted(cell)
    return found[1].rstrip() if found else cell


def is_like_angle(cell: str) -> bool:
    """Return whether a cell that is no number may be meant as an angle: one with digits, or a word."""
    return any(letter.isdigit() for letter in cell) or _point(cell) in _DEGREES


def is_time(cell: str) -> bool:
    """Return whether a cell is a time of day or in sixties, such as 05:12 or 5h12m33s."""
    return _TIME.fullmatch(cell.strip()) is not None


def are_times(cells: Sequence[str]) -> bool:
    """Return whether all cells of a column are times of day but the first, which may be a name."""
    words = [cell for cell in cells[1:] if kind_of(cell) != "missing"]
    return bool(words) and all(map(is_time, words))


def _parted(cell: str) -> re.Match[str] | None:
    """Return a number and the letters after it."""
    found = _WITH_UNIT.fullmatch(cell.strip().translate(_RINGS))
    is_number = found and any(kind_of(plain(found[1], mark)) == "number" for mark in OTHER)
    return found if is_number else None


def _point(cell: str) -> str:
    word = re.sub(r"[\s_-]", "", cell.upper())
    return re.sub("|".join(_LONG), lambda found: _LONG[found[0]], word)
