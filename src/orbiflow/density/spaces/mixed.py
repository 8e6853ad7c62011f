"""Angles beside columns with periods of their own, and real ones: lines that close at infinity."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.data import Role, written_from_zero
from orbiflow.density.spaces.checked import checked_table
from orbiflow.density.spaces.flat import Torus, whole_turn
from orbiflow.density.spaces.lines import LEAST_REST, SCALES, Line, share_at, turns_at
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_number

Axis = Sequence[Any] | float | None
"""A column: an angle (None), one with a period of its own, or the centre and scale of a real one."""


def _checked_axis(own: Any) -> Line | float | None:
    if own is None or isinstance(own, str) or np.ndim(own):
        return None if own is None else Line.checked(own)
    period = as_number(own, "the period of a column")
    if not 0 < period < math.inf:
        raise OrbiflowError(f"a period must be above 0, got {period}")
    return period


WIDE = 0.5
"""Deviation of logarithms from which a column is too skew to be drawn over four on each side."""


class MixedTorus(Torus):
    """Several columns, each periodic or a real number; the natural measure is the product of all.

    A real column y becomes the point F((y - centre) / scale) of a circle, with F the distribution
    function of Student's t with four degrees of freedom, so that all that is there for tori is there
    for it. Of columns above 0 it is the logarithm that becomes so, of bounded ones the logarithm of
    (y - low) / (high - y). Densities on the circle are densities on the line, exactly normalised over
    all that the column can be: no value there is out of range, and no mass elsewhere. The circle's
    uniform distribution is that Student's t, whose tails are heavy enough for most data and whose
    variance is finite; `measure="uniform"` compares with it.

    Args:
        axes: For each column None, if it is an angle, its period, such as 24 of hours, or what a real
            one is: its centre and scale, those of logarithms with "positive", (0.7, 2.0, "positive"),
            or with "bounded" and two ends. See `Line`.
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
        cls, data: Array, roles: Sequence[Role], names: Sequence[str], *, unit: str = "radians"
    ) -> Self:
        """Return the space of data (N, k) of these roles: angles, axes, cycles and real numbers.

        Columns with a period of their own are written from 0 unless something in them is negative.
        """
        axes: list[Axis] = []
        from_zero: list[int] = []
        for k, (column, role) in enumerate(zip(data.T, roles, strict=True)):
            is_angle = role.kind == "angle" and role.unit in (None, unit)
            turn = whole_turn(unit) if is_angle else role.turn
            if turn is None:
                axes.append(Line.of(column, names[k], role))
                continue
            axes.append(None if is_angle else turn)
            if written_from_zero(column[:, None], turn) if is_angle else not (column < 0).any():
                from_zero.append(k)
        return cls(axes, unit=unit, from_zero=from_zero)

    @classmethod
    def for_data(cls, data: Array, *, unit: str = "radians", seed: int = 0) -> Self:
        del data, unit, seed
        raise OrbiflowError("declare the columns: which are angles, and which are real")

    @property
    def is_surface(self) -> bool:
        return False

    @property
    def dimensions(self) -> str:
        return f"{self.dim}, and not of angles alone"

    @property
    def data_name(self) -> str:
        return "torus"

    def roles(self, width: int) -> tuple[Role | None, ...]:
        del width
        periods = map(self.period_of, range(self.dim))
        return tuple(
            Role("angle", str(self.unit))
            if is_angle
            else Role("cycle", period=period)
            if line is None
            else line.role
            for line, is_angle, period in zip(self.lines, self.is_angle, periods, strict=True)
        )

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
        turns = turns - turns.detach().floor()
        rest = (1 - share_at(turns) ** 2).clamp_min(LEAST_REST)
        found = (8 / 3 * self._scale.to(points)).log() - 2.5 * rest.log()
        lines = [line for line in self.lines if line is not None]
        if all(line.kind == "linear" for line in lines):
            return found
        slopes = [line.log_slope(line.along_turns(turns[..., k])) for k, line in enumerate(lines)]
        return found + torch.stack(slopes, dim=-1)

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
                along = own.along_turns(torch.tensor(found[..., axis]))
                found[..., axis] = own.value_at(along).numpy()
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
        """Return even values (count,) of a column; of a real one, over four deviations on each side.

        Of positive ones that spread over several powers of ten, over two above the middle.
        """
        line = self.lines[axis]
        if line is None:
            return super().even_line(axis, count)
        deviation = line.scale / SCALES
        above = 2 if line.kind == "positive" and deviation > WIDE else 4
        ends = torch.tensor([line.centre - 4 * deviation, line.centre + above * deviation])
        low, high = (float(end) for end in line.value_at(ends.double()))
        return np.linspace(low, high, count)

    def of_axes(self, axes: Sequence[int]) -> Torus:
        kept = [self.axes[axis] for axis in axes]
        if not any(kept):
            return super().of_axes(axes)
        return MixedTorus(kept, unit=str(self.unit), from_zero=self.from_zero_of(axes))

    def step_angle(self, step: float) -> float:
        lines = enumerate(self.lines)
        sides = [self.period_of(k) if own is None else self._side(own) for k, own in lines]
        return 2 * math.pi * step / max(sides)

    @staticmethod
    def _side(line: Line) -> float:
        """Return a turn of the line's circle, at the middle, in the column's unit."""
        middle = torch.tensor(line.centre, dtype=torch.float64)
        return 8 / 3 * line.scale * float(line.log_slope(middle).exp())

    def settings(self) -> dict[str, Any]:
        axes = [own.to_json() if isinstance(own, Line) else own for own in self.axes]
        return {"axes": axes, "unit": self.unit, "from_zero": list(self.from_zero)}
