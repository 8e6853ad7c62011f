"""What makes one doubt a column of angles: its name, or values that angles seldom have."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density.data.codes import LEAST_REPEATS, recurs
from orbiflow.density.data.names import AXIAL, is_count_named, is_other_quantity, words_of
from orbiflow.density.data.units import TURN_TOLERANCE

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
