"""Whether the values of columns can be what the columns are declared to be."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density.data.roles import Role
from orbiflow.density.data.table import TableError, UndeclaredError
from orbiflow.density.data.units import (
    DIRECTIONS,
    ROTATIONS,
    TURN_TOLERANCE,
    TURNS,
    VECTORS,
    is_angular,
    words_of,
)
from orbiflow.errors import SettingError, literal

_CODE = re.compile(
    r"([789])\1+0?|([789])\2+\.(\2+|25)|99[68]|999[68]|3276[678]|65535|214748364[78]"
)
"""How numbers are written that tables have in the place of missing values."""

FILL = 1e15
"""From here on numbers fill gaps: netCDF has 9.97e36."""

FEW_VALUES = 5
"""Different values below which nothing stands apart: they may be all that there are."""

APART, APART_ALONE = 1.0, 10.0
"""Distance from all other values, in their range, from which one stands apart; the latter of one below
999 that is there once, which may be the farthest of many."""

SURE_CODE = 999.0

LEAST_REPEATS, OFTEN = 5, 3
"""How often a value at the end is there at least that repeats among fractions, and how much more often
than any other."""

FEW_ROWS = 10
"""Fewer may all be small by accident."""

FULL_SHARE_OF_TURN, FULL_SHARE_OF_HOURS = 0.75, 0.9
"""Share of a turn of radians, or of hours, that values fill where they seem to be of that unit."""

HOURS_IN_TURN = 24.0

ON_CIRCLE = 1e-3
"""Distance from the unit circle within which a cosine and a sine lie, as they are rounded."""


def is_code(value: float) -> bool:
    """Return whether a number is one that tables have in the place of missing values.

    >>> [is_code(value) for value in (999.9, -9999.0, 1e20, 98.0, 250.0)]
    [True, True, True, False, False]
    """
    return abs(value) > FILL or _CODE.fullmatch(f"{abs(value):.10g}") is not None


def codes_among(column: Array, turn: float | None) -> list[float]:
    """Return values at the ends of a column (N,) that seem to stand for missing ones.

    They are written as such codes are, and stand apart: beyond a turn or, of real numbers, farther from
    all others than these spread, or alone below 0.

    >>> codes_among(np.array([10.0, 350.0, 20.0, 999.0, 990.0]), 360.0)
    [990.0, 999.0]
    >>> codes_among(np.array([994.2, 999.9, 1013.5, -9999.0]), None)
    [-9999.0]
    """
    distinct, counts = np.unique(column[np.isfinite(column)], return_counts=True)
    coded = np.array([is_code(value) for value in distinct.tolist()], dtype=bool)
    rest = distinct[~coded]
    if turn is not None:
        return distinct[coded & (np.abs(distinct) > turn * (1 + TURN_TOLERANCE))].tolist()
    if len(rest) < 2:
        return []
    least, most = float(rest[0]), float(rest[-1])
    apart = np.maximum(least - distinct, distinct - most)
    sure = (counts > 1) | (np.abs(distinct) >= SURE_CODE)
    wide = np.where(sure, APART, APART_ALONE) * (most - least)
    if len(rest) < FEW_VALUES:
        wide = APART_ALONE * max(most - least, -least, most)
        coded &= (distinct < 0) | (distinct % 1 == 0)  # 99.99 and 999.99 are prices, too
    is_alone_below = sure & (distinct < 0) & (least >= 0)  # however far the others reach
    return distinct[coded & (is_alone_below | (apart > wide))].tolist()


class ValuesError(SettingError):
    """An error for values that contradict what is declared.

    - `codes`: Those of them that may stand for missing ones.
    """

    def __init__(self, template: str, codes: Sequence[float]) -> None:
        super().__init__(template + "; if that stands for a missing value, leave it empty (NaN)")
        self.codes = tuple(codes)


def in_file(error: SettingError, where: str) -> SettingError:
    """Return an error about a table as one of a file, with the options that files have.

    - `where`: What messages begin with, such as "wind.csv: ".
    """
    codes = ",".join(f"{code:.10g}" for code in getattr(error, "codes", ()))
    cure = f", or give {{missing_codes}} {codes} {{drop_missing}}" if codes else ""
    begin = "" if error.template.startswith(literal(where)) else literal(where)
    if isinstance(error, UndeclaredError):
        return UndeclaredError(begin + error.template, error.columns, error.proposal)
    return TableError(begin + error.template + cure)


class Checked(NamedTuple):
    """A column to be checked: its name, its values (N,), and the word for a row's place."""

    name: str
    values: Array
    place: Callable[[int], str] = lambda row: f"row {row + 1}"

    @property
    def known(self) -> Array:
        """The finite values."""
        return self.values[np.isfinite(self.values)]

    def row_of(self, value: float) -> str:
        """Return in words where a value is first, and how often it is there."""
        rows = np.flatnonzero(self.values == value)
        more = f", {len(rows)} such rows" if len(rows) > 1 else ""
        return f"{value:.10g} ({self.place(int(rows[0]))}{more})"

    def refusal(
        self, values: Sequence[float], cure: str, codes: Sequence[float] = ()
    ) -> ValuesError:
        """Return the error for some of the values; `codes` are those that may be missing ones.

        Default: those that are written as codes are, or that repeat. A value is not to be left out
        because it is the farthest of many.
        """
        listed = " and ".join(map(self.row_of, values[:3]))
        seem = [v for v in values if is_code(v) or np.count_nonzero(self.values == v) > 1]
        return ValuesError(literal(f"{self.name!r} has {listed}, ") + cure, codes or seem)


