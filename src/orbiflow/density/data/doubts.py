"""What makes one doubt columns: codes for missing values, angles, places, numbers of rows."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.density.data.column_names import (
    AXIAL,
    is_angle_named,
    is_count_named,
    is_other_quantity,
    words_of,
)
from orbiflow.density.data.columns import DIRECTIONS
from orbiflow.density.data.units import TURN_TOLERANCE, TURNS, is_angular
from orbiflow.errors import SettingError, literal

# fmt: off
CODES = frozenset({
    77.0, 88.0, 99.0, 99.9, 99.99, 777.0, 888.0, 888.8, 990.0, 998.0, 999.0, 999.25, 999.9, 999.99,
    7777.0, 8888.0,
    9990.0, 9996.0, 9998.0, 9999.0, 9999.9, 9999.99, 32766.0, 32767.0, 32768.0, 65535.0, 99999.0,
    99999.9, 999999.0, 9999999.0, 2147483647.0, 2147483648.0,
})
# fmt: on
"""Numbers, or their opposites, that tables have in the place of missing values; -1 is one as well."""

MAX_ANGLE = 1e15
"""What is larger is no angle: netCDF fills gaps with 9.97e36."""

CODE_GAP = 1 / 36
"""Share of a turn that lies between a code and all other values."""

FEW_VALUES = 5
"""Different values below which a code within a turn may be one of the angles."""

LEAST_REPEATS, OFTEN = 5, 3
"""How often a whole number among fractions is there at least that recurs, and how much more often than
a value near it."""

MOST_CODES = 3
"""More different values beyond a turn are no codes, unless they are among `CODES`."""


FILLS = np.array([1e20, 1e30, 1e35, 1e36, 9.96921e36, 3.402823e38, 1.797693e308])
"""Numbers, or their opposites, with which libraries fill gaps: those of netCDF and the largest ones."""

FILL_TOLERANCE = 1e-5
"""Share by which a printed fill value may differ."""

LEAST_APART, LEAST_APART_ALONE = 1.0, 10.0
"""Distance of a code from all real numbers of a column, in their range; the latter of a short one that
is there once, which may be the farthest of many."""

SURE_CODE = 999.0
"""Codes below may be the farthest of many whole numbers by accident."""


def codes_among(column: Array, turn: float | None) -> list[float]:
    """Return values of a column (N,) that seem to stand for missing ones.

    Of real numbers, whose `turn` is None, they are numbers such as 999 or -9999 that are farther from
    all others than these spread, or alone below 0. Of angles they are such numbers far from all others
    or again and again where others hardly repeat, a few numbers beyond a turn that come again and again
    where other values keep within a turn, or 360 where others keep within half a turn either way, as
    DSSP writes it.

    >>> codes_among(np.array([10.0, 350.0, 20.0, 999.0, 990.0]), 360.0)
    [990.0, 999.0]
    >>> codes_among(np.array([350.0, 1025.0, 700.0, 990.5]), 360.0)
    []
    >>> codes_among(np.array([994.2, 999.9, 1013.5, -9999.0]), None)
    [-9999.0]
    """
    distinct, counts = np.unique(column[np.isfinite(column)], return_counts=True)
    sizes = np.abs(distinct)
    if turn is None:
        return _codes_apart(distinct, counts)
    named = np.isin(sizes, list(CODES)) | (sizes > MAX_ANGLE) | (distinct == -1)
    rest, often = distinct[~named], counts[~named] > 1
    beyond = np.abs(rest) > turn * (1 + TURN_TOLERANCE)
    if 2 * int(beyond.sum()) > len(rest):  # angles that go on turning
        return []
    found = [code for code in distinct[named].tolist() if _is_code(code, rest, turn)]
    found += [
        code
        for code in distinct[named].tolist()
        if code not in found and turn > 100 and recurs(code, distinct, counts, turn)
    ]
    if _is_beyond_halves(rest, turn):
        found.append(turn)
    if turn > 100 and 0 < int(beyond.sum()) <= MOST_CODES:
        pairs = zip(rest[beyond].tolist(), often[beyond].tolist(), strict=True)
        found += [value for value, again in pairs if _is_foreign(value, rest[~beyond], turn, again)]
    return sorted(found)


def _codes_apart(distinct: Array, counts: NDArray[np.int64]) -> list[float]:
    """Return the codes among different real numbers (M,), in order, that stand apart from all others.

    These have their counts (M,).
    """
    fills = np.isclose(np.abs(distinct)[:, None], FILLS, rtol=FILL_TOLERANCE, atol=0).any(axis=1)
    named = np.isin(np.abs(distinct), list(CODES)) | fills
    # those between others are data, such as a pressure of 999.9
    inner = np.flatnonzero(~named)
    if len(inner) < 2:
        return []
    least, most = float(distinct[inner[0]]), float(distinct[inner[-1]])
    apart = np.maximum(least - distinct, distinct - most)
    sure = (counts > 1) | (np.abs(distinct) >= SURE_CODE)
    wide = np.where(sure, LEAST_APART, LEAST_APART_ALONE) * (most - least)
    if len(inner) < FEW_VALUES:  # which may be all that there are
        wide = LEAST_APART_ALONE * max(most - least, -least, most)
        named &= fills | (distinct < 0) | (distinct % 1 == 0)  # 99.99 and 999.99 are prices, too
    is_alone_below = sure & (distinct < 0) & (least >= 0)  # however far the others reach
    return distinct[named & (is_alone_below | (apart > wide))].tolist()


def refuse_codes(space: str, values: Array, names: Sequence[str], unit: str, cure: str) -> None:
    """Refuse data (N, k) of a space of which some seem to stand for missing values.

    `cure` says what to do.
    """
    width = values.shape[1]
    if space not in DIRECTIONS or width != 2:
        turn = TURNS[unit] if is_angular(space, width) else None
        refuse_codes_of(values, names, [turn] * width, cure)
        return
    for name, column, most in zip(names, values.T, (90.0, 360.0), strict=True):
        known = column[np.isfinite(column) & (np.abs(column) > most * (1 + TURN_TOLERANCE))]
        codes = np.unique(known).tolist()
        if all(abs(v) in CODES or abs(v) > MAX_ANGLE for v in codes):
            _refuse(codes, column, name, cure)


def refuse_codes_of(
    values: Array, names: Sequence[str], turns: Sequence[float | None], cure: str
) -> None:
    """Refuse columns (N, k), of turns or else real numbers, as `refuse_codes` does."""
    for name, column, turn in zip(names, values.T, turns, strict=True):
        _refuse(codes_among(column, turn), column, name, cure)


def _refuse(codes: Sequence[float], column: Array, name: str, cure: str) -> None:
    if codes:
        raise SettingError(literal(f"column {name!r} has {_counted(codes, column)}: ") + cure)


def _is_beyond_halves(rest: Array, turn: float) -> bool:
    """Return whether different values (M,) have a whole turn, and others keep within -180 to 180."""
    others = rest[rest != turn]
    if turn < 100 or len(others) == len(rest) or len(others) < FEW_VALUES:
        return False
    return float(others.min()) < 0 and float(np.abs(others).max()) <= turn / 2 * (
        1 + TURN_TOLERANCE
    )


def recurs(value: float, distinct: Array, counts: NDArray[np.int64], turn: float) -> bool:
    """Return whether a whole number comes again and again among fractions that hardly repeat there.

    Different values (M,) have their counts (M,).
    """
    own = int(counts[distinct == value].sum())
    others = distinct[distinct != value]
    if (
        own < LEAST_REPEATS
        or len(others) < FEW_VALUES
        or 2 * int(_whole(others).sum()) > len(others)
    ):
        return False
    near = (np.abs(distinct - value) < CODE_GAP * turn) & (distinct != value)
    return own > OFTEN * max(int(counts[near].max(initial=0)), float(np.median(counts)))


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


def _whole(values: Array) -> NDArray[np.bool_]:
    return values == np.round(values)


def _are_whole(values: Array) -> bool:
    return bool(_whole(values).all())


def _counted(codes: Sequence[float], column: Array) -> str:
    """Return codes and how often each is there, in words."""
    often = [int((column == code).sum()) for code in codes]
    words = [f"{code:.10g} in {n} row{'s' * (n > 1)}" for code, n in zip(codes, often, strict=True)]
    listed = words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
    return f"{listed}, which seem{'s' * (len(words) == 1)} to stand for missing values"


LEAST_END, ABOUT_ENDS = 0.05, 0.3
"""Of angles that fill half a turn, the share near each of its ends at least, and the least mean
cosine of twice the angle, where they crowd about both ends as axes do."""

FEW_ROWS = 10
"""Fewer may all be small, or all be alike, by accident."""


class Doubt(NamedTuple):
    """What was decided for the user, in words; a serious one may make all results wrong."""

    text: str
    is_serious: bool


def doubts_of_angle(name: str, column: Array, turn: float) -> list[Doubt]:
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


def doubts_of_number(name: str, column: Array) -> list[Doubt]:
    """Return doubts about a column (N,) of real numbers, of which some may stand for missing ones."""
    distinct, counts = np.unique(column[np.isfinite(column)], return_counts=True)
    found: list[Doubt] = []
    for end in (0, -1):
        rest = np.delete(distinct, end)
        if len(rest) < FEW_VALUES or counts[end] < 2:
            continue
        if float(np.abs(rest - distinct[end]).min()) > LEAST_APART * float(np.ptp(rest)):
            text = (
                f"{name!r} is {distinct[end]:g} in {counts[end]} rows, far from all other values: if "
                "that stands for a missing value, leave these rows out"
            )
            found.append(Doubt(text, True))
    return found


def doubts_of_line(name: str, column: Array) -> list[Doubt]:
    """Return doubts about a column (N,) of real numbers that is to have a density."""
    distinct = np.unique(column[np.isfinite(column)])
    if len(distinct) != 2:
        return doubts_of_number(name, column)
    text = (
        f"{name!r} has two values alone, {distinct[0]:g} and {distinct[1]:g}, as a word such as yes or "
        "no has: a density of real numbers says little of it; make it a covariate, or leave it out"
    )
    return [Doubt(text, True)]


def doubts_of_torus(name: str, column: Array, turn: float) -> list[Doubt]:
    """Return doubts about a column (N,) of angles of a torus: calm winds, defaults, axes."""
    known = column[np.isfinite(column)]
    texts = [_calm(name, known, turn), _zeros(name, known, turn)]
    found = [Doubt(text, True) for text in texts if text is not None]
    axes = _axes(name, known, turn)
    return found if axes is None else [*found, axes]


def _calm(name: str, column: Array, turn: float) -> str | None:
    """Return what to say of directions (N,) in whole tens, as winds are, with both 0 and 360."""
    if turn < 100 or not ((column == 0).any() and (column == turn).any()):
        return None
    if float(column.min()) < 0 or not bool((column % 10 == 0).all()) or len(column) < FEW_ROWS:
        return None
    rows, north, *beside = (int((column == v).sum()) for v in (0, turn, 10, turn - 10))
    usual = sum(beside) / 2
    if rows + north <= usual + 3 * usual**0.5:  # both are north, from rounding without a turn
        return None
    return (
        f"{name!r} has both 0, in {rows} row{'s' * (rows > 1)}, and 360: of winds, 0 usually means "
        "calm and 360 north; leave out what is calm, which has no direction"
    )


def _zeros(name: str, column: Array, turn: float) -> str | None:
    """Return what to say of fractions (N,) that are exactly 0 far more often than near it."""
    rows = int((column == 0).sum())
    if rows < LEAST_REPEATS:
        return None
    values, counts = np.unique(column, return_counts=True)
    often = values[2 * counts >= rows].tolist()
    if [value for value in often if recurs(value, values, counts, turn)] != [0.0]:
        return None
    return (
        f"{name!r} is exactly 0 in {rows} rows, and values near it hardly repeat: if 0 stands for a "
        "missing value there, leave these rows out"
    )


def _axes(name: str, column: Array, turn: float) -> Doubt | None:
    """Return a doubt if angles (N,) fill half a turn alone, as those of lines without an arrow do."""
    named = bool(AXIAL.intersection(words_of(name)))
    if len(column) < (4 if named else FEW_ROWS):
        return None
    half, least, most = turn / 2, float(column.min()), float(column.max())
    starts = [0.0, -half / 2] if named else [0.0]
    slack = half * TURN_TOLERANCE
    start = next((s for s in starts if s - slack <= least and most <= s + half + slack), None)
    if start is None:
        return None
    ends = [np.abs(column - end) <= half / 6 for end in (start, start + half)]
    both = min(float(end.mean()) for end in ends)
    about = float(np.cos(4 * np.pi / turn * (column - start)).mean())
    if not named and not (both >= LEAST_END and about >= ABOUT_ENDS):
        return None
    text = (
        f"{name!r} fills half a turn alone, {start:g} to {start + half:.10g}: if these are lines "
        "without an arrow, whose ends are alike, double the angles, and halve what comes out"
    )
    return Doubt(text, both > 0)


FAR_FROM_NULL = 1.0
"""Degrees from latitude 0, longitude 0 within which there are no other places where these are a gap."""

FULL_SHARE_OF_TURN = 0.75
"""Share of a turn of radians that values fill where they seem to be radians."""


def place_doubts(space: str, values: Array, names: Sequence[str], unit: str | None) -> list[Doubt]:
    """Return doubts about latitudes and longitudes (N, 2) in degrees; refuse radians."""
    known = values[np.isfinite(values).all(axis=1)]
    if len(known) < FEW_ROWS:
        return []
    lat, lon = known.T
    doubts = _null_island(known, names) if space == "sphere" else []
    small = unit is None and _is_small(lat, lon)
    if small and float(np.ptp(lon)) > FULL_SHARE_OF_TURN * 2 * math.pi:
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


def _null_island(known: Array, names: Sequence[str]) -> list[Doubt]:
    """Return a doubt if places (N, 2) far from latitude 0, longitude 0 have it again and again."""
    here = (known == 0).all(axis=1)
    rows, others = int(here.sum()), known[~here]
    if rows < 2 or not len(others) or float(np.abs(others).max(axis=1).min()) < FAR_FROM_NULL:
        return []
    if rows <= int(np.unique(others, axis=0, return_counts=True)[1].max()):
        return []
    text = (
        f"{names[0]} and {names[1]} are both exactly 0 in {rows} rows, far from all others: if that "
        "stands for a missing place, leave these rows out"
    )
    return [Doubt(text, True)]


def _is_small(lat: Array, lon: Array) -> bool:
    """Return whether latitudes and longitudes (N,) may be radians."""
    low, high = float(lon.min()), float(lon.max())
    around = high - low <= 2 * math.pi + TURN_TOLERANCE and max(-low, high) <= 2 * math.pi
    return around and float(np.abs(lat).max()) <= math.pi / 2 + TURN_TOLERANCE


IDENTIFIER_NAMES = frozenset(
    {
        "#",
        "id",
        "idx",
        "index",
        "key",
        "no",
        "no.",
        "nr",
        "number",
        "row",
        "resid",
        "resi",
        "resseq",
    }
)
"""Names of columns that number the rows with any different whole numbers."""

INDEX_NAMES = re.compile(r"|unnamed: \d+|__index_level_\d+__|level_\d+")
"""Names that pandas gives to an index when it writes it: any whole numbers there are no data."""


def is_identifier(name: str, values: Array) -> bool:
    """Return whether a column (N,) numbers the rows, one by one or by its name.

    One that is called after an angle does not.

    >>> is_identifier("item", np.arange(5.0)), is_identifier("item", np.array([1.0, 1.0, 2.0]))
    (True, False)
    >>> is_identifier("phi", np.arange(5.0))
    False
    """
    if len(values) < 3 or not bool((values == np.round(values)).all()) or is_angle_named(name):
        return False
    if bool((np.diff(values) == 1).all()):
        return True
    word = name.strip().casefold()
    if INDEX_NAMES.fullmatch(word):
        return True
    named = word in IDENTIFIER_NAMES or word.endswith(("_id", " id"))
    return named and len(np.unique(values)) == len(values)
