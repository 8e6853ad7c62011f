"""Numbers that stand for missing values among angles and places, such as 999."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array
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


def codes_among(column: Array, turn: float) -> list[float]:
    """Return values of a column (N,) that seem to stand for missing ones.

    They are numbers such as 999 or -99 far from all others or again and again where others hardly
    repeat, a few numbers beyond a turn that come again and again where other values keep within a turn,
    or 360 where others keep within half a turn either way, as DSSP writes it.

    >>> codes_among(np.array([10.0, 350.0, 20.0, 999.0, 990.0]), 360.0)
    [990.0, 999.0]
    >>> codes_among(np.array([350.0, 1025.0, 700.0, 990.5]), 360.0)
    []
    """
    distinct, counts = np.unique(column[np.isfinite(column)], return_counts=True)
    sizes = np.abs(distinct)
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


def refuse_codes(space: str, values: Array, names: Sequence[str], unit: str, cure: str) -> None:
    """Refuse data (N, k) some of which seem to stand for missing values; `cure` says what to do."""
    if is_angular(space, values.shape[1]):
        refuse_no_angles(values, names, unit, cure)
    elif space in DIRECTIONS and values.shape[1] == 2:
        refuse_no_places(values, names, cure)


def refuse_no_angles(values: Array, names: Sequence[str], unit: str, cure: str) -> None:
    """Refuse angles (N, k) some of which are codes for missing values."""
    for name, column in zip(names, values.T, strict=True):
        if codes := codes_among(column, TURNS[unit]):
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


def refuse_no_places(values: Array, names: Sequence[str], cure: str) -> None:
    """Refuse latitudes and longitudes (N, 2) some of which are codes for missing values."""
    for name, column, most in zip(names, values.T, (90.0, 360.0), strict=True):
        known = np.unique(
            column[np.isfinite(column) & (np.abs(column) > most * (1 + TURN_TOLERANCE))]
        )
        codes = [v for v in known.tolist() if abs(v) in CODES or abs(v) > MAX_ANGLE]
        if codes and len(codes) == len(known):
            raise SettingError(literal(f"column {name!r} has {_counted(codes, column)}: ") + cure)