def check_turn(column: Checked, turn: float, what: str, *, are_new: bool = False) -> None:
    """Refuse angles beyond a turn, and more than a turn apart: they are not written in one way.

    New ones, of a density that is known, may be two turns away: its intervals may reach over a turn.
    """
    values = column.known
    if not len(values):
        return
    low, high = float(values.min()), float(values.max())
    most = math.ceil(turn) if what == "cycle" else turn * (1 + TURN_TOLERANCE)
    most *= 2 if what == "axial" or are_new else 1  # either end of a line may be written
    far = high if high >= -low else low
    if abs(far) > most:
        cure = f"beyond a turn of {turn:.10g}: reduce it to a turn, or declare another unit with "
        raise column.refusal(codes_among(column.values, turn) or [far], cure + "{columns}")
    if are_new:
        return
    if high - low > most or (what == "cycle" and low < 0 and max(-low, high) > turn / 2):
        cure = f"which are of no one turn of {turn:.10g}: write all from 0 on or about 0"
        raise column.refusal([low, high], cure)


def check_real(column: Checked, role: Role) -> list[str]:
    """Refuse real numbers that a column cannot have, and return what makes one doubt others."""
    values = column.known
    if not len(values):
        return []
    low, high = float(values.min()), float(values.max())
    if role.kind == "bounded":
        if low < role.low or high > role.high:
            far = low if low < role.low else high
            raise column.refusal([far], f"and is declared as {role}: declare other ends")
        return []
    if role.kind == "positive" and low <= 0:
        cure = "and is declared as positive: declare the column as linear"
        cure += ", or leave out those rows, as 0 is a mass of its own" if low == 0 else ""
        raise column.refusal([low], cure)
    refuse_codes(column, values)
    return doubts_of_ends(column)


def refuse_codes(column: Checked, beside: Array) -> None:
    """Refuse real numbers that stand apart from others, among values (M,) with those of the column."""
    codes = [code for code in codes_among(beside, None) if code in column.values]
    if codes:
        cure = "far from all other values: if it is data, declare {columns} "
        raise column.refusal(codes, cure + f"{literal(column.name)}=bounded:LOW:HIGH")


def doubts_of_ends(column: Checked) -> list[str]:
    """Return doubts about a value at an end that stands apart, or repeats among fractions."""
    distinct, counts = np.unique(column.known, return_counts=True)
    doubts: list[str] = []
    for end in (0, -1) if len(distinct) > 1 else ():
        rest, often = np.delete(distinct, end), int(counts[end])
        if len(rest) < FEW_VALUES or often < 2:
            continue
        is_apart = float(np.abs(rest - distinct[end]).min()) > APART * float(np.ptp(rest))
        are_fractions = 2 * int((rest != np.round(rest)).sum()) >= len(rest)
        repeats = often >= max(LEAST_REPEATS, OFTEN * int(np.delete(counts, end).max()) + 1)
        if is_apart or (are_fractions and repeats):
            why = "far from all other values" if is_apart else "and others hardly repeat"
            doubts.append(
                f"{column.name!r} is {distinct[end]:g} in {often} rows, {why}: if that stands for a "
                "missing value, or for something else, leave these rows out"
            )
    return doubts


def _doubts_of_degrees(column: Checked) -> list[str]:
    """Return a doubt where angles that were read as degrees fill a turn of radians."""
    values, turn = column.known, TURNS["radians"]
    fills = len(values) >= FEW_ROWS and np.ptp(values) > FULL_SHARE_OF_TURN * turn
    if not fills or np.abs(values).max() > turn * (1 + TURN_TOLERANCE) or (values % 1 == 0).all():
        return []
    return [
        f"{column.name!r} lies within 2 pi and was read as degrees: if these are radians, declare "
        f"{column.name}=angle:radians"
    ]


def _doubts_of_circles(columns: Sequence[Checked]) -> list[str]:
    """Return a doubt where two real columns are the cosine and the sine of an angle."""
    doubts: list[str] = []
    for first, other in combinations(columns, 2):
        lengths = np.hypot(first.values, other.values)
        lengths = lengths[np.isfinite(lengths)]
        if len(lengths) >= FEW_ROWS and np.abs(lengths - 1).max() < ON_CIRCLE:
            doubts.append(
                f"{first.name!r} and {other.name!r} lie on a circle, as the cosine and the sine of an "
                "angle do: a density of angles takes the angle itself (numpy.arctan2)"
            )
    return doubts


