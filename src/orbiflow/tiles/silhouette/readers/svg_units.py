"""Numbers, lengths and angles as SVG and CSS write them."""

import math
import re

PIXELS_PER_INCH = 96
MAX_NUMBER = 1e9  # the largest width or opacity that is believed
FONT_SIZE = 16.0  # pixels, where nothing else is said
_PIXELS = {
    **{"": 1.0, "px": 1.0, "pt": 4 / 3, "pc": 16.0, "in": 96.0},
    **{"cm": 96 / 2.54, "mm": 96 / 25.4, "q": 96 / 101.6},
}
_TURNS = {"": 1 / 360, "deg": 1 / 360, "grad": 1 / 400, "rad": 1 / math.tau, "turn": 1.0}
_FONT_UNITS = {"em": 1.0, "ex": 0.5, "ch": 0.5, "rem": 1.0}  # sizes of the font
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?"
_QUANTITY = re.compile(rf"\s*({NUMBER})\s?([a-z]*|%)\s*", re.IGNORECASE)
_IN_FONTS = re.compile(rf"(?<![\w.#-])({NUMBER})(em|ex|ch|rem)(?![\w-])", re.IGNORECASE)
_MAX_TEXT = 100  # characters of a quantity
_SIZES = {
    **{"xx-small": 9.0, "x-small": 10.0, "small": 13.0, "medium": 16.0},
    **{"large": 18.0, "x-large": 24.0, "xx-large": 32.0, "xxx-large": 48.0},
}


def quantity(text: str | None) -> tuple[float, str] | None:
    """Return the number and the unit, in small letters, of "12px", or None for anything else."""
    found = _QUANTITY.fullmatch(text) if text and len(text) <= _MAX_TEXT else None
    if found is None or (text and " " in text.strip()):
        return None
    return float(found[1]), found[2].lower()


def length(text: str | None, relative: float = 1.0) -> float | None:
    """Return a length in user units, percentages those of `relative`; None for what is none."""
    found = quantity(text)
    if found is None:
        return None
    number, unit = found
    if unit == "%":
        return number / 100 * relative
    return number * _PIXELS[unit] if unit in _PIXELS else None


def as_number(text: str | None, usual: float, relative: float = 1.0) -> float:
    """Read a length in user units or a share; return the usual one if it cannot be read."""
    value = length(text, relative)
    return usual if value is None or not abs(value) < MAX_NUMBER else value


def angle(text: str | None) -> float | None:
    """Return an angle in radians, in degrees where no unit is written; None for what is none."""
    found = quantity(text)
    if found is None or found[1] not in _TURNS:
        return None
    return found[0] * _TURNS[found[1]] * math.tau


def without_font_units(text: str, em: float, rem: float) -> str:
    """Return a text whose lengths in `em`, `ex`, `ch` and `rem` are in user units instead."""

    def user_units(found: re.Match[str]) -> str:
        unit = found[2].lower()
        value = float(found[1]) * _FONT_UNITS[unit] * (rem if unit == "rem" else em)
        return f"{value!r}px"

    return _IN_FONTS.sub(user_units, text)


def font_size(text: str, parent: float, rem: float) -> float:
    """Return a font's size in user units from the property, and from the size around it."""
    text = text.strip().lower()
    if text in _SIZES:
        return _SIZES[text]
    if text in ("larger", "smaller"):
        return parent * (1.2 if text == "larger" else 1 / 1.2)
    return as_number(without_font_units(text, parent, rem), parent, parent)
