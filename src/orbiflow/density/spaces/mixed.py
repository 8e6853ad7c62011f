"""Angles beside real columns: a torus, of which some circles are lines that close at infinity."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.arguments import as_array
from orbiflow.arrays import Array
from orbiflow.density.spaces.flat import Torus
from orbiflow.density.spaces.space import checked_table
from orbiflow.errors import OrbiflowError

SCALES = 2.5
"""The scale of a line, in deviations of its data: what is normal is then nearly von Mises."""

LEAST_REST = 1e-12
"""The least 1 - v^2, with v = z / sqrt(4 + z^2): a million scales from the centre."""

MIDDLE = 0.6827
"""The share of normal data that lie within one deviation of the middle."""


class Line(NamedTuple):
    """A real column: the value at the middle of its circle, and that which is a quarter beyond."""

    centre: float
    scale: float

    @classmethod
    def checked(cls, own: Any) -> Line:
        """Return a line of two numbers, the second above 0."""
        values = as_array(own, "the centre and scale of a real column", (2,)).tolist()
        if not (math.isfinite(values[0]) and 0 < values[1] < math.inf):
            raise OrbiflowError(f"a real column needs a centre and a scale above 0, got {values}")
        return cls(*values)

    @classmethod
    def of(cls, values: Array, name: str) -> Line:
        """Return the line that suits a column (N,) of data, by its quantiles."""
        known = values[np.isfinite(values)]
        low, middle, high = np.quantile(known, [(1 - MIDDLE) / 2, 0.5, (1 + MIDDLE) / 2])
        spread = float(high - low) / 2 or float(known.std())
        if not spread > 1e-12 * abs(float(middle)):
            raise OrbiflowError(f"{name} has one value alone: leave it out")
        return cls(float(middle), SCALES * spread)


def _share(turns: Tensor) -> Tensor:
    """Return v = z / sqrt(4 + z^2) for u = F(z) in [0, 1): the root of 3 v - v^3 = 2 (2 u - 1)."""
    return 2 * ((2 * turns - 1).asin() / 3).sin()


class MixedTorus(Torus):
    """Several columns, each an angle or a real number; the natural measure is the product of all.

    A real column y becomes the point F((y - centre) / scale) of a circle, with F the distribution
    function of Student's t with four degrees of freedom, so that all that is there for tori is there
    for it. Densities on the circle are densities on the line, exactly normalised over all reals: no
    value is out of range. The circle's uniform distribution is that Student's t, whose tails are
    heavy enough for most data and whose variance is finite; `measure="uniform"` compares with it.

    Args:
        axes: For each column None, if it is an angle, or the centre and scale of a real one.
        unit: The unit of the angles, "radians", "degrees" or "turns".

    >>> space = MixedTorus([None, (10.0, 2.0)], unit="degrees")
    >>> space.to_chart([[90.0, 12.0]]).numpy().round(4).tolist()
    [[0.25, 0.813]]
    >>> space.from_chart(torch.tensor([[0.25, 0.5]])).tolist()
    [[90.0, 10.0]]
    """

    name = "mixed"

    def __init__(self, axes: Sequence[Sequence[float] | None], *, unit: str = "radians") -> None:
        lines = [None if own is None else Line.checked(own) for own in axes]
        super().__init__(len(lines), unit=unit)
        self.lines = tuple(lines)
        self.is_real = np.array([own is not None for own in lines])
        self._centre, self._scale = (
            torch.tensor([own[k] for own in lines if own is not None], dtype=torch.float64)
            for k in (0, 1)
        )

    @classmethod
    def for_columns(
        cls, data: Array, real: Sequence[int], names: Sequence[str], *, unit: str = "radians"
    ) -> Self:
        """Return the space of data (N, k), of which the columns with these numbers are real."""
        axes = [Line.of(data[:, k], names[k]) if k in real else None for k in range(data.shape[1])]
        return cls(axes, unit=unit)

    @classmethod
    def for_data(cls, data: Array, *, unit: str = "radians", seed: int = 0) -> Self:
        del data, unit, seed
        raise OrbiflowError("name the real columns: on a torus give {linear}")

    @property
    def is_surface(self) -> bool:
        return False

    @property
    def data_name(self) -> str:
        return "torus"

    @property
    def volume(self) -> float:
        """Infinite where a column is real."""
        return math.inf if self.is_real.any() else super().volume

    def log_area(self, points: Tensor) -> Tensor:
        angles = int((~self.is_real).sum()) * math.log(self.period)
        return self._log_stretch(points).sum(dim=-1) + angles

    def _log_stretch(self, points: Tensor) -> Tensor:
        """Return the logarithms (..., R) of the derivatives of real columns by their turns."""
        turns = points[..., torch.as_tensor(self.is_real)]
        rest = 1 - _share(turns - turns.detach().floor()) ** 2
        return (8 / 3 * self._scale.to(points)).log() - 2.5 * rest.clamp_min(LEAST_REST).log()

    def log_density_factor(self, points: Tensor, measure: str) -> Tensor:
        none = torch.zeros_like(points[..., 0])
        return none if measure == "uniform" else super().log_density_factor(points, measure)

    def cover(self, data: ArrayLike) -> Tensor:
        table = checked_table(data, (self.dim,), f"{self.dim} columns")
        return torch.stack(
            [self.turns(axis, torch.tensor(own)) for axis, own in enumerate(table.T)], dim=-1
        )

    def turns(self, axis: int, values: Tensor) -> Tensor:
        line = self.lines[axis]
        if line is None:
            return super().turns(axis, values)
        away = (values - line.centre) / line.scale
        share = away / (4 + away**2).sqrt()
        return 0.5 + (3 * share - share**3) / 4

    def from_chart(self, points: Tensor) -> Array:
        """Return angles in [-1/2, 1/2) turns, and real columns in their own units: (N, dim)."""
        found = super().from_chart(points)
        x = self._checked(points).detach().double().cpu().numpy()
        for axis, line in enumerate(self.lines):
            if line is not None:
                share = _share(torch.tensor(x[..., axis] - np.floor(x[..., axis]))).numpy()
                away = 2 * share / np.sqrt(np.maximum(1 - share**2, LEAST_REST))
                found[..., axis] = line.centre + line.scale * away
        return found

    def data_gradient(self, data: ArrayLike, points: Tensor, gradient: Tensor) -> Array:
        found = super().data_gradient(data, points, gradient)
        real = torch.as_tensor(self.is_real)
        found[..., self.is_real] = (gradient[..., real] / self._log_stretch(points).exp()).numpy()
        return found

    def period_of(self, axis: int) -> float:
        return self.period if self.lines[axis] is None else 0.0

    def even_line(self, axis: int, count: int) -> Array:
        """Return even values (count,) of a column; of a real one, over four deviations on each side."""
        line = self.lines[axis]
        if line is None:
            return super().even_line(axis, count)
        return line.centre + 4 * line.scale / SCALES * np.linspace(-1, 1, count)

    def of_axes(self, axes: Sequence[int]) -> Torus:
        kept = [self.lines[axis] for axis in axes]
        return MixedTorus(kept, unit=str(self.unit)) if any(kept) else super().of_axes(axes)

    def step_angle(self, step: float) -> float:
        sides = [self.period if own is None else 8 / 3 * own.scale for own in self.lines]
        return 2 * math.pi * step / max(sides)

    def settings(self) -> dict[str, Any]:
        axes = [None if own is None else list(own) for own in self.lines]
        return {"axes": axes, "unit": self.unit}
