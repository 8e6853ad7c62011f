"""Steps to which the values of a column are rounded: all of them, or some more coarsely than others."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array

STEPS = tuple(m * 10.0**e for e in range(2, -9, -1) for m in (5, 2, 1))
"""Steps of rounding that are looked for where no two values are one step apart."""

OFF, MOST_OFF = 1e-11, 1e-3
"""Rounding errors of values, relative to the largest, and the largest share of a step they may be."""

MAX_REPEATS_RATIO = 2.0
"""If there are more than so many times the repeats that rounding explains, they are real."""

PARTS_OF_TURN = (
    16,
    24,
    32,
    36,
    48,
    64,
    72,
    120,
    144,
    180,
    240,
    360,
    720,
    1440,
    2160,
    4320,
    10_800,
    21_600,
)
"""Parts of a turn to which directions are rounded before they are rounded again: points of the compass,
hours, degrees, minutes of time and of arc."""

TURN_DEGREES = 360.0
"""The turn of degrees, of which the steps of a heap are whole parts."""

MIN_COARSENING = 3.0
"""How many times as large as the step of all values such a step is at least."""

FEWEST_VALUES = 8
"""The fewest different values that are taken for rounded, and steps in a turn: fewer may be states."""

FEWEST_OF_STEPS = 5
"""The fewest different values of a column that are taken for rounded to whole parts of a turn."""

ROWS_PER_VALUE = 8
"""Rows for each different value from which a column is rounded coarsely, though no rows repeat."""


FEW_REPEATS_SHARE = 0.01
"""The share of rows that repeat another up to which it does not matter why they do."""


def step_of(column: Array, turn: float) -> float | None:
    """Return the step of which all values (N,) of a column are multiples, but for one shift of all.

    It is the least or the most usual distance between neighbouring values, or else one of `STEPS`.
    """
    off = _off(column)
    values = np.unique(column)
    gaps = np.diff(values)
    gaps = gaps[gaps > off / MOST_OFF]
    if not len(gaps):
        return None
    width = float(np.ptp(values))
    for gap in (float(gaps.min()), float(np.median(gaps))):
        count = round(width / gap)
        step = width / count  # which has more digits than the gap
        short = float(f"{step:.9g}")
        step = short if abs(short - step) * count < off else step
        if _are_multiples(values - values[0], step, turn, off):
            return step
    fine = (step for step in STEPS if off / step < MOST_OFF)
    return next((step for step in fine if _are_multiples(values, step, turn, off)), None)


def coarser_step(column: Array, step: float | None, turn: float) -> float | None:
    """Return a larger step of which all values (N,) are multiples but for rounding to `step`.

    Points of the compass in whole degrees are 0, 23, 45, 68 and so on. Where there is none, it is the
    step itself.
    """
    if step is None:
        return None
    values = np.unique(column)
    for coarse in sorted({turn / parts for parts in PARTS_OF_TURN} - {0.0}, reverse=True):
        if coarse < MIN_COARSENING * step:
            break
        if _are_multiples(values, coarse, 0.0, 0.51 * step):
            return coarse
    return step


def _are_multiples(values: Array, step: float, turn: float, off: float) -> bool:
    """Return whether values, or those a turn further, are multiples of a step but for rounding."""
    return bool(_multiples(values, step, turn, off).all())


def _multiples(values: Array, step: float, turn: float, off: float) -> NDArray[np.bool_]:
    """Return which values (N,), or those a turn further, are multiples of a step but for rounding."""
    are_multiples = np.zeros(len(values), dtype=bool)
    turns = {0.0} if turn and _is_whole(turn / step) else {0.0, turn, -turn}
    for turned in turns:
        count = (values + turned) / step
        are_multiples |= abs(count - np.round(count)) * step < off
    return are_multiples


def cells_of(column: Array, step: float | None) -> NDArray[np.int64]:
    """Return values (N,) of a column in steps, from the least one."""
    return np.rint((column - column.min()) / (step or 1.0)).astype(np.int64)


def known_step(step: float | None, turn: float) -> float:
    """Return a step, 0 if there is none or so few in a turn that they may be states."""
    return 0.0 if step is None or 0 < turn < FEWEST_VALUES * step * (1 - 1e-9) else step


def are_parts_of(column: Array, step: float, turn: float) -> bool:
    """Return whether values (N,) are multiples of a step that is a usual part of a turn."""
    is_usual = _is_whole(turn / step) and round(turn / step) in (8, 12, *PARTS_OF_TURN)
    return is_usual and _are_multiples(column, step, turn, _off(column))


def spread_of(column: Array, step: float | None) -> float:
    """Return the step over which to spread the values of a column, 0 if it is not rounded coarsely."""
    if step is None:
        return 0.0
    cells = cells_of(column, step)
    values = len(np.unique(cells))
    if values < FEWEST_VALUES or len(column) < ROWS_PER_VALUE * values:
        return 0.0
    explained = _explained(cells[:, None])
    return step if explained is not None and explained * MAX_REPEATS_RATIO >= 1 else 0.0


def share_explained(
    data: Array, steps: list[float | None], turns: list[float], moving: NDArray[np.bool_]
) -> float | None:
    """Return what steps of columns explain of the repeats of data (N, k), as `_explained` does."""
    around = [
        round(turn / step) if step and _is_whole(turn / step) else 0
        for step, turn in zip(steps, turns, strict=True)
    ]
    cells = np.stack([cells_of(column, s) for column, s in zip(data.T, steps, strict=True)], axis=1)
    return _explained(cells[:, moving], around=np.array(around)[moving])


def _explained(
    cells: NDArray[np.int64], weights: Array | None = None, around: NDArray[np.int64] | None = None
) -> float | None:
    """Return the ratio of pairs of rows whose cells (N, k) are one apart to pairs that are equal.

    Rows may have weights (N,): of each so many are there. The last cell of a column is beside its first
    one if there are so many `around` it (k,), and not 0.
    """
    if around is not None:
        cells = np.where(around > 0, cells % np.maximum(around, 1), cells)
    cells, place = np.unique(cells, axis=0, return_inverse=True)
    number = np.bincount(place.ravel(), weights, minlength=len(cells))
    equal = float((number * (number - 1) / 2).clip(0).sum())
    of = {tuple(cell): n for cell, n in zip(cells.tolist(), number.tolist(), strict=True)}
    apart = 0.0
    for shift in np.eye(cells.shape[1], dtype=np.int64):
        moved = cells + shift
        if around is not None:
            moved = np.where((around > 0) & (moved == around), 0, moved)
        beside = moved.tolist()
        apart += sum(n * of.get(tuple(m), 0) for n, m in zip(of.values(), beside, strict=True))
    # of n rows in a cell n (n - 1) / 2 pairs are equal, and n m with the m of a cell beside it
    return apart / cells.shape[1] / 2 / equal if equal else None


class Heap(NamedTuple):
    """Values that were rounded more coarsely than the others of their column ("heaping").

    - `step`: The step to which they were rounded.
    - `share`: Their share of all values of the column.
    - `of_multiples`: Their share of the values that are multiples of the step.
    """

    step: float
    share: float
    of_multiples: float

    def holds(self, column: Array, turn: float) -> NDArray[np.bool_]:
        """Return which values (N,) are multiples of the step, as all values of the heap are."""
        finite = column[np.isfinite(column)]
        return _multiples(column, self.step, turn, _off(finite))


LEAST_HEAP = 0.05
"""The least share of values that is taken for a heap."""

SURE_HEAP = 6.0
"""Standard errors by which multiples of a step must be more than the values beside them."""

AS_LARGE = 0.9
"""Of several steps, the largest with so much of the largest share is that of the heap."""


def heap_of(column: Array, step: float | None, turn: float) -> Heap | None:
    """Return the values (N,) of a column that were rounded more coarsely than all of them to `step`.

    Of values rounded to 1 as many are 10 as 9 or 11; what exceeds it was rounded to 10. As rounded
    values, and unlike a few places, those of a heap are at neighbouring multiples as often as at one.
    """
    values, counts = np.unique(column, return_counts=True)
    if len(values) < FEWEST_VALUES or len(values) > (1 - LEAST_HEAP) * len(column):
        return None
    heaps: list[Heap] = []
    for coarse in _heap_steps(step, turn, values):
        there = _count_at(values, counts, coarse, turn)
        chance = 0.0
        if step is not None:
            chance = sum(_count_at(values + s, counts, coarse, turn) for s in (-step, step)) / 2
        error = np.sqrt(there + chance / 2)
        if there - chance > max(LEAST_HEAP * len(column), SURE_HEAP * error):
            heaps.append(Heap(coarse, (there - chance) / len(column), 1 - chance / there))
    most = max((heap.share for heap in heaps), default=0.0)
    likely = [heap for heap in heaps if heap.share >= AS_LARGE * most]
    return next((heap for heap in likely if _is_heap(values, counts, step, turn, heap)), None)


def _count_at(values: Array, counts: NDArray[np.int64], step: float, turn: float) -> int:
    """Return how many rows have values (M,), with their counts, that are multiples of a step."""
    return int(counts[_multiples(values, step, turn, _off(values))].sum())


def _heap_steps(step: float | None, turn: float, values: Array) -> list[float]:
    """Return steps, the largest first, of which those of a heap may be multiples of a finer one."""
    finer, width = step or _off(values) / MOST_OFF, float(np.ptp(values))
    steps = {*STEPS, *(turn / parts for parts in (8, 12, *PARTS_OF_TURN))} - {0.0}
    fit = [s for s in steps if 2 * finer <= s * (1 + OFF) and s * (FEWEST_VALUES - 1) <= width]
    if turn == TURN_DEGREES:
        fit = [s for s in fit if _is_whole(turn / s)]
    return sorted((s for s in fit if step is None or _is_whole(s / step)), reverse=True)


def _is_whole(ratio: float) -> bool:
    return abs(ratio - round(ratio)) < MOST_OFF


def _is_heap(
    values: Array, counts: NDArray[np.int64], step: float | None, turn: float, heap: Heap
) -> bool:
    """Return whether rounding explains a heap as well as the other values (M,) with their counts."""
    inside = _multiples(values, heap.step, turn, _off(values))
    coarse = cells_of(values[inside], heap.step)[:, None]
    if len(coarse) < FEWEST_VALUES:
        return False
    heaped = _explained(coarse, counts[inside] * heap.of_multiples)
    if heaped is None or heaped * MAX_REPEATS_RATIO < 1:
        return False
    rest = counts * (1 - inside * heap.of_multiples)
    if step is None or rest.sum() < len(values) * (1 + FEW_REPEATS_SHARE):
        return True
    explained = _explained(cells_of(values, step)[:, None], rest)
    return explained is None or explained * MAX_REPEATS_RATIO >= 1


def _off(values: Array) -> float:
    """Return by how much rounded values (N,) may be off, as floating-point numbers."""
    return OFF * max(1.0, float(abs(values).max()))
