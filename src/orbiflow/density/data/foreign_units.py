"""Units of angles that names of columns say and that must be converted first, such as gon."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density.data.names import HOURS, foreign_unit, is_count_named, words_of
from orbiflow.density.data.units import TURN_TOLERANCE, TURNS
from orbiflow.errors import SettingError, literal

CURES = {
    "gon": "multiply by 0.9 for degrees",
    "arcminutes": "divide by 60 for degrees",
    "arcseconds": "divide by 3600 for degrees",
    "milliradians": "divide by 1000 for radians",
    "mils, 6400 to a turn": "multiply by 0.05625 for degrees",
    "cycles": "these are turns, give {unit} turns",
    "hours": "multiply by 15 for degrees",
}
"""What to do with angles in other units than those that are read."""

HOURS_PER_DAY = 24.0


def refuse_foreign_units(names: Sequence[str], values: Array, unit: str | None) -> None:
    """Refuse columns of angles (N, k) whose names say a unit that must be converted first.

    `unit` is the one that was given. Of hours and "grad", values may show that they were converted.
    """
    for name, column in zip(names, values.T, strict=True):
        most = float(np.nanmax(column, initial=0.0))
        least = float(np.nanmin(column, initial=0.0))
        if foreign := _unit_to_convert(name, least, most, unit):
            renamed = "" if foreign == "cycles" else ", and call the column otherwise"
            said = literal(f"{name!r} is in {foreign}, by its name: ")
            raise SettingError(said + CURES[foreign] + renamed)
        if "grad" in words_of(name) and unit is None:
            raise SettingError(
                literal(f"{name!r} is in degrees or in gon, by its name: ")
                + "give {unit} degrees, or multiply by 0.9 if they are gon"
            )


def _unit_to_convert(name: str, least: float, most: float, unit: str | None) -> str | None:
    words = set(words_of(name))
    if is_count_named(name):
        return None
    if "grad" in words and unit == "degrees" and 360 * (1 + TURN_TOLERANCE) < most <= 400:
        return "gon"
    if _says_hours(words):
        converted = unit in ("radians", "turns") and most <= TURNS[unit] * (1 + TURN_TOLERANCE)
        return "hours" if least >= 0 and most <= HOURS_PER_DAY and not converted else None
    found = foreign_unit(name)
    return None if found == "cycles" and unit == "turns" else found


def _says_hours(words: set[str]) -> bool:
    """Return whether words of a name say hours; an h alone may be a hue."""
    return bool(words & HOURS) and words != {"h"}
