"""The torus of any dimension and the Klein bottle, for data that are angles."""

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
from orbiflow.density.spaces.checked import checked_table
from orbiflow.density.spaces.space import Space, named_group
from orbiflow.settings import as_choice, as_whole
from orbiflow.symmetry import CrystallographicGroup

TURN: dict[str, float] = {"radians": 2 * math.pi, "degrees": 360.0, "turns": 1.0}
"""A whole turn in each unit."""

MAX_DIM = 64


def whole_turn(unit: str) -> float:
    """Return a whole turn in a unit."""
    return TURN[as_choice(unit, tuple(TURN), "unit")]


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

    def step_angle(self, step: float) -> float:
        return 2 * math.pi * step / self.period

    def data_unit(self, width: int) -> str | None:
        del width
        return self.unit

    def settings(self) -> dict[str, Any]:
        return {"unit": self.unit}


class Torus(_AngleSpace):
    """The torus of several angles, whose natural measure is their product in the user's unit.

    Args:
        dim: Number of angles, 1 to 64.
        unit: Unit of the data, "radians", "degrees" or "turns". Angles may be any real numbers.
        from_zero: Numbers from 0 of the angles that are written from 0 to a whole turn; all others are
            from minus half a turn. Spaces that differ in this alone are equal.

    >>> space = Torus(2, unit="degrees")
    >>> space.to_chart([[90.0, -90.0]]).tolist()
    [[0.25, 0.75]]
    """

    name = "torus"

    def __init__(
        self, dim: int = 2, *, unit: str = "radians", from_zero: Sequence[int] = ()
    ) -> None:
        dim = as_whole(dim, "dim", 1, MAX_DIM)
        super().__init__(unit=unit)
        numbers = {as_whole(axis, "from_zero", 0, dim - 1) for axis in from_zero}
        self.from_zero = tuple(sorted(numbers))
        self.group = named_group("torus") if dim == 2 else _lattice_group(dim)
        self.columns = tuple(f"angle{k + 1}" for k in range(dim))

    @classmethod
    def for_data(cls, data: Array, *, unit: str = "radians", seed: int = 0) -> Self:
        del seed
        return cls(data.shape[1], unit=unit, from_zero=written_from_zero(data, whole_turn(unit)))

    def roles(self, width: int) -> tuple[Role | None, ...]:
        return (Role("angle", str(self.unit)),) * width

    @property
    def volume(self) -> float:
        return self.period**self.dim

    def cover(self, data: ArrayLike) -> Tensor:
        table = checked_table(data, (self.dim,), f"{self.dim} angles")
        return torch.tensor(table / self.period)

    def turns(self, axis: int, values: Tensor) -> Tensor:
        """Return the chart coordinates of values of one column, in any shape."""
        del axis
        return values / self.period

    def period_of(self, axis: int) -> float:
        """Return the period of a column of the data, 0 if it has none."""
        del axis
        return self.period

    def first_turn(self, axis: int) -> float:
        """Return the turn at which a column of the data begins."""
        return 0.0 if axis in self.from_zero else -0.5

    def even_line(self, axis: int, count: int) -> Array:
        """Return even values (count,) of a column, from its first turn on."""
        return (np.arange(count) / count + self.first_turn(axis)) * self.period_of(axis)

    @property
    def together(self) -> int:
        return 0

    def of_axes(self, axes: Sequence[int]) -> Torus:
        return Torus(len(axes), unit=str(self.unit), from_zero=self.from_zero_of(axes))

    def from_zero_of(self, axes: Sequence[int]) -> list[int]:
        """Return the numbers, among some columns, of those that are written from 0."""
        return [k for k, axis in enumerate(axes) if axis in self.from_zero]

    def data_gradient(self, data: ArrayLike, points: Tensor, gradient: Tensor) -> Array:
        del data, points
        return gradient.numpy() / self.period

    def from_chart(self, points: Tensor) -> Array:
        """Return angles (N, dim) in [-1/2, 1/2) turns, or [0, 1) turns of those `from_zero`."""
        return self._own_turns(points) * self.period

    def _own_turns(self, points: Tensor) -> Array:
        """Return turns (N, dim), each from the first one of its column on."""
        x = self._checked(points).detach().double().cpu().numpy()
        first = [self.first_turn(axis) for axis in range(self.dim)]
        return x - np.floor(x - first)

    def project(self, points: Tensor) -> Tensor:
        points = self._checked(points)
        return points - points.detach().floor()

    def displacement(self, start: Tensor, end: Tensor) -> Tensor:
        # exact in any dimension, where the images are 3^d
        difference = end - start
        return difference - difference.detach().round()

    def settings(self) -> dict[str, Any]:
        own = {"from_zero": list(self.from_zero)} if self.from_zero else {}
        return {"dim": self.dim, **super().settings(), **own}


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