def check_values(
    space: str,
    values: Array,
    names: Sequence[str],
    roles: Sequence[Role | None],
    unit: str | None,
    *,
    form: str | None = None,
    place: Callable[[int], str] = lambda row: f"row {row + 1}",
    are_new: bool = False,
) -> list[str]:
    """Check data (N, k) against what their columns are, and return what makes one doubt them.

    Args:
        space: The name of the space, or of a group.
        values: The data, NaN where they are missing.
        names: Names of the columns.
        roles: What they are; None is a coordinate of the space.
        unit: The unit of the space's angles; of a sphere "degrees", if it was given.
        form: How rotations are written.
        place: Says where a row, from 0, is.
        are_new: Whether they are rows of a density that is known, which may be few and all alike.

    Raises:
        SettingError: For values that contradict what is declared.
    """
    doubts: list[str] = []
    columns = [Checked(n, v, place) for n, v in zip(names, values.T, strict=True)]
    coordinates = [column for column, role in zip(columns, roles, strict=True) if role is None]
    for column, role in zip(columns, roles, strict=True):
        if role is not None and role.turn is not None:
            check_turn(column, role.turn, role.kind, are_new=are_new)
            if role.kind != "cycle" and not are_new:
                doubts += doubts_of_ends(column)
                doubts += _doubts_of_degrees(column) if role.unit == "degrees" else []
        elif role is not None and role.is_real:
            doubts += check_real(column, role)
    pairs = zip(columns, roles, strict=True)
    doubts += _doubts_of_circles(
        [real for real, role in pairs if role is not None and role.is_real]
    )
    if space in DIRECTIONS and len(coordinates) == 2:
        return doubts + _check_places(*coordinates, space=space, unit=unit)
    for column in coordinates:
        if is_angular(space, len(coordinates), form):
            check_turn(column, TURNS[unit or "radians"], "angle", are_new=are_new)
        elif space not in (*VECTORS, ROTATIONS):  # points of a quotient
            refuse_codes(column, column.known)
    return doubts


def _check_places(lat: Checked, lon: Checked, *, space: str, unit: str | None) -> list[str]:
    """Refuse places that there are not, and what fills radians; return doubts."""
    far = float(lat.known[np.abs(lat.known).argmax()]) if len(lat.known) else 0.0
    if abs(far) > 90 * (1 + TURN_TOLERANCE):
        cure = "and latitudes are within -90 and 90: specify with {columns} which column they are"
        raise lat.refusal([far], cure, codes_among(lat.values, 90.0))
    check_turn(lon, 360.0, "longitude")
    whole = np.isfinite(lat.values) & np.isfinite(lon.values)
    lats, lons = np.abs(lat.values[whole]), lon.values[whole]
    if unit is not None or len(lats) < FEW_ROWS:
        return []
    turn, reach, width = TURNS["radians"] * (1 + TURN_TOLERANCE), np.abs(lons).max(), np.ptp(lons)
    are_hours = lons.min() >= 0 and width > FULL_SHARE_OF_HOURS * HOURS_IN_TURN
    if are_hours and reach <= HOURS_IN_TURN and "ra" in words_of(lon.name):
        raise SettingError(
            literal(f"{lon.name!r} goes from {lons.min():.4g} to {reach:.4g}, as hours do: ")
            + "multiply it by 15, or give {unit} degrees if it is in degrees"
        )
    if lats.max() > turn / 2 or reach > turn:
        return []
    far = "pi/2" if lats.max() <= turn / 4 else "pi"
    both = f"{lat.name!r} within {far} and {lon.name!r} within 2 pi"
    if width > FULL_SHARE_OF_TURN * TURNS["radians"]:
        raise SettingError(
            literal(f"{both} fill radians, ")
            + f"and the {space} takes degrees: convert them (numpy.degrees), or give {{unit}} degrees"
        )
    return [
        f"{both} were read as degrees: if they are radians, convert them; if not, give the unit degrees"
    ]


def fraction_doubts(values: Array, lengths: Sequence[float]) -> list[str]:
    """Return a doubt if points (N, d) may be fractions of a cell, whose sides (d,) are much longer."""
    whole = values[np.isfinite(values).all(axis=1)]
    are_inside = bool(((whole >= 0) & (whole < 1)).all()) and len(whole) >= FEW_ROWS
    return [
        "all coordinates lie in [0, 1), in the unit of the cell: if they are fractions of the cell, "
        "give that option (fractional)"
    ] * (are_inside and min(lengths) >= 2)


def written_from_zero(data: Array, period: float) -> list[int]:
    """Return the numbers of columns (N, d) of angles that are written from 0 to a whole turn.

    These are those in which nothing is negative and something is half a turn or more.
    """
    with np.errstate(invalid="ignore"):
        least, most = (end(data, axis=0, initial=0.0) for end in (np.fmin.reduce, np.fmax.reduce))
    return np.flatnonzero((least >= 0) & (most >= period / 2)).tolist()
