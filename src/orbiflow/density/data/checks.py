"""Whether the values of columns can be what the columns are declared to be."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density.data.column_names import words_of
from orbiflow.density.data.columns import DIRECTIONS, ROTATIONS, VECTORS
from orbiflow.density.data.roles import Role
from orbiflow.density.data.units import TURN_TOLERANCE, TURNS, is_angular
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

FULL_SHARE_OF_TURN = 0.75
"""Share of a turn of radians that values fill where they seem to be radians."""


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


class Checked(NamedTuple):
    """A column to be checked: its name, its values (N,), and the word for a row's place."""

    name: str
    values: Array
    place: Callable[[int], str]

    @property
    def known(self) -> Array:
        """The finite values."""
        return self.values[np.isfinite(self.values)]

    def row_of(self, value: float) -> str:
        """Return in words where a value is first, and how often it is there."""
        rows = np.flatnonzero(self.values == value)
        more = f", {len(rows)} such rows" if len(rows) > 1 else ""
        return f"{value:.10g} ({self.place(int(rows[0]))}{more})"


def check_turn(column: Checked, turn: float, what: str, *, are_new: bool = False) -> None:
    """Refuse angles beyond a turn, and more than a turn apart: they are not written in one way.

    New ones, of a density that is known, may be two turns away: its intervals may reach over a turn.
    """
    known = column.known
    if not len(known):
        return
    low, high = float(known.min()), float(known.max())
    most = math.ceil(turn) if what == "cycle" else turn * (1 + TURN_TOLERANCE)
    most *= 2 if what == "axial" or are_new else 1  # either end of a line may be written
    far = high if high >= -low else low
    if abs(far) > most:
        codes = codes_among(column.values, turn)
        listed = " and ".join(map(column.row_of, codes[:3])) or column.row_of(far)
        raise SettingError(
            literal(f"{column.name!r} has {listed}, beyond a turn of {turn:.10g}: ")
            + "reduce it to a turn, declare another unit with {columns}; "
            + _missing(codes or [far])
        )
    if are_new:
        return
    if high - low > most or (what == "cycle" and low < 0 and max(-low, high) > turn / 2):
        raise SettingError(
            literal(f"{column.name!r} has {column.row_of(low)} and {column.row_of(high)}, ")
            + f"which are of no one turn of {turn:.10g}: write all from 0 on or about 0; "
            + _missing([far])
        )


def _missing(values: Sequence[float]) -> str:
    """Return what to do with values that may stand for missing ones."""
    listed = ",".join(f"{value:.10g}" for value in values)
    return (
        "if that stands for a missing value, leave it empty (NaN), or give "
        f"{{missing_codes}} {listed} {{drop_missing}}"
    )


def check_real(column: Checked, role: Role) -> list[str]:
    """Refuse real numbers that a column cannot have, and return what makes one doubt others."""
    known = column.known
    if not len(known):
        return []
    low, high = float(known.min()), float(known.max())
    if role.kind == "bounded":
        if low < role.low or high > role.high:
            far = low if low < role.low else high
            raise SettingError(
                literal(f"{column.name!r} has {column.row_of(far)}, and is declared as {role}: ")
                + "declare other ends; "
                + _missing([far])
            )
        return []
    if role.kind == "positive" and low <= 0:
        also = (
            "0 is a mass of its own: leave those rows out, or declare the column as linear"
            if low == 0
            else "declare the column as linear; " + _missing([low])
        )
        raise SettingError(
            literal(f"{column.name!r} has {column.row_of(low)}, and is declared as positive: ")
            + also
        )
    refuse_codes(column, known)
    return doubts_of_ends(column)


def refuse_codes(column: Checked, beside: Array) -> None:
    """Refuse real numbers that stand apart from others, among values (M,) with those of the column."""
    codes = [code for code in codes_among(beside, None) if code in column.values]
    if codes:
        listed = " and ".join(column.row_of(value) for value in codes[:3])
        raise SettingError(
            literal(f"{column.name!r} has {listed}, far from all other values: ")
            + _missing(codes)
            + f"; if it is data, declare {{columns}} {literal(column.name)}=bounded:LOW:HIGH"
        )


def doubts_of_ends(column: Checked) -> list[str]:
    """Return doubts about a value at an end that stands apart, or repeats among fractions."""
    distinct, counts = np.unique(column.known, return_counts=True)
    found: list[str] = []
    if len(distinct) < 2:
        return found
    for end in (0, -1):
        rest, often = np.delete(distinct, end), int(counts[end])
        if len(rest) < FEW_VALUES or often < 2:
            continue
        apart = float(np.abs(rest - distinct[end]).min()) > APART * float(np.ptp(rest))
        fractions = 2 * int((rest != np.round(rest)).sum()) >= len(rest)
        repeats = often >= max(LEAST_REPEATS, OFTEN * int(np.delete(counts, end).max()) + 1)
        if apart or (fractions and repeats):
            why = "far from all other values" if apart else "and others hardly repeat"
            found.append(
                f"{column.name!r} is {distinct[end]:g} in {often} rows, {why}: if that stands for a "
                "missing value, or for something else, leave these rows out"
            )
    return found


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
    own = [k for k, role in enumerate(roles) if role is None]
    columns = [Checked(n, v, place) for n, v in zip(names, values.T, strict=True)]
    for column, role in zip(columns, roles, strict=True):
        if role is None:
            continue
        if role.turn is not None:
            check_turn(column, role.turn, role.kind, are_new=are_new)
            doubts += doubts_of_ends(column) if role.kind != "cycle" and not are_new else []
        elif role.is_real:
            doubts += check_real(column, role)
            doubts += [] if are_new else _doubts_of_two(column)
    if space in DIRECTIONS and len(own) == 2:
        doubts += _check_places(*(columns[k] for k in own), space=space, unit=unit)
        doubts += _null_island(*(columns[k] for k in own)) if space == "sphere" else []
    elif is_angular(space, len(own), form):
        for k in own:
            check_turn(columns[k], TURNS[unit or "radians"], "angle", are_new=are_new)
    elif space not in (*VECTORS, *ROTATIONS):  # points of a quotient
        for k in own:
            refuse_codes(columns[k], columns[k].known)
    return doubts


