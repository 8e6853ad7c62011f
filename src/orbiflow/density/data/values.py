"""What the values of columns say: codes for missing ones, radians among degrees, fractions of cells."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import NamedTuple, cast

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density.data.columns import DIRECTIONS, ROTATIONS, Arrangement, check_columns
from orbiflow.density.data.identifiers import is_identifier
from orbiflow.density.data.names import (
    LATITUDES,
    is_count_named,
    is_other_quantity,
    pairs_of,
    unit_named,
    words_of,
)
from orbiflow.density.data.units import TURN_TOLERANCE, TURNS, Unit, check_unit, is_angular
from orbiflow.errors import DataWarning, SettingError, literal

FULL = 0.75
"""Share of a turn of radians that values fill where they seem to be radians."""

FEW_ROWS = 10
"""Fewer may all be small, or all be alike, by accident."""


class Doubt(NamedTuple):
    """What was decided for the user, in words; a serious one may make all results wrong."""

    text: str
    is_serious: bool


def check_values(
    space: str, values: Array, names: Sequence[str] | None, unit: str | None, cure: str
) -> tuple[Unit, list[Doubt]]:
    """Return the unit of data (N, k), and doubts; NaN are missing values.

    Args:
        space: The name of the space, or of a group.
        values: The data.
        names: Names of their columns, if they have names.
        unit: The unit that was given, if one was.
        cure: What to do with codes for missing values, after "...: ".

    Raises:
        SettingError: For a unit that does not apply or is not known, columns in another order than the
            space's, codes for missing values among angles, and radians in the place of degrees.
    """
    check_unit(space, unit)
    called = list(names) if names else [f"column{k}" for k in range(1, values.shape[1] + 1)]
    found = check_columns(space, names) if names else None
    doubts = [Doubt(found.note, False)] if found and found.note else []
    doubts += _doubts_of_names(space, values, called, found)
    doubts += _doubts_of_identifiers(space, values, called)
    if is_angular(space, values.shape[1]):
        own, more = _angles(values, called, unit, cure)
        return own, doubts + more
    if space in DIRECTIONS and values.shape[1] == 2:
        _refuse_no_places(values, called, cure)
        doubts += _places(space, values, called, unit)
    return "radians", doubts


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
    if found is None and "theta" in words_of(names[0]) and float(np.nanmin(values[:, 0])) >= 0:
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
    space: str, values: Array, names: Sequence[str] | None, unit: str | None, *, stacklevel: int = 3
) -> Unit:
    """Return the unit of data (N, k) as `check_values` does, and warn of what is doubtful.

    Warns:
        DataWarning: Of serious doubts, at so many calls from here.
    """
    found, doubts = check_values(space, values, names, unit, NAN_CURE)
    for doubt in doubts:
        if doubt.is_serious:
            warnings.warn(doubt.text, DataWarning, stacklevel=stacklevel)
    return found


def _angles(
    values: Array, names: Sequence[str], unit: str | None, cure: str
) -> tuple[Unit, list[Doubt]]:
    """Return the unit of angles (N, k), and doubts; refuse codes and values of no known unit."""
    own, doubts = _unit_of(names, unit)
    _refuse_no_angles(values, names, own or "degrees", cure)
    if own is None:
        own = _radians(values, names)
        text = "no unit was given and all values are within 2 pi: they were read as radians"
        doubts.append(Doubt(text, False))
    elif other := _other_unit(values, own):
        doubts.append(Doubt(other, True))
    for name, column in zip(names, values.T, strict=True):
        doubts += _doubts_of_angle(name, column, TURNS[own])
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
        and wide > FULL * 2 * math.pi
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


def _doubts_of_angle(name: str, column: Array, turn: float) -> list[Doubt]:
    """Return doubts about a column (N,) of angles."""
    doubts: list[Doubt] = []
    if is_other_quantity(name) or is_count_named(name):
        text = f"{name!r} seems to be no angle, by its name: here values a turn apart are the same"
        doubts.append(Doubt(text, True))
    beyond = np.abs(column) > turn * (1 + TURN_TOLERANCE)
    if beyond.any():
        most = column[np.nanargmax(np.abs(column))]
        text = (
            f"{name!r} has {int(beyond.sum())} beyond a turn, the farthest {most:g}, which count "
            f"modulo {turn:.10g}"
        )
        doubts.append(Doubt(text, False))
    return doubts


def _radians(values: Array, names: Sequence[str]) -> Unit:
    """Return radians if all values are within 2 pi, and refuse others, which have another unit."""
    most = np.nanmax(np.abs(values), axis=0, initial=0)
    beyond = most > 2 * math.pi * (1 + TURN_TOLERANCE)
    if beyond.any():
        column = int(beyond.argmax())
        value = values[np.nanargmax(np.abs(values[:, column])), column]
        raise SettingError(
            literal(f"column {names[column]!r} has {value:g}, beyond 2 pi")
            + "; give {unit} degrees, radians or turns"
        )
    return "radians"


# fmt: off
CODES = frozenset({
    77.0, 88.0, 99.0, 99.9, 99.99, 777.0, 888.0, 888.8, 990.0, 998.0, 999.0, 999.25, 999.9, 999.99,
    7777.0, 8888.0,
    9990.0, 9996.0, 9998.0, 9999.0, 9999.9, 9999.99, 32766.0, 32767.0, 32768.0, 65535.0, 99999.0,
    99999.9, 999999.0, 9999999.0, 2147483647.0, 2147483648.0,
})
# fmt: on
"""Numbers, or their opposites, that tables have in the place of missing values; -1 is one as well."""

HUGE = 1e15
"""What is larger is no angle: netCDF fills gaps with 9.97e36."""

CODE_GAP = 1 / 36
"""Share of a turn that lies between a code and all other values."""

FEW_VALUES = 5
"""Different values below which a code within a turn may be one of the angles."""

MOST_CODES = 3
"""More different values beyond a turn are no codes, unless they are among `CODES`."""


def codes_among(column: Array, turn: float) -> list[float]:
    """Return values of a column (N,) that seem to stand for missing ones.

    They are numbers such as 999 or -99 far from all others, or a few numbers beyond a turn that come
    again and again, where other values keep within a turn.

    >>> codes_among(np.array([10.0, 350.0, 20.0, 999.0, 990.0]), 360.0)
    [990.0, 999.0]
    >>> codes_among(np.array([350.0, 1025.0, 700.0, 990.5]), 360.0)
    []
    """
    distinct, counts = np.unique(column[np.isfinite(column)], return_counts=True)
    sizes = np.abs(distinct)
    named = np.isin(sizes, list(CODES)) | (sizes > HUGE) | (distinct == -1)
    rest, often = distinct[~named], counts[~named] > 1
    beyond = np.abs(rest) > turn * (1 + TURN_TOLERANCE)
    if 2 * int(beyond.sum()) > len(rest):  # angles that go on turning
        return []
    found = [code for code in distinct[named].tolist() if _is_code(code, rest, turn)]
    if turn > 100 and 0 < int(beyond.sum()) <= MOST_CODES:
        pairs = zip(rest[beyond].tolist(), often[beyond].tolist(), strict=True)
        found += [value for value, again in pairs if _is_foreign(value, rest[~beyond], turn, again)]
    return sorted(found)


def refuse_codes(space: str, values: Array, names: Sequence[str], unit: str, cure: str) -> None:
    """Refuse data (N, k) some of which seem to stand for missing values; `cure` says what to do."""
    if is_angular(space, values.shape[1]):
        _refuse_no_angles(values, names, unit, cure)
    elif space in DIRECTIONS and values.shape[1] == 2:
        _refuse_no_places(values, names, cure)


def _refuse_no_angles(values: Array, names: Sequence[str], unit: str, cure: str) -> None:
    """Refuse angles (N, k) some of which are codes for missing values."""
    for name, column in zip(names, values.T, strict=True):
        if codes := codes_among(column, TURNS[unit]):
            raise SettingError(literal(f"column {name!r} has {_counted(codes, column)}: ") + cure)


def _is_code(value: float, rest: Array, turn: float) -> bool:
    """Return whether one of `CODES` is far from all other values, beyond a turn or of another kind."""
    if abs(value) > turn * (1 + TURN_TOLERANCE):
        return not len(rest) or float(np.abs(rest - value).min()) > CODE_GAP * turn
    if turn < 100 or len(rest) < FEW_VALUES:
        return False
    if value < 0:  # the only negative value of a compass
        return float(rest.min()) >= 0 and float(rest.max()) > turn / 2
    if _are_whole(rest / 10):  # rounded to ten degrees, as winds are
        return value % 10 != 0
    return value != round(value) and _are_whole(rest)


def _is_foreign(value: float, rest: Array, turn: float, again: bool) -> bool:
    """Return whether a value beyond a turn is no angle like all others, which keep within a turn."""
    if _are_whole(rest / 10) and len(rest) >= FEW_VALUES:  # rounded to ten degrees, as winds are
        return again or value % 10 != 0
    apart = float(np.abs(rest - value).min(initial=math.inf)) > CODE_GAP * turn
    return again and (apart or _are_whole(rest))


def _are_whole(values: Array) -> bool:
    return bool((values == np.round(values)).all())


def _counted(codes: Sequence[float], column: Array) -> str:
    """Return codes and how often each is there, in words."""
    often = [int((column == code).sum()) for code in codes]
    words = [f"{code:.10g} in {n} row{'s' * (n > 1)}" for code, n in zip(codes, often, strict=True)]
    listed = words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
    return f"{listed}, which seem{'s' * (len(words) == 1)} to stand for missing values"


def _refuse_no_places(values: Array, names: Sequence[str], cure: str) -> None:
    """Refuse latitudes and longitudes (N, 2) some of which are codes for missing values."""
    for name, column, most in zip(names, values.T, (90.0, 360.0), strict=True):
        known = np.unique(
            column[np.isfinite(column) & (np.abs(column) > most * (1 + TURN_TOLERANCE))]
        )
        codes = [v for v in known.tolist() if abs(v) in CODES or abs(v) > HUGE]
        if codes and len(codes) == len(known):
            raise SettingError(literal(f"column {name!r} has {_counted(codes, column)}: ") + cure)


def _places(space: str, values: Array, names: Sequence[str], unit: str | None) -> list[Doubt]:
    """Return doubts about latitudes and longitudes (N, 2) in degrees; refuse radians."""
    known = values[np.isfinite(values).all(axis=1)]
    if len(known) < FEW_ROWS:
        return []
    lat, lon = known.T
    doubts: list[Doubt] = []
    small = unit is None and _is_small(lat, lon)
    if small and float(np.ptp(lon)) > FULL * 2 * math.pi:
        raise SettingError(
            literal(
                f"latitudes ({names[0]}) are within pi/2 and longitudes ({names[1]}) fill 2 pi: they "
                f"are radians, it seems, and the {space} takes degrees; convert them (numpy.degrees), "
            )
            + "or give {unit} degrees if they are degrees"
        )
    if small:
        text = (
            "all latitudes are within pi/2 and all longitudes within 2 pi, and they were read as "
            "degrees: if they are radians, convert them; if not, give the unit degrees"
        )
        doubts.append(Doubt(text, True))
    for name, column, word in ((names[0], lat, "south"), (names[1], lon, "west")):
        if {word, word[0]}.intersection(words_of(name)) and bool((column >= 0).all()):
            text = f"{name!r} seems to count to the {word}, by its name: if so, make it negative"
            doubts.append(Doubt(text, True))
    is_ascension = bool({"ra", "raj", "rektaszension"}.intersection(words_of(names[1])))
    hours = is_ascension and bool(((lon >= 0) & (lon < 24)).all())
    if hours and (np.ptp(lon) > 20 or (np.ptp(lon) > 12 and np.ptp(lat) > 40)):
        text = f"{names[1]!r} is between 0 and 24: if it is in hours, multiply it by 15"
        doubts.append(Doubt(text, True))
    return doubts


def _is_small(lat: Array, lon: Array) -> bool:
    """Return whether latitudes and longitudes (N,) may be radians."""
    low, high = float(lon.min()), float(lon.max())
    around = high - low <= 2 * math.pi + TURN_TOLERANCE and max(-low, high) <= 2 * math.pi
    return around and float(np.abs(lat).max()) <= math.pi / 2 + TURN_TOLERANCE


def fraction_doubts(values: Array, lengths: Sequence[float]) -> list[Doubt]:
    """Return a doubt if points (N, d) may be fractions of a cell, whose sides (d,) are much longer."""
    known = values[np.isfinite(values).all(axis=1)]
    inside = bool(((known >= 0) & (known < 1)).all()) and len(known) >= FEW_ROWS
    if not inside or min(lengths) < 2:
        return []
    text = (
        "all coordinates lie in [0, 1), in the unit of the cell: if they are fractions of the cell, "
        "say so (fractional)"
    )
    return [Doubt(text, True)]
