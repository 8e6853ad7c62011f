"""Angles beside columns with periods of their own, and real ones: lines that close at infinity."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Self

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.data import written_from_zero
from orbiflow.density.spaces.flat import Torus, whole_turn
from orbiflow.density.spaces.space import checked_table
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_array, as_number

SCALES = 2.5
"""The scale of a line, in deviations of its data: what is normal is then nearly von Mises."""

LEAST_REST = 1e-12
"""The least 1 - v^2, with v = z / sqrt(4 + z^2): a million scales from the centre."""

MIDDLE = 0.6827
"""The share of normal data that lie within one deviation of the middle."""


LARGE = 1e9
"""Numbers from here on may differ by less than is seen beside them."""


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

    def share(self, values: Tensor) -> Tensor:
        """Return v = z / sqrt(4 + z^2) of values in any shape, from -1 to 1, with z in scales."""
        away = (values - self.centre) / self.scale
        return away / (4 + away**2).sqrt()

    @classmethod
    def of(cls, values: Array, name: str) -> Line:
        """Return the line that suits a column (N,) of data, by its quantiles."""
        known = values[np.isfinite(values)]
        low, middle, high = np.quantile(known, [(1 - MIDDLE) / 2, 0.5, (1 + MIDDLE) / 2])
        spread = float(high - low) / 2 or float(known.std())
        if not spread > 1e-12 * abs(float(middle)):
            if abs(middle) < LARGE:
                raise OrbiflowError(f"{name} has one value alone: leave it out")
            raise OrbiflowError(
                f"the differences of {name} are lost beside its size, {middle:.3g}: subtract its least "
                "value first, or leave it out if it has one value alone"
            )
        return cls(float(middle), SCALES * spread)


def turns_at(share: Tensor) -> Tensor:
    """Return the turns of shares v of `Line.share`: Student's distribution function."""
    return 0.5 + (3 * share - share**3) / 4


Axis = Sequence[float] | float | None
"""A column: an angle (None), one with a period of its own, or the centre and scale of a real one."""


def _checked_axis(own: Any) -> Line | float | None:
    if own is None or isinstance(own, str) or np.ndim(own):
        return None if own is None else Line.checked(own)
    period = as_number(own, "the period of a column")
    if not 0 < period < math.inf:
        raise OrbiflowError(f"a period must be above 0, got {period}")
    return period


def _share(turns: Tensor) -> Tensor:
    """Return v = z / sqrt(4 + z^2) for u = F(z) in [0, 1): the root of 3 v - v^3 = 2 (2 u - 1)."""
    return 2 * ((2 * turns - 1).asin() / 3).sin()


