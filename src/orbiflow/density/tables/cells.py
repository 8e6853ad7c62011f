"""Angles that a cell writes with a unit or as a compass word, and times of day, which are none."""

from __future__ import annotations

import re
from collections.abc import Sequence

from orbiflow.density.data import UNITS
from orbiflow.density.tables.numerals import OTHER, kind_of, plain

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
