"""What columns seem to be: the words that are printed where nothing says it, to be confirmed.

Columns on which a density depends are the simplest case: each has its role, or is asked for.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.density.data.checks import codes_among
from orbiflow.density.data.frames import as_numbers
from orbiflow.density.data.names import LATITUDES, LONGITUDES
from orbiflow.density.data.roles import AXIAL, WORDS, Asked, Role, role_named
from orbiflow.density.data.table import UndeclaredError, short
from orbiflow.density.data.units import TURN_TOLERANCE, TURNS, foreign_unit, unit_named, words_of
from orbiflow.errors import SettingError, literal
from orbiflow.settings import is_a

FEW_ROWS = 20
"""Fewer may all have words of their own."""


# fmt: off
COUNTS = frozenset((
    "count", "counts", "n", "num", "nobs", "freq", "frequency", "frequencies", "anzahl", "hits",
))
WEIGHTS = frozenset(("weight", "weights", "gewicht"))
OTHERS = frozenset((
    "temp", "temperature", "length", "len", "distance", "dist", "radius", "mass", "speed", "spd",
    "windspeed", "wspd", "ws", "gust", "velocity", "pressure", "humidity", "rain", "precipitation",
    "depth", "height", "width", "size", "area", "volume", "resolution", "occupancy", "score", "energy",
    "charge", "magnitude", "mag", "price", "year", "day", "age", "probability", "density",
))
# fmt: on
"""Words for how often a row was seen or counts, and for other quantities than angles."""

PARTS_OF_VECTORS = frozenset({"sin", "sine", "cos", "cosine", "u", "v"})

TENS_IN_TURN = 36.0


def proposed_role(
    name: str, values: Array, role: Role | None = None, *, by_size: bool = True
) -> str:
    """Return what a column (N,) seems to be, to be confirmed by who knows; `role` may lack its unit.

    Without a word that says so, it is an angle `by_size` alone, or not at all.

    >>> proposed_role("dir", np.array([10.0, 350.0])), proposed_role("speed", np.array([0.5, 22.0]))
    ('angle:degrees', 'positive')
    >>> proposed_role("phase", np.array([0.02, 0.97])), proposed_role("id", np.arange(3.0))
    ('angle:turns', 'ignore')
    """
    finite, words = values[np.isfinite(values)], set(words_of(name))
    role = role or role_named(name)
    if role is not None and not role.lacks_unit:
        return str(role)
    if not len(finite):
        return "ignore"
    if (turn := foreign_unit(name)) is not None:
        return f"cycle:{turn:.10g}"
    low, high = float(finite.min()), float(finite.max())
    are_whole = bool((finite == np.round(finite)).all())
    is_axis = bool(words & AXIAL) if role is None else role.kind == "axial"
    is_angle = role is not None or is_axis or bool(words & (LATITUDES | LONGITUDES))
    if role is None:
        if len(finite) > 2 and bool((np.diff(finite) == 1).all()):
            return "ignore"
        if words & WEIGHTS:
            return "weight"
        if words & COUNTS and are_whole:
            return "count"
    if words & PARTS_OF_VECTORS and not is_angle:
        return "linear"
    if words & PARTS_OF_VECTORS and max(-low, high) <= 1:
        return "ignore"  # the sine of an angle is none
    unit = unit_by_size(finite)
    if by_size and not is_angle and not words & OTHERS and unit not in (None, "turns"):
        is_angle = high - low > (math.pi if unit == "radians" else 90.0)
    if not is_angle:
        return "positive" if low > 0 else "linear"
    if not is_axis and are_whole and low >= 0 and 6 < high <= TENS_IN_TURN and len(finite) > 20:
        return f"cycle:{TENS_IN_TURN:g}"
    kind = "axial" if is_axis and high - low <= 180 else "angle"
    return f"{kind}:{unit_named(name) or unit or 'degrees'}"


def unit_by_size(values: Array) -> str | None:
    """Return the unit that angles (N,) may have by their size, None beyond every turn."""
    finite = values[np.isfinite(values)]
    finite = np.abs(finite[~np.isin(finite, codes_among(finite, TURNS["degrees"]))])
    most = float(finite.max(initial=0.0))
    if most <= 1 and float(np.min(values, initial=0.0)) >= 0:
        return "turns"
    if most <= TURNS["radians"] * (1 + TURN_TOLERANCE):
        return "radians"
    return "degrees" if most <= TURNS["degrees"] * (1 + TURN_TOLERANCE) else None


def undeclared(
    option: str,
    columns: Mapping[str, Array],
    proposal: str,
    cure: str = "",
    where: str = "",
    left: str = "",
) -> UndeclaredError:
    """Return the error that asks for what columns (N,) are, with the words that answer it.

    The `cure` follows these; `left` says what was left out.
    """
    ranges: list[str] = []
    for name, values in columns.items():
        finite = values[np.isfinite(values)]
        range_of = f"{finite.min():.5g} to {finite.max():.5g}" if len(finite) else "no value"
        ranges.append(f"{short(name)} ({range_of})")
    quoted = f"'{proposal}'" if re.search(r"[\s()'°]", proposal) else proposal
    them = "they are" if len(columns) > 1 else "it is"
    return UndeclaredError(
        literal(f"{where}{', '.join(ranges)}: say what {them}; if this is right, declare: ")
        + f"{{{option}}} {literal(quoted)}{cure} (a role is "
        + f"{', '.join(WORDS[: 7 if option == 'given' else None])})"
        + literal(f"; {left}" if left else ""),
        list(columns),
        proposal,
    )


def given_roles(
    names: Sequence[str],
    columns: Mapping[str, NDArray[Any]],
    asked: Asked,
    unit: str | None = None,
    *,
    are_asked: bool = True,
    where: str = "",
    option: str = "given",
) -> dict[str, Role]:
    """Return what columns are on which a density depends, by their names.

    Text is words. Numbers are as declared, or what the table of names says, or asked for; of arrays
    they are real.

    Args:
        names: The columns.
        columns: Their cells (N,).
        asked: What was declared, by names.
        unit: The unit of angles that name none.
        are_asked: Whether to ask what numbers are, as of a table, and not to take them as real.
        where: What messages begin with.
        option: The setting in which they are named.

    Raises:
        UndeclaredError: For columns of which nothing says what they are.
        SettingError: For words that are declared as numbers, and roles that covariates do not have.
    """
    lower = {str(key).casefold(): role for key, role in asked.items()}
    roles: dict[str, Role | None] = {}
    unknown: dict[str, Array] = {}
    for name in names:
        declared, cells = lower.get(name.casefold()), columns[name]
        if declared is not None and declared.is_side:
            raise SettingError(
                f"{{{option}}}: {literal(repr(name))} is declared as {declared.kind}, and a density "
                "may depend on an angle, axial, cycle, linear, positive, bounded or word alone"
            )
        is_text = cells.dtype.kind in "USbO" and any(is_a(c, str | bool) for c in cells.tolist())
        if is_text:
            _check_words(name, cells, declared, where)
            roles[name] = Role("word")
            continue
        values, by_name = as_numbers(cells, repr(name)), role_named(name)
        role = declared or (None if by_name is None or by_name.is_side else by_name)
        role = Role("linear") if role is None and not are_asked else role
        roles[name] = role = role and role.with_unit(unit)
        if role is None or role.lacks_unit:
            unknown[name] = values
    if unknown:
        words = {name: str(role) for name, role in roles.items()}
        for name, values in unknown.items():
            word = proposed_role(name, values, roles[name], by_size=False)
            words[name] = "linear" if Role.of(word).is_side else word
        proposal = ",".join(f"{name}={word}" for name, word in words.items())
        raise undeclared(option, unknown, proposal, where=where)
    return {name: role for name, role in roles.items() if role is not None}


def _check_words(name: str, cells: NDArray[Any], role: Role | None, where: str) -> None:
    """Refuse words that are declared as numbers, and of which nearly every row has one of its own."""
    words = {str(cell) for cell in cells.tolist() if is_a(cell, str | bool)}
    begin = literal(f"{where}column {name!r} has ")
    if role is not None and role.kind != "word":
        raise SettingError(
            f"{begin}{literal(repr(min(words)))}, and is declared as {role}: correct it, or declare "
            "the column as word"
        )
    if len(cells) >= FEW_ROWS and 2 * len(words) > len(cells):
        raise SettingError(
            f"{begin}{len(words)} different words in {len(cells)} rows, such as "
            f"{literal(repr(min(words)))}: a density depends on words that recur; of dates give "
            "numbers, such as the hour or the days since a first one, or leave the column out"
        )
