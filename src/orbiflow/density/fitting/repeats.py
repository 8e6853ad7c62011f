"""Rows that repeat another: real places, or values that were rounded?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from torch import Tensor

from orbiflow.density.fitting.folds import places
from orbiflow.density.spaces.space import Space
from orbiflow.symmetry.isometry import Array

STEPS = tuple(m * 10.0**e for e in range(2, -7, -1) for m in (5, 2, 1))
"""Of rounding that are looked for."""

MANY = 2.0
"""Times the repeats that rounding explains: more are places of their own."""


@dataclass(frozen=True)
class Repeats:
    """What was found.

    - `rows`: that repeat an earlier row; `places`: different ones.
    - `step`: to which all values are rounded, in the data's unit; None if to none.
    - `explained`: pairs of equal rows that rounding explains, over those there are; None where values
      are not rounded or nothing repeats.
    """

    rows: int
    places: int
    step: float | None
    explained: float | None

    @property
    def is_rounding(self) -> bool:
        """Whether rounding explains the repeats."""
        return self.explained is not None and self.explained * MANY >= 1

    def notes(self, taken_for: str) -> list[str]:
        """What was found and assumed, in words; `taken_for` is "places" or "rounding"."""
        if not self.rows:
            return []
        total = self.rows + self.places
        found = f"{self.rows} of {total} rows repeat an earlier one"
        if self.is_rounding:
            found += f", as many as rounding to {self.step:g} brings about"
        elif self.step is not None:
            found += f", far more than rounding to {self.step:g} brings about"
        else:
            found += ", and the values are not rounded: they are places of their own"
        if taken_for == "places":
            assumed = "new rows are taken to repeat them as often (--repeats rounding: not to)"
        else:
            assumed = "they are taken for an accident: equal rows were held out together"
        return [f"{found}; {assumed}"]


def repeats_of(space: Space, points: Tensor) -> Repeats:
    """What repeats among points (N, d).

    Where values are rounded and the density is even over a few steps, as many pairs of rows are equal
    as are exactly one step apart in one direction.
    """
    counts, _ = places(points)
    rows = len(points) - len(counts)
    data = space.from_chart(points)
    step = _step(data) if rows else None
    explained = None if step is None else _explained(data, step, counts)
    return Repeats(rows, len(counts), step, explained)


def _step(data: Array) -> float | None:
    """The largest of `STEPS` of which all values are multiples, within rounding errors."""
    scale = max(1.0, float(abs(data).max()))
    for step in STEPS:
        tolerance = 1e-9 * scale / step
        if tolerance > 1e-3:
            break
        multiples = data / step
        if bool((abs(multiples - np.round(multiples)) < tolerance).all()):
            return step
    return None


def _explained(data: Array, step: float, counts: Tensor) -> float | None:
    """Pairs one step apart over pairs that are equal."""
    equal = float((counts.double() * (counts - 1) / 2).sum())
    cells, number = np.unique(np.round(data / step).astype(np.int64), axis=0, return_counts=True)
    of = {tuple(cell): int(n) for cell, n in zip(cells.tolist(), number, strict=True)}
    apart = 0.0
    for axis in range(data.shape[1]):
        shift = np.zeros(data.shape[1], dtype=np.int64)
        shift[axis] = 1
        apart += sum(of[c] * of.get(tuple(m), 0) for c, m in _pairs(cells, shift))
    # of n rows in a cell n (n - 1) / 2 pairs are equal, and n m with the m of a cell beside it
    return apart / data.shape[1] / 2 / equal if equal else None


def _pairs(cells: Array, shift: Array) -> list[tuple[tuple[int, ...], list[int]]]:
    moved = (cells + shift).tolist()
    return [(tuple(cell), m) for cell, m in zip(cells.tolist(), moved, strict=True)]
