"""What the values of columns say: codes, other units, radians among degrees, fractions of cells."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import cast

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density.data.column_names import (
    AZIMUTHS,
    FROM_VERTICAL,
    HOURS,
    LATITUDES,
    foreign_unit,
    is_count_named,
    is_other_quantity,
    pairs_of,
    unit_named,
    words_of,
)
from orbiflow.density.data.columns import (
    DIRECTIONS,
    ROTATIONS,
    Arrangement,
    check_columns,
    rotation_form,
)
from orbiflow.density.data.doubts import (
    FEW_ROWS,
    FULL_SHARE_OF_TURN,
    Doubt,
    doubts_of_angle,
    doubts_of_torus,
    is_identifier,
    place_doubts,
    refuse_codes,
)
from orbiflow.density.data.units import TURN_TOLERANCE, TURNS, Unit, check_unit, is_angular
from orbiflow.errors import DataWarning, SettingError, literal

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

FOUR_PI_TOLERANCE = 1e-3
"""How far from 4 pi is what .ang files write where there is no orientation."""


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
    if words & HOURS and words != {"h"}:  # alone it may be a hue
        converted = unit in ("radians", "turns") and most <= TURNS[unit] * (1 + TURN_TOLERANCE)
        return "hours" if least >= 0 and most <= HOURS_PER_DAY and not converted else None
    found = foreign_unit(name)
    return None if found == "cycles" and unit == "turns" else found


def check_values(
    space: str,
    values: Array,
    names: Sequence[str] | None,
    unit: str | None,
    cure: str,
    form: str | None = None,
) -> tuple[Unit, list[Doubt]]:
    """Return the unit of data (N, k), and doubts; NaN are missing values.

    Args:
        space: The name of the space, or of a group.
        values: The data.
        names: Names of their columns, if they have names.
        unit: The unit that was given, if one was.
        cure: What to do with codes for missing values, after "...: ".
        form: How rotations are written, if it was said.

    Raises:
        SettingError: For a unit that does not apply or is not known, columns in another order than the
            space's, codes for missing values among angles, radians in the place of degrees, and
            rotations of which nothing says how they are written.
    """
    check_unit(space, unit)
    called = list(names) if names else [f"column{k}" for k in range(1, values.shape[1] + 1)]
    found = check_columns(space, names) if names else None
    doubts = [Doubt(found.note, False)] if found and found.note else []
    doubts += _doubts_of_names(space, values, called, found if form is None else found or _SAID)
    doubts += _doubts_of_identifiers(space, values, called)
    if space in ROTATIONS:
        form = rotation_form(space, names, values.shape[1], form)
        doubts += _unindexed(values) if form == "ZXZ" else []
    if is_angular(space, values.shape[1], form):
        own, more = _angles(space, values, called, unit, cure)
        return own, doubts + more
    refuse_codes(space, values, called, "degrees", cure)
    if space in DIRECTIONS and values.shape[1] == 2:
        doubts += place_doubts(space, values, called, unit)
    return "radians", doubts


_SAID = Arrangement((), "what was said")


def doubts_of_other_columns(
    space: str, values: Array, names: Sequence[str], unit: str | None
) -> list[str]:
    """Return serious doubts of data (N, k) whose columns are called otherwise than those of a model.

    Raises:
        SettingError: For columns in another order than the space's, and names of other units.
    """
    found = check_columns(space, names)
    doubts = _doubts_of_names(space, values, names, found)
    if is_angular(space, len(names)):
        refuse_foreign_units(names, values, unit)
        doubts += _unit_of(names, unit)[1]
    return [doubt.text for doubt in doubts if doubt.is_serious]


def _doubts_of_names(
    space: str, values: Array, names: Sequence[str], found: Arrangement | None
) -> list[Doubt]:
    """Return what columns were taken for, if their names do not say it."""
    listed = ", ".join(names)
    if space == "torus" and any(pair.family.north is LATITUDES for pair in pairs_of(names)):
        text = f"{listed} have a latitude and a longitude, by their names: those are of the sphere"
        return [Doubt(text, True)]
    if space in ROTATIONS and len(names) == 4 and found is None:
        return [Doubt(f"took {listed} as x, y, z, w: the quaternion's scalar is the last", False)]
    if space not in DIRECTIONS or len(names) != 2:
        return []
    if found is None and _may_be_from_pole(names) and float(np.nanmin(values[:, 0])) >= 0:
        text = f"took {names[0]} as latitude: if it is the angle from the pole, give 90 less it"
        return [Doubt(text, True)]
    if found is None:
        return [
            Doubt(f"took {names[0]} as latitude and {names[1]} as longitude, in degrees", False)
        ]
    if found.columns != (0, 1):  # x, y
        text = (
            f"took {names[0]} as latitude and {names[1]} as longitude: on maps it is the other way"
        )
        return [Doubt(text, True)]
    return []


def _unindexed(values: Array) -> list[Doubt]:
    """Return a doubt if Euler angles (N, 3) are 0 in several rows, as microscopes write what failed."""
    rows = int((values == 0).all(axis=1).sum())
    if rows < 2:
        return []
    text = (
        f"all three angles are exactly 0 in {rows} rows: points without an orientation are written so; "
        "if these are such, leave them out"
    )
    return [Doubt(text, True)]


def _may_be_from_pole(names: Sequence[str]) -> bool:
    """Return whether the first of two columns is an angle from the pole or the vertical, as a rule."""
    first, other = (set(words_of(name)) for name in names)
    return "theta" in first or bool(first & FROM_VERTICAL and other & AZIMUTHS)


def _doubts_of_identifiers(space: str, values: Array, names: Sequence[str]) -> list[Doubt]:
    """Return a doubt for each column of (N, k) that seems to number the rows."""
    if len(values) < FEW_ROWS or len(names) < 2:
        return []
    angular = is_angular(space, len(names))  # whose names are doubted for themselves
    return [
        Doubt(f"{name!r} seems to number the rows: if so, leave it out", True)
        for name, column in zip(names, values.T, strict=True)
        if is_identifier(name, column[~np.isnan(column)])
        and not (angular and is_other_quantity(name))
    ]


NAN_CURE = "replace them by NaN, which `missing` treats, or leave their rows out"
"""What to do in Python with codes for missing values."""


def unit_of(
    space: str,
    values: Array,
    names: Sequence[str] | None,
    unit: str | None,
    *,
    form: str | None = None,
    stacklevel: int = 3,
) -> Unit:
    """Return the unit of data (N, k) as `check_values` does, and warn of what is doubtful.

    Warns:
        DataWarning: Of serious doubts, at so many calls from here.
    """
    found, doubts = check_values(space, values, names, unit, NAN_CURE, form)
    for doubt in doubts:
        if doubt.is_serious:
            warnings.warn(doubt.text, DataWarning, stacklevel=stacklevel)
    return found


def _angles(
    space: str, values: Array, names: Sequence[str], unit: str | None, cure: str
) -> tuple[Unit, list[Doubt]]:
    """Return the unit of angles (N, k), and doubts; refuse codes and values of no known unit."""
    refuse_foreign_units(names, values, unit)
    own, doubts = _unit_of(names, unit)
    refuse_codes(space, values, names, own or "degrees", cure)
    if own is None:
        own = _radians(values, names)
        text = "no unit was given and all values are within 2 pi: they were read as radians"
        doubts.append(Doubt(text, False))
    elif other := _other_unit(values, own):
        doubts.append(Doubt(other, True))
    for name, column in zip(names, values.T, strict=True):
        doubts += doubts_of_angle(name, column, TURNS[own])
        if space == "torus":
            doubts += doubts_of_torus(name, column, TURNS[own])
    return own, doubts


def _unit_of(names: Sequence[str], unit: str | None) -> tuple[Unit | None, list[Doubt]]:
    """Return the unit that was given, or else the one that the names of columns say."""
    named = {own for name in names if (own := unit_named(name)) is not None}
    if unit is None and len(named) > 1:
        text = f"the columns {', '.join(names)} are in different units: convert them to one"
        raise SettingError(literal(text))
    if unit is None and named:
        (own,) = named
        return cast(Unit, own), [Doubt(f"read as {own}, as the names of the columns say", False)]
    if named - {unit}:
        said = " and ".join(sorted(named))
        text = f"the columns {', '.join(names)} say {said}, and {unit} were asked for"
        return cast("Unit | None", unit), [Doubt(text, True)]
    return cast("Unit | None", unit), []


def _other_unit(values: Array, unit: str) -> str | None:
    """Return what makes one doubt that angles (N, k) are in a unit, or None."""
    known = values[np.isfinite(values)]
    if len(known) < FEW_ROWS:
        return None
    most, wide = float(np.abs(known).max()), float(np.ptp(known))
    if (
        unit == "degrees"
        and most <= 2 * math.pi * (1 + TURN_TOLERANCE)
        and wide > FULL_SHARE_OF_TURN * 2 * math.pi
    ):
        return "all values are within 2 pi and fill it: if they are radians, give the unit radians"
    is_large = 90 < most <= 360 * (1 + TURN_TOLERANCE)
    if unit == "radians" and is_large and 2 * int((np.abs(known) > 2 * math.pi).sum()) > len(known):
        return "most values are beyond 2 pi and all within 360: if they are degrees, give that unit"
    return None


def seeming_unit(values: Array, unit: str) -> Unit | None:
    """Return the other unit in which angles (N, k) may be by their size alone, or None.

    >>> seeming_unit(np.array([[1.5, -3.0]]), "degrees"), seeming_unit(np.array([[90.0]]), "radians")
    ('radians', 'degrees')
    """
    most = float(np.nanmax(np.abs(values), initial=0.0))
    within = most <= 2 * math.pi * (1 + TURN_TOLERANCE)
    if unit == "degrees":
        return "radians" if within else None
    if most <= TURNS[unit] * (1 + TURN_TOLERANCE):
        return None
    return "radians" if within else "degrees"


def _radians(values: Array, names: Sequence[str]) -> Unit:
    """Return radians if all values are within 2 pi, and refuse others, which have another unit."""
    most = np.nanmax(np.abs(values), axis=0, initial=0)
    beyond = most > 2 * math.pi * (1 + TURN_TOLERANCE)
    if beyond.any():
        column = int(beyond.argmax())
        value = values[np.nanargmax(np.abs(values[:, column])), column]
        text = literal(f"column {names[column]!r} has {value:g}, beyond 2 pi")
        if abs(value - 4 * math.pi) < FOUR_PI_TOLERANCE:
            text += (
                ": .ang files have 4 pi where there is no orientation; if this is one, give "
                f"{{missing_codes}} {value:.10g} and {{drop_missing}}"
            )
        raise SettingError(text + "; give {unit} degrees, radians or turns")
    return "radians"


def fraction_doubts(values: Array, lengths: Sequence[float]) -> list[Doubt]:
    """Return a doubt if points (N, d) may be fractions of a cell, whose sides (d,) are much longer."""
    known = values[np.isfinite(values).all(axis=1)]
    inside = bool(((known >= 0) & (known < 1)).all()) and len(known) >= FEW_ROWS
    if not inside or min(lengths) < 2:
        return []
    text = (
        "all coordinates lie in [0, 1), in the unit of the cell: if they are fractions of the cell, "
        "give that option (fractional)"
    )
    return [Doubt(text, True)]


def written_from_zero(data: Array, period: float) -> list[int]:
    """Return the numbers of columns (N, d) of angles that are written from 0 to a whole turn.

    These are those in which nothing is negative and something is half a turn or more.
    """
    with np.errstate(invalid="ignore"):
        least, most = (end(data, axis=0, initial=0.0) for end in (np.fmin.reduce, np.fmax.reduce))
    return np.flatnonzero((least >= 0) & (most >= period / 2)).tolist()
