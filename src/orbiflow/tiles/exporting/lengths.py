"""Lengths and sizes as people write them: 40mm, 4 cm, 1.5in, 300x200mm."""

from __future__ import annotations

import math
import re

from orbiflow.drawing import COLUMNS, Sheet
from orbiflow.errors import OrbiflowError

MILLIMETRES = {"mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72}
"""Of each unit."""

MOST = 100_000.0
"""Longest length that is taken, in mm: beyond it is a slip."""

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?"
_UNIT = r"[a-z\"'µ]*"


def length(text: str, *, zero: bool = False) -> float:
    """`text` in mm.

    Args:
        text: a number and one of mm, cm, in, pt.
        zero: whether 0 is a length, too; it needs no unit.

    Raises:
        OrbiflowError: for a number without unit, another unit, or one that is too small or large.

    >>> length("4 cm"), length("1in"), length("0", zero=True)
    (40.0, 25.4, 0.0)
    """
    found = re.fullmatch(rf"\s*({_NUMBER})\s*({_UNIT})\s*", text, flags=re.IGNORECASE)
    if not found:
        raise OrbiflowError(f"{text!r} is no length; write a number and its unit, such as 40mm")
    number, unit = float(found[1]), found[2].lower()
    if zero and number == 0 and not unit:
        return 0.0
    return _checked(number * _unit(unit, found[1], text), text, zero=zero)


def size(text: str) -> tuple[float, float]:
    """Width and height in mm of `text`, such as 300x200mm, 30cm x 200mm or 12x8 in.

    Raises:
        OrbiflowError: as `length`.

    >>> size("300x200mm"), size("1in × 5 cm")
    ((300.0, 200.0), (25.4, 50.0))
    """
    pattern = rf"\s*({_NUMBER})\s*({_UNIT})\s*[x×]\s*({_NUMBER})\s*({_UNIT})\s*"
    found = re.fullmatch(pattern, text, flags=re.IGNORECASE)
    if not found:
        raise OrbiflowError(
            f"{text!r} is no width and height; write both and their unit, such as 300x200mm"
        )
    last = found[4].lower()
    first = found[2].lower() or last
    numbers = f"{found[1]}x{found[3]}"
    width = float(found[1]) * _unit(first, numbers, text)
    height = float(found[3]) * _unit(last, numbers, text)
    return _checked(width, text, zero=False), _checked(height, text, zero=False)


def pixels(text: str, dpi: float, *, zero: bool = False) -> float:
    """`text` in pixels: a number of them, or a length at `dpi` pixels an inch.

    Raises:
        OrbiflowError: as `length`.

    >>> pixels("400", 300), pixels("1.5px", 300), pixels("25.4mm", 300)
    (400.0, 1.5, 300.0)
    """
    found = re.fullmatch(rf"\s*({_NUMBER})\s*(px)?\s*", text, flags=re.IGNORECASE)
    if found is None:
        return length(text, zero=zero) * dpi / MILLIMETRES["in"]
    return _checked(float(found[1]), text, zero=zero)


def pixel_size(text: str, dpi: float) -> tuple[int, int]:
    """Width and height of a picture in whole pixels, such as 3000x2000 or 300x200mm.

    Raises:
        OrbiflowError: as `size`.

    >>> pixel_size("3000x2000", 300), pixel_size("1x2in", 100)
    ((3000, 2000), (100, 200))
    """
    whole = re.fullmatch(r"\s*(\d{1,9})\s*(?:px)?\s*[x×]\s*(\d{1,9})\s*(?:px)?\s*", text)
    if whole:
        return int(whole[1]), int(whole[2])
    if not re.search("[a-wyz]", text, flags=re.IGNORECASE):
        raise OrbiflowError(f"{text!r} is no size in pixels; write two whole numbers, as 3000x2000")
    width, height = size(text)
    per = dpi / MILLIMETRES["in"]
    return max(1, round(width * per)), max(1, round(height * per))


def column_width(text: str) -> str | float:
    """The width of a printed figure: a word of `orbiflow.figures.sheet.COLUMNS`, or mm.

    Raises:
        OrbiflowError: as `length`, and for a width that no figure has.

    >>> column_width("double"), column_width("8.5cm")
    ('double', 85.0)
    """
    word = text.strip().lower()
    width = word if word in COLUMNS else length(text)
    Sheet.column(width)
    return width


def page_size(text: str) -> tuple[float, float]:
    """As `size`; a journal's "single" or "double" column is two thirds as high as wide.

    Raises:
        OrbiflowError: as `size`.

    >>> page_size("double"), page_size("3x2cm")
    ((180.0, 120.0), (30.0, 20.0))
    """
    width = COLUMNS.get(text.strip().lower())
    return size(text) if width is None else (width, round(width / 1.5, 1))


def _unit(unit: str, number: str, text: str) -> float:
    if not unit:
        raise OrbiflowError(f"{text!r} has no unit; write {number}mm, {number}cm or {number}in")
    if unit not in MILLIMETRES:
        raise OrbiflowError(
            f"{text!r}: {unit!r} is no unit that is known here; there are {', '.join(MILLIMETRES)}"
        )
    return MILLIMETRES[unit]


def _checked(value: float, text: str, *, zero: bool) -> float:
    if not math.isfinite(value) or value > MOST:
        raise OrbiflowError(f"{text!r} is longer than 100 m; check number and unit")
    if value < 0 or (value == 0 and not zero):
        bound = "at least 0" if zero else "above 0"
        raise OrbiflowError(f"{text!r} must be {bound}")
    return value
