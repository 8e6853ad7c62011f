"""Units of angles: what names of columns say of them, and which spaces have data with one."""

from __future__ import annotations

import math
import re
from typing import Literal, get_args

from orbiflow.errors import SettingError, literal

Unit = Literal["radians", "degrees", "turns"]
TURNS: dict[str, float] = {"radians": 2 * math.pi, "degrees": 360.0, "turns": 1.0}

TURN_TOLERANCE = 1e-4
"""Share by which rounding may take an angle beyond a turn: 6.2832 is 2 pi."""

DIRECTIONS = ("sphere", "projective-plane")
ROTATIONS = "rotation-space"
ANGULAR = ("torus", "klein-bottle")
VECTORS = (*DIRECTIONS, "hypersphere", "projective-space")

UNITS = {
    **dict.fromkeys(("deg", "degs", "degree", "degrees", "°"), "degrees"),
    **dict.fromkeys(("rad", "rads", "radian", "radians"), "radians"),
    **dict.fromkeys(("turn", "turns"), "turns"),
}
"""Words for units of angles."""

FOREIGN = {
    **dict.fromkeys(("gon", "gons", "grads", "gradian", "gradians"), 400.0),
    **dict.fromkeys(("arcmin", "arcmins", "arcminute", "arcminutes"), 21_600.0),
    **dict.fromkeys(("arcsec", "arcsecs", "arcsecond", "arcseconds"), 1_296_000.0),
    **dict.fromkeys(("mrad", "mrads", "milliradian", "milliradians"), 2000 * math.pi),
    **dict.fromkeys(("mil", "mils"), 6400.0),
    **dict.fromkeys(("cycles", "rev", "revs"), 1.0),
    **dict.fromkeys(("hour", "hours", "hr", "hrs", "hms"), 24.0),
}
"""Other units by the words of names, and a turn in each: such a column is declared as a cycle."""

_PARTS = {"10s": 36.0, "10": 36.0, "tens": 36.0, "tenths": 3600.0, "hundredths": 36_000.0}
_SCALED = re.compile(rf"\b({'|'.join(_PARTS)})\b\W*(of\b)?\W*(deg|°)", re.IGNORECASE)
"""Degrees that are counted in tens or in tenths, as in "Wind Dir (10s deg)", and a turn in each."""

_TOKEN = re.compile(r"°|[A-Z]+(?![a-zß-ÿ])|[A-Z]?[^\W\d_A-Z]+|\d+")
_RUN_TOGETHER = re.compile(r"(?<=[A-Z])(?=(?:deg|rad|hms|dms)$)")


def words_of(name: str) -> list[str]:
    """Return the words of a name in lower case, apart where it is underscored or in camel case.

    >>> words_of("decimalLatitude"), words_of("pole_lat"), words_of("RAdeg"), words_of("wind dir (°)")
    (['decimal', 'latitude'], ['pole', 'lat'], ['ra', 'deg'], ['wind', 'dir', '°'])
    >>> words_of("Right Ascension"), words_of("dipDirection")
    (['ra'], ['dipdir'])
    """
    text = " ".join(_TOKEN.findall(_RUN_TOGETHER.sub(" ", name))).casefold()
    text = re.sub(r"\bright ascension\b", "ra", text)
    return re.sub(r"\bdip (dir|direction|azimuth|azi|az)\b", "dipdir", text).split()


def unit_named(name: str) -> str | None:
    """Return the unit of angles in which a name ends, or None.

    >>> unit_named("phi (deg)"), unit_named("lat_rad"), unit_named("radius"), unit_named("turn_angle")
    ('degrees', 'radians', None, None)
    """
    words = words_of(name)
    return UNITS.get(words[-1]) if words and not _SCALED.search(name) else None


def foreign_unit(name: str) -> float | None:
    """Return a turn in the unit that a name ends in, where that is none of `UNITS`, or None.

    >>> foreign_unit("azimuth [gon]"), foreign_unit("ra_hours"), foreign_unit("hour")
    (400.0, 24.0, None)
    >>> foreign_unit("Wind Dir (10s deg)"), foreign_unit("heading (tenths of degrees)")
    (36.0, 3600.0)
    """
    if scaled := _SCALED.search(name):
        return _PARTS[scaled[1].lower()]
    words = words_of(name)
    return FOREIGN.get(words[-1]) if len(words) > 1 else None


def is_angular(space: str, columns: int, form: str | None = None) -> bool:
    """Return whether data of so many columns are angles, which have a unit.

    `form` says how rotations are written: Rodrigues' vectors are no angles.
    """
    return space in ANGULAR or (space == ROTATIONS and columns == 3 and form != "rodrigues")


def check_unit(space: str, unit: str | None) -> None:
    """Refuse a unit that there is not, and one of data that are not angles.

    >>> check_unit("sphere", "radians")
    Traceback (most recent call last):
    ...
    orbiflow.errors.SettingError: unit radians applies only to angles: latitude and longitude are \
degrees; convert them, or give unit vectors x,y,z
    """
    if unit is not None and unit not in get_args(Unit):
        raise SettingError(f"{{unit}} must be degrees, radians or turns, got {literal(repr(unit))}")
    if unit is not None and space not in (*ANGULAR, ROTATIONS, *VECTORS):
        raise SettingError(
            "{unit} applies only to angles: points of a quotient are in that of its cell; leave it out"
        )
    if space in VECTORS and unit in ("radians", "turns"):
        raise SettingError(
            f"{{unit}} {unit} applies only to angles: latitude and longitude are degrees; convert "
            "them, or give unit vectors x,y,z"
        )


def number_of(text: str, decimal: str = ".") -> float:
    """Return the number that a text is, NaN of words.

    >>> number_of("-1,5", ","), number_of("1.500", ","), number_of("1_000")
    (-1.5, nan, nan)
    """
    if decimal == ",":
        text = "" if "." in text else text.replace(",", ".")
    try:
        return math.nan if "_" in text else float(text)
    except ValueError:
        return math.nan
