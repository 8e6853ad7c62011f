"""Rows that repeat another: places of their own, or an accident of rounding, which is undone."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.fitting.rounding import (
    FEW_REPEATS_SHARE,
    FEWEST_OF_STEPS,
    FEWEST_VALUES,
    MAX_REPEATS_RATIO,
    Heap,
    are_parts_of,
    coarser_step,
    heap_of,
    known_step,
    share_explained,
    spread_of,
    step_of,
)
from orbiflow.density.inference import chart_of_rows
from orbiflow.density.spaces import Space
from orbiflow.errors import Advice, literal

SAME_PLACE = 1e-13
"""Difference of chart coordinates within which points are the same: far below what kernels resolve."""


def places(points: Tensor) -> tuple[Tensor, Tensor]:
    """Return the number of points (N, d) at each different place (M,), and the place (N,) of each."""
    # rounding keeps together what differs by the projection's last digits
    table = (points.detach().cpu() / SAME_PLACE).round().numpy()
    order = np.lexsort(table.T[::-1])
    ordered = table[order]
    begins = np.ones(len(table), dtype=bool)
    begins[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    number = begins.cumsum() - 1
    place = np.empty_like(number)
    place[order] = number
    return torch.as_tensor(np.bincount(number)), torch.as_tensor(place)


POLE_DEGREES = 1e-6
"""Degrees from a pole within which the longitude is not looked at."""


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
    - `heaps`: Of each column, the values that were rounded more coarsely than the others, if any were.
    - `columns`: Names of the columns.
    """

    rows: int
    places: int
    step: float | None
    explained: float | None
    spread: tuple[float, ...] = ()
    heaps: tuple[Heap | None, ...] = ()
    columns: tuple[str, ...] = ()

    @property
    def is_rounding(self) -> bool:
        """Whether rounding explains the repeats."""
        return self.explained is not None and self.explained * MAX_REPEATS_RATIO >= 1

    @property
    def can_be_undone(self) -> bool:
        """Whether values are rounded so that they can be spread over what they were rounded from."""
        return any(self.spread) or any(self.heaps)

    def taken_for(self, repeats: str) -> str:
        """Return "places" or "rounding" for a setting, which may also be "auto"."""
        if repeats != "auto":
            return repeats
        return "rounding" if self.can_be_undone else "places"

    def notes(self, taken_for: str) -> list[str]:
        """Return what was found and assumed, in words; `taken_for` is "places" or "rounding"."""
        if not self.rows and not self.can_be_undone:
            return []
        assumed = "new rows are taken to repeat them as often ({repeats} rounding: not to)"
        if taken_for == "rounding":
            assumed = "they are taken for an accident: equal rows were held out together"
            if self.can_be_undone:
                assumed = (
                    "they are taken for an accident: each value was spread evenly over its step of "
                    "rounding before the fit ({repeats} places: not to)"
                )
        elif self.can_be_undone:
            assumed = "new rows are taken to be rounded as well ({repeats} rounding: not to)"
        return [Advice(f"{literal(self._found())}; {assumed}")]

    def warnings(self, repeats: str) -> list[str]:
        """Return what to warn of where a setting leaves it to the data what repeats are."""
        if repeats != "auto" or not self.can_be_undone:
            return []
        return [
            f"{self._found()}: each value was spread evenly over its step of rounding before the fit, "
            'so that the density has no peaks at rounded values; repeats="places" fits the values as '
            'they are, repeats="rounding" is this choice without a warning'
        ]

    def _found(self) -> str:
        words = f"{self.rows} of {self.rows + self.places} rows repeat an earlier one"
        if any(self.heaps):
            return f"{words}; {'; '.join(self._heaped())}"
        if self.is_rounding:
            steps = dict.fromkeys(f"{step:g}" for step in (*self.spread, self.step) if step)
            return f"{words}, as many as rounding to {' and '.join(steps)} brings about"
        if any(self.spread):
            named = zip(self.columns, self.spread, strict=True)
            return "; ".join(f"values of {name} are rounded to {s:g}" for name, s in named if s)
        if self.step is not None:
            return f"{words}, far more than rounding to {self.step:g} brings about"
        return f"{words}, and the values are not rounded: they are places of their own"

    def _heaped(self) -> list[str]:
        named = zip(self.columns, self.spread, self.heaps, strict=True)
        return [
            f"some {100 * heap.share:.0f}% of the values of {name} are rounded to {heap.step:g}"
            + (f", the others to {step:g}" if step else "")
            for name, step, heap in named
            if heap
        ]

    def steps_at(self, data: Array, turns: list[float], chance: Array) -> Array:
        """Return the steps (N, k) over which to spread data (N, k).

        Of the values that a heap may have, those are taken for its own whose row has a low `chance`
        (N,), even in [0, 1).
        """
        steps = np.tile(np.array(self.spread), (len(data), 1))
        for k, heap in enumerate(self.heaps):
            if heap:
                heaped = heap.holds(data[:, k], turns[k]) & (chance < heap.of_multiples)
                steps[heaped, k] = heap.step
        return steps


