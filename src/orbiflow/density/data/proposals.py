"""What columns seem to be: the words that are printed where nothing says it, to be confirmed."""

from __future__ import annotations

import math
import re

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density.data.checks import codes_among
from orbiflow.density.data.column_names import LATITUDES, LONGITUDES, foreign_unit, words_of
from orbiflow.density.data.roles import Role, role_named
from orbiflow.density.data.units import TURN_TOLERANCE


def lacks_unit(role: Role) -> bool:
    """Return whether a role is an angle or an axis of no unit."""
    return role.kind in ("angle", "axial") and role.unit is None


def turn_of(word: str) -> float | None:
    """Return after what a column of a role begins again."""
    return Role.of(word).turn


def quoted(text: str) -> str:
    """Return what a shell takes as one word."""
    return f"'{text}'" if re.search(r"[\s()'°]", text) else text


def range_of(values: Array) -> str:
    """Return the least and the largest of values (N,), in words."""
    known = values[np.isfinite(values)]
    return f"{known.min():.5g} to {known.max():.5g}" if len(known) else "no value"


# fmt: off
COUNTS = frozenset((
    "count", "counts", "n", "num", "nobs", "freq", "frequency", "frequencies", "anzahl", "hits",
))
OTHERS = frozenset((
    "temp", "temperature", "length", "len", "distance", "dist", "radius", "mass", "speed", "spd",
    "windspeed", "wspd", "ws", "gust", "velocity", "pressure", "humidity", "rain", "precipitation",
    "depth", "height", "width", "size", "area", "volume", "resolution", "occupancy", "score", "energy",
    "charge", "magnitude", "mag", "price", "year", "day", "age", "probability", "density",
))
# fmt: on
"""Words for how often a row was seen, and for other quantities than angles: for proposals alone."""

AXIAL = frozenset(
    {"strike", "strikes", "orientation", "orientations", "axis", "axes", "axial", "fibre", "fibres"}
    | {"fiber", "fibers", "lineation", "lineations", "lineament", "lineaments"}
)
"""Words for lines without an arrow, whose angles come back after half a turn: for proposals alone."""

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
    known, words = values[np.isfinite(values)], set(words_of(name))
    own = role or role_named(name)
    if own is not None and not lacks_unit(own):
        return str(own)
    if not len(known):
        return "ignore"
    if (foreign := foreign_unit(name)) is not None:
        return f"cycle:{foreign:.10g}"
    if own is None and len(known) > 2 and bool((np.diff(known) == 1).all()):
        return "ignore"
    if own is None and words & {"weight", "weights", "gewicht"}:
        return "weight"
    if own is None and words & COUNTS and bool((known == np.round(known)).all()):
        return "count"
    low, high = float(known.min()), float(known.max())
    is_axis = (own is not None and own.kind == "axial") or bool(words & AXIAL)
    is_angle = own is not None or is_axis or bool(words & (LATITUDES | LONGITUDES))
    if words & PARTS_OF_VECTORS and not is_angle:
        return "linear"
    if words & PARTS_OF_VECTORS and max(-low, high) <= 1:
        return "ignore"  # the sine of an angle is none
    unit = unit_by_size(known)
    if by_size and not is_angle and not words & OTHERS and unit is not None:
        wide = math.pi if unit == "radians" else 90.0
        is_angle = unit != "turns" and high - low > wide
    if is_angle:
        whole_tens = (
            low >= 0 and 6 < high <= TENS_IN_TURN and bool((known == np.round(known)).all())
        )
        if whole_tens and not is_axis and len(known) > 20:
            return f"cycle:{TENS_IN_TURN:g}"
        kind = "axial" if is_axis and high - low <= 180 else "angle"
        return f"{kind}:{unit or 'degrees'}"
    return "positive" if low > 0 else "linear"


def unit_by_size(values: Array) -> str | None:
    """Return the unit that angles (N,) may have by their size, None beyond every turn."""
    known = np.abs(values[np.isfinite(values)])
    codes = codes_among(values, 360.0)
    known = known[~np.isin(known, np.abs(codes))] if codes else known
    most = float(known.max(initial=0.0))
    if most <= 1 and float(np.min(values, initial=0.0)) >= 0:
        return "turns"
    if most <= 2 * math.pi * (1 + TURN_TOLERANCE):
        return "radians"
    return "degrees" if most <= 360 * (1 + TURN_TOLERANCE) else None
