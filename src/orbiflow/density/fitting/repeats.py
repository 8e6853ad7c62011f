"""Rows that repeat another: places of their own, or an accident of rounding, which is undone."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.spaces import Space, Torus, whole_turn

SAME = 1e-13
"""Difference of chart coordinates within which points are the same: far below what kernels resolve."""


def places(points: Tensor) -> tuple[Tensor, Tensor]:
    """Return the number of points (N, d) at each different place (M,), and the place (N,) of each."""
    # rounding keeps together what differs by the projection's last digits
    table = (points.detach().cpu() / SAME).round().numpy()
    order = np.lexsort(table.T[::-1])
    ordered = table[order]
    begins = np.ones(len(table), dtype=bool)
    begins[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    number = begins.cumsum() - 1
    place = np.empty_like(number)
    place[order] = number
    return torch.as_tensor(np.bincount(number)), torch.as_tensor(place)


STEPS = tuple(m * 10.0**e for e in range(2, -9, -1) for m in (5, 2, 1))
"""Steps of rounding that are looked for where no two values are one step apart."""

OFF, MOST_OFF = 1e-11, 1e-3
"""Rounding errors of values, relative to the largest, and the largest share of a step they may be."""

MANY = 2.0
"""If there are more than so many times the repeats that rounding explains, they are real."""

PARTS = (16, 24, 32, 36, 48, 64, 72, 120, 144, 180, 240, 360, 720, 1440, 2160, 4320, 10_800, 21_600)
"""Parts of a turn to which directions are rounded before they are rounded again: points of the compass,
hours, degrees, minutes of time and of arc."""

COARSER = 3.0
"""How many times as large as the step of all values such a step is at least."""

FEWEST_VALUES = 8
"""The fewest different values that are taken for rounded, and steps in a turn: fewer may be states."""

ROWS_PER_VALUE = 8
"""Rows for each different value from which a column is rounded coarsely, though no rows repeat."""

POLAR = 1e-6
"""Degrees from a pole within which the longitude is not looked at."""

FEW = 0.01
"""The share of rows that repeat another up to which it does not matter why they do."""


@dataclass(frozen=True)
class Repeats:
    """Rows that repeat another, and how far rounding explains them.

    - `rows`: The number of rows that repeat an earlier one.
    - `places`: The number of different ones.
    - `step`: The largest step to which the columns are rounded, in the data's unit; None if some are
      not rounded.
    - `explained`: The share of pairs of equal rows that rounding explains; None if values are not
      rounded or nothing repeats.
    - `spread`: Of each column, the step of rounding that explains its repeated values, else 0.
    - `columns`: Names of the columns.
    """

    rows: int
    places: int
    step: float | None
    explained: float | None
    spread: tuple[float, ...] = ()
    columns: tuple[str, ...] = ()

    @property
    def is_rounding(self) -> bool:
        """Whether rounding explains the repeats."""
        return self.explained is not None and self.explained * MANY >= 1

    def taken_for(self, repeats: str) -> str:
        """Return "places" or "rounding" for a setting, which may also be "auto"."""
        if repeats != "auto":
            return repeats
        return "rounding" if any(self.spread) else "places"

    def notes(self, taken_for: str) -> list[str]:
        """Return what was found and assumed, in words; `taken_for` is "places" or "rounding"."""
        if not self.rows and not any(self.spread):
            return []
        assumed = "new rows are taken to repeat them as often (--repeats rounding: not to)"
        if taken_for == "rounding":
            assumed = "they are taken for an accident: equal rows were held out together"
            if any(self.spread):
                assumed = (
                    "they are taken for an accident: each value was spread evenly over its step of "
                    "rounding before the fit (--repeats places: not to)"
                )
        elif any(self.spread):
            assumed = "new rows are taken to be rounded as well (--repeats rounding: not to)"
        return [f"{self._found()}; {assumed}"]

    def warnings(self, repeats: str) -> list[str]:
        """Return what to warn of where a setting leaves it to the data what repeats are."""
        if repeats != "auto" or not any(self.spread):
            return []
        return [
            f"{self._found()}: each value was spread evenly over its step of rounding before the fit, "
            'so that the density has no peaks at rounded values; repeats="places" fits the values as '
            'they are, repeats="rounding" is this choice without a warning'
        ]

    def _found(self) -> str:
        found = f"{self.rows} of {self.rows + self.places} rows repeat an earlier one"
        if self.is_rounding:
            steps = dict.fromkeys(f"{step:g}" for step in (*self.spread, self.step) if step)
            return f"{found}, as many as rounding to {' and '.join(steps)} brings about"
        if any(self.spread):
            named = zip(self.columns, self.spread, strict=True)
            return "; ".join(f"values of {name} are rounded to {s:g}" for name, s in named if s)
        if self.step is not None:
            return f"{found}, far more than rounding to {self.step:g} brings about"
        return f"{found}, and the values are not rounded: they are places of their own"


def repeats_of(space: Space, points: Tensor) -> Repeats:
    """Return what repeats among points (N, d).

    Where values are rounded and the density is even over a few steps, as many pairs of rows are equal
    as are exactly one step apart in one direction.
    """
    counts, _ = places(points)
    rows = len(points) - len(counts)
    found = Repeats(rows, len(counts), None, None, columns=tuple(space.columns))
    data = _coordinates(space, points)
    if data is None or len(counts) < FEWEST_VALUES:
        return found
    turns = [_turn(space, k) for k in range(data.shape[1])]
    steps = [_step(own, turn) for own, turn in zip(data.T, turns, strict=True)]
    moving = np.ptp(data, axis=0) > 0
    if rows and all(step or not moves for step, moves in zip(steps, moving, strict=True)):
        explained = _share_explained(data, steps, moving)
        found = replace(found, step=max(step or 0.0 for step in steps), explained=explained)
    if found.step is not None and not found.is_rounding and rows > FEW * len(points):
        coarse = [_coarser(own, step, max(turns)) for own, step in zip(data.T, steps, strict=True)]
        again = _share_explained(data, coarse, moving)
        twice = replace(found, step=max(step or 0.0 for step in coarse), explained=again)
        if twice.is_rounding:
            found, steps = twice, coarse
    if rows <= FEW * len(points):
        spread = [_spread(own, step) for own, step in zip(data.T, steps, strict=True)]
    elif found.is_rounding:
        spread = [_known(step, turn) for step, turn in zip(steps, turns, strict=True)]
    else:
        return found
    return replace(found, spread=tuple(spread))


def spread_evenly(
    space: Space, points: Tensor, steps: tuple[float, ...], generator: torch.Generator
) -> Tensor:
    """Return points (N, d) whose data are moved at random, by up to half a step of rounding each way.

    The mean log density of such points is at most that of the cells of rounding, so that a density
    fitted to them gains nothing by peaks at the rounded values (Theis, van den Oord and Bethge, A note
    on the evaluation of generative models, 2016). On tori, points may lack angles (NaN).
    """
    noise = torch.rand(len(points), len(steps), dtype=torch.float64, generator=generator) - 0.5
    noise *= torch.tensor(steps, dtype=torch.float64)
    if isinstance(space, Torus):
        return space.project(points + noise / space.period)
    data = space.from_chart(points) + noise.numpy()
    if space.is_round:
        data[:, 0] = data[:, 0].clip(-90, 90)
    return space.to_chart(data)


def _coordinates(space: Space, points: Tensor) -> Array | None:
    """Return the data (N, k) of points if their columns are coordinates, each rounded by itself."""
    data = space.from_chart(points)
    if not space.has_chart or data.shape[1] != space.dim:
        return None
    if space.is_round:  # at a pole any longitude is as good
        data[abs(data[:, 0]) > 90 - POLAR, 1] = 0.0
    return data


def _turn(space: Space, number: int) -> float:
    """Return the period of a column of the data, 0 if it has none."""
    if space.is_round:
        return 360.0 * (number == 1)
    return 0.0 if space.unit in (None, "units") else whole_turn(str(space.unit))


def _step(column: Array, turn: float) -> float | None:
    """Return the step of which all values (N,) of a column are multiples, but for one shift of all.

    It is the least or the most usual distance between neighbouring values, or else one of `STEPS`.
    """
    off = OFF * max(1.0, float(abs(column).max()))
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


def _coarser(column: Array, step: float | None, turn: float) -> float | None:
    """Return a larger step of which all values (N,) are multiples but for rounding to `step`.

    Points of the compass in whole degrees are 0, 23, 45, 68 and so on. Where there is none, it is the
    step itself.
    """
    if step is None:
        return None
    values = np.unique(column)
    for coarse in sorted({turn / parts for parts in PARTS} - {0.0}, reverse=True):
        if coarse < COARSER * step:
            break
        if _are_multiples(values, coarse, 0.0, 0.51 * step):
            return coarse
    return step


def _are_multiples(values: Array, step: float, turn: float, off: float) -> bool:
    """Return whether values, or those a turn further, are multiples of a step but for rounding."""
    found = np.zeros(len(values), dtype=bool)
    for turned in {0.0, turn, -turn}:
        count = (values + turned) / step
        found |= abs(count - np.round(count)) * step < off
    return bool(found.all())


def _cells(column: Array, step: float | None) -> NDArray[np.int64]:
    """Return values (N,) of a column in steps, from the least one."""
    return np.rint((column - column.min()) / (step or 1.0)).astype(np.int64)


def _known(step: float | None, turn: float) -> float:
    """Return a step, 0 if there is none or so few in a turn that they may be states."""
    return 0.0 if step is None or 0 < turn < FEWEST_VALUES * step * (1 - 1e-9) else step


def _spread(column: Array, step: float | None) -> float:
    """Return the step over which to spread the values of a column, 0 if it is not rounded coarsely."""
    if step is None:
        return 0.0
    cells = _cells(column, step)
    values = len(np.unique(cells))
    if values < FEWEST_VALUES or len(column) < ROWS_PER_VALUE * values:
        return 0.0
    explained = _explained(cells[:, None])
    return step if explained is not None and explained * MANY >= 1 else 0.0


def _share_explained(
    data: Array, steps: list[float | None], moving: NDArray[np.bool_]
) -> float | None:
    """Return what steps of columns explain of the repeats of data (N, k), as `_explained` does."""
    cells = np.stack([_cells(own, s) for own, s in zip(data.T, steps, strict=True)], axis=1)
    return _explained(cells[:, moving])


def _explained(cells: NDArray[np.int64]) -> float | None:
    """Return the ratio of pairs of rows whose cells (N, k) are one apart to pairs that are equal."""
    cells, number = np.unique(cells, axis=0, return_counts=True)
    equal = float((number * (number - 1) / 2).sum())
    of = {tuple(cell): int(n) for cell, n in zip(cells.tolist(), number, strict=True)}
    apart = 0.0
    for shift in np.eye(cells.shape[1], dtype=np.int64):
        beside = (cells + shift).tolist()
        apart += sum(n * of.get(tuple(m), 0) for n, m in zip(of.values(), beside, strict=True))
    # of n rows in a cell n (n - 1) / 2 pairs are equal, and n m with the m of a cell beside it
    return apart / cells.shape[1] / 2 / equal if equal else None