def _doubts_of_two(column: Checked) -> list[str]:
    """Return a doubt about real numbers of two values alone, which a word has."""
    distinct = np.unique(column.known)
    if len(distinct) != 2:
        return []
    return [
        f"{column.name!r} has two values alone, {distinct[0]:g} and {distinct[1]:g}, as a word such "
        "as yes or no has: a density of real numbers says little of it; make it a covariate, or leave "
        "it out"
    ]


def _check_places(lat: Checked, lon: Checked, *, space: str, unit: str | None) -> list[str]:
    """Refuse places that there are not, and what fills radians or hours; return doubts."""
    known = lat.known
    far = float(known[np.abs(known).argmax()]) if len(known) else 0.0
    if abs(far) > 90 * (1 + TURN_TOLERANCE):
        raise SettingError(
            literal(f"{lat.name!r} has {lat.row_of(far)}, and latitudes are within -90 and 90: ")
            + "specify with {columns} which column is the latitude; "
            + _missing(codes_among(lat.values, 90.0) or [far])
        )
    check_turn(lon, 360.0, "longitude")
    whole = np.isfinite(lat.values) & np.isfinite(lon.values)
    if unit is not None or int(whole.sum()) < FEW_ROWS:
        return []
    high, wide = float(np.abs(lat.values[whole]).max()), float(np.ptp(lon.values[whole]))
    most = float(np.abs(lon.values[whole]).max())
    small = high <= math.pi / 2 + TURN_TOLERANCE and most <= 2 * math.pi * (1 + TURN_TOLERANCE)
    if small and wide > FULL_SHARE_OF_TURN * 2 * math.pi:
        raise SettingError(
            literal(f"{lat.name!r} is within pi/2 and {lon.name!r} fills 2 pi, as radians do, ")
            + f"and the {space} takes degrees: convert them (numpy.degrees), or give {{unit}} degrees "
            "if they are degrees"
        )
    high = float(np.ptp(lat.values[whole]))
    hours = lon.values[whole].min() >= 0 and most < 24 and (wide > 20 or (wide > 12 and high > 40))
    if hours and "ra" in words_of(lon.name):
        raise SettingError(
            literal(f"{lon.name!r} is within 0 and 24, as hours are: ")
            + "multiply it by 15, or give {unit} degrees if it is in degrees"
        )
    return (
        [
            f"all of {lat.name!r} are within pi/2 and of {lon.name!r} within 2 pi, and they were read "
            "as degrees: if they are radians, convert them; if not, give the unit degrees"
        ]
        if small
        else []
    )


NEAR_NULL = 1.0
"""Degrees from latitude 0, longitude 0 within which there are no other places where these are a gap."""


def _null_island(lat: Checked, lon: Checked) -> list[str]:
    """Return a doubt if places far from latitude 0, longitude 0 have it again and again."""
    both = np.stack([lat.values, lon.values], axis=1)
    known = both[np.isfinite(both).all(axis=1)]
    here = (known == 0).all(axis=1)
    others = known[~here]
    if int(here.sum()) < 2 or not len(others):
        return []
    if float(np.abs(others).max(axis=1).min()) < NEAR_NULL:
        return []
    return [
        f"{lat.name} and {lon.name} are both exactly 0 in {int(here.sum())} rows, far from all others: "
        "if that stands for a missing place, leave these rows out"
    ]


def fraction_doubts(values: Array, lengths: Sequence[float]) -> list[str]:
    """Return a doubt if points (N, d) may be fractions of a cell, whose sides (d,) are much longer."""
    known = values[np.isfinite(values).all(axis=1)]
    inside = bool(((known >= 0) & (known < 1)).all()) and len(known) >= FEW_ROWS
    if not inside or min(lengths) < 2:
        return []
    return [
        "all coordinates lie in [0, 1), in the unit of the cell: if they are fractions of the cell, "
        "give that option (fractional)"
    ]


def written_from_zero(data: Array, period: float) -> list[int]:
    """Return the numbers of columns (N, d) of angles that are written from 0 to a whole turn.

    These are those in which nothing is negative and something is half a turn or more.
    """
    with np.errstate(invalid="ignore"):
        least, most = (end(data, axis=0, initial=0.0) for end in (np.fmin.reduce, np.fmax.reduce))
    return np.flatnonzero((least >= 0) & (most >= period / 2)).tolist()
