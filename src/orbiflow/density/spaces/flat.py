"""Products of circles and lines, and the Klein bottle, for data that are angles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.data import Role, written_from_zero
from orbiflow.density.spaces.axes import Axis, Circle, Line, axis_of, whole_turn
from orbiflow.density.spaces.checked import checked_table
from orbiflow.density.spaces.space import Space, check_measure, named_group
from orbiflow.settings import as_whole
from orbiflow.symmetry import CrystallographicGroup

MAX_DIM = 64


@lru_cache(maxsize=16)
def _lattice_group(dim: int) -> CrystallographicGroup:
    return CrystallographicGroup.generate(np.eye(dim), name="p1")


class _AngleSpace(Space):
    """A space whose data are angles, all in one unit."""

    has_square = True

    def __init__(self, *, unit: str = "radians") -> None:
        self.period = whole_turn(unit)
        self.unit = unit

    def to_chart(self, data: ArrayLike) -> Tensor:
        return self.project(self.cover(data))

    @property
    def periods(self) -> tuple[float, ...]:
        return (self.period,) * self.dim

    def step_angle(self, step: float) -> float:
        return 2 * math.pi * step / self.period

    def data_unit(self, width: int) -> str | None:
        del width
        return self.unit

    def settings(self) -> dict[str, Any]:
        return {"unit": self.unit}


class Torus(_AngleSpace):
    """The product of circles and lines: angles, columns with periods of their own, and real ones.

    The natural measure is the product of all columns' units. `measure="uniform"` compares real columns
    with Student's t with four degrees of freedom (`Line`). No value of a real column is out of range,
    and no mass is where none can be.

    Args:
        axes: The number of angles, 1 to 64; or for each column None, if it is an angle, its period,
            such as 24 of hours, or what a real one is: its centre and scale, those of logarithms with
            "positive", (0.7, 2.0, "positive"), or with "bounded" and two ends. See `Line`.
        unit: Unit of the angles, "radians", "degrees" or "turns". Angles may be any real numbers.
        from_zero: Numbers from 0 of the circles that are written from 0 to a whole turn; all others are
            from minus half a turn. Spaces that differ in this alone are equal. Default: columns with a
            period of their own.

    >>> space = Torus(2, unit="degrees")
    >>> space.to_chart([[90.0, -90.0]]).tolist()
    [[0.25, 0.75]]
    >>> space = Torus([None, (10.0, 2.0)], unit="degrees")
    >>> space.to_chart([[90.0, 12.0]]).numpy().round(4).tolist()
    [[0.25, 0.813]]
    >>> space.from_chart(torch.tensor([[0.25, 0.5]])).tolist()
    [[90.0, 10.0]]
    """

    name = "torus"

    def __init__(
        self,
        axes: int | Sequence[Any] = 2,
        *,
        unit: str = "radians",
        from_zero: Sequence[int] | None = None,
    ) -> None:
        super().__init__(unit=unit)
        listed: Sequence[Any] = (
            axes if isinstance(axes, list | tuple) else [None] * as_whole(axes, "axes", 1, MAX_DIM)
        )
        dim = as_whole(len(listed), "the number of axes", 1, MAX_DIM)
        checked = [axis_of(axis, unit) for axis in listed]
        if from_zero is not None:
            numbers = {as_whole(axis, "from_zero", 0, dim - 1) for axis in from_zero}
            checked = [
                axis if isinstance(axis, Line) else axis._replace(from_zero=k in numbers)
                for k, axis in enumerate(checked)
            ]
        self.axes = tuple(checked)
        self.group = named_group("torus") if dim == 2 else _lattice_group(dim)
        self.columns = tuple(f"angle{k + 1}" for k in range(dim))

    @classmethod
    def for_data(cls, data: Array, *, unit: str = "radians", seed: int = 0) -> Self:
        del seed
        return cls(data.shape[1], unit=unit, from_zero=written_from_zero(data, whole_turn(unit)))

    @classmethod
    def for_columns(
        cls, data: Array, roles: Sequence[Role], names: Sequence[str], *, unit: str = "radians"
    ) -> Self:
        """Return the space of data (N, k) of these roles: angles, axes, cycles and real numbers.

        Columns with a period of their own are written from 0 unless something in them is negative.
        """
        axes: list[Axis] = []
        for column, name, role in zip(data.T, names, roles, strict=True):
            is_angle = role.kind == "angle" and role.unit in (None, unit)
            turn = whole_turn(unit) if is_angle else role.turn
            if turn is None:
                axes.append(Line.of(column, name, role))
            elif is_angle:
                from_zero = bool(written_from_zero(column[:, None], turn))
                axes.append(Circle(turn, unit, from_zero))
            else:
                axes.append(Circle(turn, from_zero=not (column < 0).any()))
        return cls(axes, unit=unit)

    @property
    def is_of_angles(self) -> bool:
        return all(axis.is_angle for axis in self.axes)

    @property
    def is_surface(self) -> bool:
        return self.is_planar and self.is_of_angles

    @property
    def dimensions(self) -> str:
        return str(self.dim) if self.is_of_angles else f"{self.dim}, and not of angles alone"

    def roles(self, width: int) -> tuple[Role | None, ...]:
        del width
        return tuple(axis.role for axis in self.axes)

    @property
    def periods(self) -> tuple[float, ...]:
        return tuple(axis.period for axis in self.axes)

    @property
    def volume(self) -> float:
        """Infinite where a column is real."""
        return math.prod(axis.period or math.inf for axis in self.axes)

    def _log_stretches(self, points: Tensor) -> Tensor:
        """Return the logarithms (..., d) of the derivatives of columns by their turns."""
        columns = zip(self.axes, points.unbind(dim=-1), strict=True)
        return torch.stack([axis.log_stretch(turns) for axis, turns in columns], dim=-1)

    def log_area(self, points: Tensor) -> Tensor:
        return self._log_stretches(points).sum(dim=-1)

    def log_density_factor(self, points: Tensor, measure: str) -> Tensor:
        check_measure(measure)
        if measure == "natural":
            return -self.log_area(points)
        return torch.zeros_like(points[..., 0])

    def cover(self, data: ArrayLike) -> Tensor:
        what = "angles" if self.is_of_angles else "columns"
        table = torch.tensor(checked_table(data, (self.dim,), f"{self.dim} {what}"))
        columns = zip(self.axes, table.unbind(dim=-1), strict=True)
        return torch.stack([axis.turns(column) for axis, column in columns], dim=-1)

    @property
    def together(self) -> int:
        return 0

    def of_axes(self, axes: Sequence[int]) -> Torus:
        return Torus([self.axes[axis] for axis in axes], unit=str(self.unit))

    def data_gradient(self, data: ArrayLike, points: Tensor, gradient: Tensor) -> Array:
        del data
        return (gradient / self._log_stretches(points).exp()).numpy()

    def from_chart(self, points: Tensor) -> Array:
        """Return columns (N, dim) in their own units.

        Angles, and columns with a period of their own, are in [-1/2, 1/2) turns, or in [0, 1) turns
        where they are written from 0.
        """
        x = self._checked(points).detach().double().cpu()
        first = x.new_tensor([axis.first_turn for axis in self.axes])
        columns = zip(self.axes, (x - (x - first).floor()).unbind(dim=-1), strict=True)
        return torch.stack([axis.values(turns) for axis, turns in columns], dim=-1).numpy()

    def project(self, points: Tensor) -> Tensor:
        points = self._checked(points)
        return points - points.detach().floor()

    def displacement(self, start: Tensor, end: Tensor) -> Tensor:
        # exact in any dimension, where the images are 3^d
        difference = end - start
        return difference - difference.detach().round()

    def step_angle(self, step: float) -> float:
        return 2 * math.pi * step / max(axis.side for axis in self.axes)

    def settings(self) -> dict[str, Any]:
        axes = self.dim if self.is_of_angles else [axis.to_json() for axis in self.axes]
        from_zero = [k for k, axis in enumerate(self.axes) if axis.from_zero]
        usual = [k for k, axis in enumerate(self.axes) if axis.period and not axis.is_angle]
        kept = {} if from_zero == usual else {"from_zero": from_zero}
        return {"axes": axes, **super().settings(), **kept}


class KleinBottle(_AngleSpace):
    """The Klein bottle of angles with (theta + pi, pi - phi) ~ (theta, phi), both of period 2 pi.

    These are the coordinates of 3 x 3 image patches cos(phi) l(theta) + sin(phi) q(theta), with l a
    linear and q a quadratic gradient across direction theta (Carlsson, Ishkhanov, de Silva and
    Zomorodian, On the local behavior of spaces of natural images, 2008;
    `docs/examples/image-patches.md` finds them).

    In the chart x = (phi + pi/2) / 2 pi and y = theta / pi, so (x, y) ~ (1 - x, y + 1).

    Args:
        unit: Unit of the data (N, 2), theta and phi: "radians", "degrees" or "turns".

    >>> KleinBottle(unit="degrees").to_chart([[190.0, 150.0], [10.0, 30.0]]).numpy().round(6).tolist()
    [[0.333333, 0.055556], [0.333333, 0.055556]]
    """

    name = "klein-bottle"
    columns = ("theta", "phi")

    def __init__(self, *, unit: str = "radians") -> None:
        super().__init__(unit=unit)
        self.group = named_group("klein-bottle")

    @classmethod
    def for_data(cls, data: Array, *, unit: str = "radians", seed: int = 0) -> Self:
        del data, seed
        return cls(unit=unit)

    @property
    def volume(self) -> float:
        return self.period**2 / 2

    def cover(self, data: ArrayLike) -> Tensor:
        theta, phi = checked_table(data, (2,), "theta and phi").T / self.period
        return torch.tensor(np.stack([phi + 0.25, 2 * theta], axis=-1))

    def data_gradient(self, data: ArrayLike, points: Tensor, gradient: Tensor) -> Array:
        del data, points
        along_x, along_y = gradient.numpy().T
        return np.stack([2 * along_y, along_x], axis=-1) / self.period

    def from_chart(self, points: Tensor) -> Array:
        """Return angles (N, 2): theta in [0, 1/2) turns, phi in [-1/4, 3/4) turns."""
        x, y = self.project(points).detach().double().cpu().numpy().T
        return np.stack([y / 2, x - 0.25], axis=-1) * self.period