def repeats_of(space: Space, points: Tensor) -> Repeats:
    """Return what repeats among points (N, d).

    Where values are rounded and the density is even over a few steps, as many pairs of rows are equal
    as are exactly one step apart in one direction.
    """
    counts, _ = places(points)
    rows = len(points) - len(counts)
    repeats = Repeats(rows, len(counts), None, None, columns=tuple(space.columns))
    data = _coordinates(space, points)
    if data is None or len(counts) < FEWEST_OF_STEPS:
        return repeats
    turns = [*space.periods]
    steps = [step_of(column, turn) for column, turn in zip(data.T, turns, strict=True)]
    columns = list(zip(data.T, steps, turns, strict=True))
    if len(counts) < FEWEST_VALUES and not all(  # few may be states, but not parts of a turn
        step is not None and known_step(step, turn) > 0 and are_parts_of(column, step, turn)
        for column, step, turn in columns
    ):
        return repeats
    moving = np.ptp(data, axis=0) > 0
    if heaps := _heaps(data, steps, turns):
        spread = [known_step(step, turn) for step, turn in zip(steps, turns, strict=True)]
        return replace(repeats, spread=tuple(spread), heaps=heaps)
    if rows and all(step or not moves for step, moves in zip(steps, moving, strict=True)):
        explained = share_explained(data, steps, turns, moving)
        repeats = replace(repeats, step=max(step or 0.0 for step in steps), explained=explained)
    if (
        repeats.step is not None
        and not repeats.is_rounding
        and rows > FEW_REPEATS_SHARE * len(points)
    ):
        coarse = [
            coarser_step(column, step, max(turns))
            for column, step in zip(data.T, steps, strict=True)
        ]
        again = share_explained(data, coarse, turns, moving)
        twice = replace(repeats, step=max(step or 0.0 for step in coarse), explained=again)
        if twice.is_rounding:
            repeats, steps = twice, coarse
    if rows <= FEW_REPEATS_SHARE * len(points):
        spread = [spread_of(column, step) for column, step in zip(data.T, steps, strict=True)]
    elif repeats.is_rounding:
        spread = [known_step(step, turn) for step, turn in zip(steps, turns, strict=True)]
    else:
        return repeats
    return replace(repeats, spread=tuple(spread))


def _heaps(
    data: Array, steps: list[float | None], turns: list[float]
) -> tuple[Heap | None, ...] | None:
    """Return the heaps of columns of data (N, k), None if there are none or they are places.

    Rows all of whose heaped values are rounded coarsely repeat as often as rounding explains, if they
    repeat at all.
    """
    columns = list(zip(data.T, steps, turns, strict=True))
    heaps = tuple(heap_of(column, step, turn) for column, step, turn in columns)
    inside = np.ones(len(data), dtype=bool)
    for (column, _, turn), heap in zip(columns, heaps, strict=True):
        inside &= True if heap is None else heap.holds(column, turn)
    if not any(heaps) or not inside.any():
        return None
    coarse = [step if heap is None else heap.step for step, heap in zip(steps, heaps, strict=True)]
    some = data[inside]
    moving = np.ptp(some, axis=0) > 0
    if any(moves and not step for step, moves in zip(coarse, moving, strict=True)):
        return heaps  # a column that is not rounded: whole rows do not repeat by rounding
    explained = share_explained(some, coarse, turns, moving)
    return heaps if explained is None or explained * MAX_REPEATS_RATIO >= 1 else None


def spread_evenly(
    space: Space, points: Tensor, found: Repeats, generator: torch.Generator
) -> Tensor:
    """Return points (N, d) whose data are moved at random, by up to half a step of rounding each way.

    The mean log density of such points is at most that of the cells of rounding, so that a density
    fitted to them gains nothing by peaks at the rounded values (Theis, van den Oord and Bethge, A note
    on the evaluation of generative models, 2016). On tori, points may lack angles (NaN).
    """
    data = space.from_chart(points)
    turns = [*space.periods]
    chance = torch.rand(len(points), dtype=torch.float64, generator=generator).numpy()
    noise = torch.rand(len(points), len(turns), dtype=torch.float64, generator=generator) - 0.5
    noise *= torch.as_tensor(found.steps_at(data, turns, chance))
    if space.is_of_angles:
        return space.project(points + noise / noise.new_tensor(turns))
    data += noise.numpy()
    if space.is_round:
        data[:, 0] = data[:, 0].clip(-90, 90)
    return chart_of_rows(space, data, may_lack=bool(space.axes))


def _coordinates(space: Space, points: Tensor) -> Array | None:
    """Return the data (N, k) of points if their columns are coordinates, each rounded by itself."""
    data = space.from_chart(points)
    if not space.has_chart or data.shape[1] != space.dim:
        return None
    if space.is_round:  # at a pole any longitude is as good
        data[abs(data[:, 0]) > 90 - POLE_DEGREES, 1] = 0.0
    return data