class MixedTorus(Torus):
    """Several columns, each periodic or a real number; the natural measure is the product of all.

    A real column y becomes the point F((y - centre) / scale) of a circle, with F the distribution
    function of Student's t with four degrees of freedom, so that all that is there for tori is there
    for it. Densities on the circle are densities on the line, exactly normalised over all reals: no
    value is out of range. The circle's uniform distribution is that Student's t, whose tails are
    heavy enough for most data and whose variance is finite; `measure="uniform"` compares with it.

    Args:
        axes: For each column None, if it is an angle, its period, such as 24 of hours, or the centre
            and scale of a real one.
        unit: The unit of the angles, "radians", "degrees" or "turns".
        from_zero: Angles and periodic columns that are written from 0, as in `Torus`. Default: those
            that have a period of their own.

    >>> space = MixedTorus([None, (10.0, 2.0)], unit="degrees")
    >>> space.to_chart([[90.0, 12.0]]).numpy().round(4).tolist()
    [[0.25, 0.813]]
    >>> space.from_chart(torch.tensor([[0.25, 0.5]])).tolist()
    [[90.0, 10.0]]
    """

    name = "mixed"

    def __init__(
        self, axes: Sequence[Axis], *, unit: str = "radians", from_zero: Sequence[int] | None = None
    ) -> None:
        self.axes = tuple(map(_checked_axis, axes))
        if from_zero is None:
            from_zero = [k for k, own in enumerate(self.axes) if isinstance(own, float)]
        super().__init__(len(self.axes), unit=unit, from_zero=from_zero)
        lines = [own if isinstance(own, Line) else None for own in self.axes]
        self.lines = tuple(lines)
        self.is_real = np.array([own is not None for own in lines])
        self.is_angle = np.array([own is None for own in self.axes])
        self._centre, self._scale = (
            torch.tensor([own[k] for own in lines if own is not None], dtype=torch.float64)
            for k in (0, 1)
        )

    @classmethod
    def for_columns(
        cls,
        data: Array,
        periods: Mapping[int, float | None],
        names: Sequence[str],
        *,
        unit: str = "radians",
    ) -> Self:
        """Return the space of data (N, k), of which columns have periods by their numbers.

        None is that of a real column; those without one are angles. Columns with periods are written
        from 0 unless something in them is negative.
        """

        def axis(k: int) -> Axis:
            own = periods.get(k)
            return Line.of(data[:, k], names[k]) if k in periods and own is None else own

        from_zero = [k for k in written_from_zero(data, whole_turn(unit)) if k not in periods]
        from_zero += [k for k, own in periods.items() if own and not (data[:, k] < 0).any()]
        return cls([axis(k) for k in range(data.shape[1])], unit=unit, from_zero=from_zero)

    @classmethod
    def for_data(cls, data: Array, *, unit: str = "radians", seed: int = 0) -> Self:
        del data, unit, seed
        raise OrbiflowError("name the real columns: on a torus give {linear}")

    @property
    def is_surface(self) -> bool:
        return False

    @property
    def dimensions(self) -> str:
        return f"{self.dim}, and not of angles alone"

    @property
    def data_name(self) -> str:
        return "torus"

    @property
    def volume(self) -> float:
        """Infinite where a column is real."""
        return math.prod(self.period_of(axis) or math.inf for axis in range(self.dim))

    def log_area(self, points: Tensor) -> Tensor:
        periods = [self.period_of(axis) for axis in np.flatnonzero(~self.is_real).tolist()]
        return self._log_stretch(points).sum(dim=-1) + sum(map(math.log, periods))

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
            return values / self.period_of(axis)
        return turns_at(line.share(values))

    def from_chart(self, points: Tensor) -> Array:
        """Return angles as `Torus` does, and other columns in their own units: (N, dim).

        Those of a period of their own begin where angles do, at 0 or minus half of it.
        """
        found = self._own_turns(points)
        for axis, own in enumerate(self.axes):
            if isinstance(own, Line):
                share = _share(torch.tensor(found[..., axis])).numpy()
                away = 2 * share / np.sqrt(np.maximum(1 - share**2, LEAST_REST))
                found[..., axis] = own.centre + own.scale * away
            else:
                found[..., axis] *= self.period_of(axis)
        return found

    def data_gradient(self, data: ArrayLike, points: Tensor, gradient: Tensor) -> Array:
        del data
        found = gradient.numpy() / [self.period_of(axis) or 1.0 for axis in range(self.dim)]
        real = torch.as_tensor(self.is_real)
        found[..., self.is_real] = (gradient[..., real] / self._log_stretch(points).exp()).numpy()
        return found

    def period_of(self, axis: int) -> float:
        own = self.axes[axis]
        return self.period if own is None else 0.0 if isinstance(own, Line) else own

    def first_turn(self, axis: int) -> float:
        return 0.0 if self.is_real[axis] else super().first_turn(axis)

    def even_line(self, axis: int, count: int) -> Array:
        """Return even values (count,) of a column; of a real one, over four deviations on each side."""
        line = self.lines[axis]
        if line is None:
            return super().even_line(axis, count)
        return line.centre + 4 * line.scale / SCALES * np.linspace(-1, 1, count)

    def of_axes(self, axes: Sequence[int]) -> Torus:
        kept = [self.axes[axis] for axis in axes]
        if not any(kept):
            return super().of_axes(axes)
        return MixedTorus(kept, unit=str(self.unit), from_zero=self.from_zero_of(axes))

    def step_angle(self, step: float) -> float:
        lines = enumerate(self.lines)
        sides = [self.period_of(k) if own is None else 8 / 3 * own.scale for k, own in lines]
        return 2 * math.pi * step / max(sides)

    def settings(self) -> dict[str, Any]:
        axes = [list(own) if isinstance(own, Line) else own for own in self.axes]
        return {"axes": axes, "unit": self.unit, "from_zero": list(self.from_zero)}
