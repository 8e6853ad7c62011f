"""Any space beside real and periodic columns: a direction and a depth, a place and a day."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Self, TypeVar

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.data import Role
from orbiflow.density.spaces.axes import Circle
from orbiflow.density.spaces.checked import checked_table
from orbiflow.density.spaces.flat import Torus
from orbiflow.density.spaces.space import CHART, Space, by_sphere, make_space
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_instance
from orbiflow.symmetry import CrystallographicGroup

T = TypeVar("T", Tensor, Array)


class ProductSpace(Space):
    """A space beside other columns, each real or with a period of its own.

    Data have the columns of `base` first; chart points are those of both, one after the other. The
    natural measure is the product of both, such as steradian times kilometre. Densities are made of
    kernels and mixtures, whose marginal and conditional densities have a closed form.

    Args:
        base: A space that is no torus (a torus has such columns itself), or its settings and "name".
        axes: The other columns, as of `Torus`: periods, or centres and scales of real ones.
        from_zero: Those of `axes` that are written from 0, as of `Torus`.

    >>> from orbiflow.density.spaces import Sphere
    >>> space = ProductSpace(Sphere(), [(10.0, 5.0), 24.0])
    >>> space.from_chart(space.to_chart([[48.2, 16.4, 12.0, 30.0]])).round(6).tolist()
    [[48.2, 16.4, 12.0, 6.0]]
    """

    name = "product"
    has_chart = False

    def __init__(
        self,
        base: Space | Mapping[str, Any],
        axes: Sequence[Any],
        *,
        from_zero: Sequence[int] | None = None,
    ) -> None:
        if isinstance(base, Mapping):
            options = dict(base)
            base = make_space(str(options.pop("name", None)), **options)
        self.base = as_instance(base, Space, "base", "see `make_space`")
        if isinstance(base, Torus | ProductSpace):
            raise OrbiflowError(f"the base of a product is no {base.name}: take a torus of all")
        beside = [axis._replace(unit="") if isinstance(axis, Circle) else axis for axis in axes]
        self.beside = Torus(beside, from_zero=from_zero)
        if any(axis.is_angle for axis in self.beside.axes):
            raise OrbiflowError(
                "each column beside a space needs a period, or a centre and a scale"
            )
        self.parts = (self.base, self.beside)
        count = self.beside.dim
        self.columns = (*self.base.columns, *(f"beside{k}" for k in range(1, count + 1)))

    @classmethod
    def for_data(cls, data: Array, *, unit: str = "radians", seed: int = 0) -> Self:
        del data, unit, seed
        raise OrbiflowError("name the columns beside the space: give {linear} or {period}")

    @property
    def data_name(self) -> str:
        return self.base.data_name

    @property
    def dim(self) -> int:
        return self.base.dim + self.beside.dim

    @property
    def chart_dim(self) -> int:
        return self.base.chart_dim + self.beside.dim

    @property
    def group(self) -> CrystallographicGroup:  # pyright: ignore[reportIncompatibleVariableOverride]
        raise OrbiflowError(
            f"a {self.base.name} beside other columns has no crystallographic group: densities there "
            "are made of kernels and mixtures"
        )

    @property
    def widths(self) -> tuple[int, ...]:
        return tuple(width + self.beside.dim for width in self.base.widths)

    def roles(self, width: int) -> tuple[Role | None, ...]:
        beside = self.beside.dim
        return (*self.base.roles(width - beside), *self.beside.roles(beside))

    def data_unit(self, width: int) -> str | None:
        return self.base.data_unit(width - self.beside.dim)

    def form_in(self, names: Sequence[str]) -> str | None:
        return self.base.form_in(names)

    @property
    def volume(self) -> float:
        return self.base.volume * self.beside.volume

    @property
    def spheres(self) -> tuple[int, ...]:
        return (*self.base.spheres, *self.beside.spheres)

    @property
    def moves(self) -> Array:
        of_base, more = self.base.moves, self.beside.dim
        both = np.zeros((len(of_base), len(self.spheres), len(self.spheres)))
        both[:, :-more, :-more], both[:, -more:, -more:] = of_base, np.eye(more)
        return both

    def split(self, points: T) -> tuple[T, T]:
        """Return the chart points (..., d) of the base and of the other columns."""
        count = self.beside.dim
        return points[..., :-count], points[..., -count:]

    def _both(
        self, ask: Callable[[Space, Tensor], Tensor], points: Tensor
    ) -> tuple[Tensor, Tensor]:
        first, second = self.split(self._checked(points))
        return ask(self.base, first), ask(self.beside, second)

    def project(self, points: Tensor) -> Tensor:
        return torch.cat(self._both(lambda part, x: part.project(x), points), dim=-1)

    def retracted(self, points: Tensor) -> Tensor:
        return torch.cat(self._both(lambda part, x: part.retracted(x), points), dim=-1)

    def log_area(self, points: Tensor) -> Tensor:
        first, second = self._both(lambda part, x: part.log_area(x), points)
        return first + second

    def log_density_factor(self, points: Tensor, measure: str) -> Tensor:
        if measure == CHART:
            return torch.zeros_like(points[..., 0])
        both = self._both(lambda part, x: part.log_density_factor(x, measure), points)
        return both[0] + both[1]

    def log_kernel_factor(self, points: Tensor, measure: str) -> Tensor:
        both = self._both(lambda part, x: part.log_kernel_factor(x, measure), points)
        return both[0] + both[1]

    def cover(self, data: ArrayLike) -> Tensor:
        return self._of_data(data, lambda part, x: part.cover(x))

    def to_chart(self, data: ArrayLike) -> Tensor:
        return self._of_data(data, lambda part, x: part.to_chart(x))

    def _of_data(self, data: ArrayLike, ask: Callable[[Space, Array], Tensor]) -> Tensor:
        first, second = self.split(checked_table(data, self.widths, "data"))
        return torch.cat([ask(self.base, first), ask(self.beside, second)], dim=-1)

    def from_chart(self, points: Tensor) -> Array:
        first, second = self.split(self._checked(points))
        return np.concatenate(
            [self.base.from_chart(first), self.beside.from_chart(second)], axis=-1
        )

    def data_gradient(self, data: ArrayLike, points: Tensor, gradient: Tensor) -> Array:
        table = self.split(np.asarray(data, dtype=np.float64))
        at, slopes = self.split(points), self.split(gradient)
        columns = [
            part.data_gradient(table[k], at[k], slopes[k]) for k, part in enumerate(self.parts)
        ]
        return np.concatenate(columns, axis=-1)

    def features(self, points: Tensor, which: slice = slice(None)) -> Tensor:
        first, second = self.split(self._checked(points))
        images = self.base.features(first, which)
        rest = self.beside.features(second).expand(len(images), -1, -1)
        both = [
            by_sphere(table, len(part.spheres))
            for table, part in zip((images, rest), self.parts, strict=True)
        ]
        most = max(table.shape[-2] for table in both)
        padded = [
            torch.nn.functional.pad(table, (0, 0, 0, most - table.shape[-2])) for table in both
        ]
        return torch.cat(padded, dim=-1).flatten(-2)

    @property
    def kernel_images(self) -> int:
        return self.base.kernel_images

    def lifted(self, features: Tensor) -> Tensor:
        table = by_sphere(features, len(self.spheres))
        first, second = self.split(table)
        places = (
            part.lifted(table_of_part[..., : 1 + part.spheres[0], :].flatten(-2))
            for part, table_of_part in zip(self.parts, (first, second), strict=True)
        )
        return torch.cat(list(places), dim=-1)

    def uniform(self, count: int, generator: torch.Generator) -> Tensor:
        return torch.cat([part.uniform(count, generator) for part in self.parts], dim=-1)

    def step_angle(self, step: float) -> float:
        return min(part.step_angle(step) for part in self.parts)

    @property
    def together(self) -> int:
        return self.base.chart_dim

    def of_axes(self, axes: Sequence[int]) -> Space:
        chart = self.base.chart_dim
        of_base = [axis for axis in axes if axis < chart]
        if of_base and list(axes[:chart]) != list(range(chart)):
            raise OrbiflowError(
                f"the columns of the {self.base.name} have a meaning together alone: name all, or none"
            )
        others = [axis - chart for axis in axes if axis >= chart]
        if not others:
            return self.base
        if not of_base:
            return self.beside.of_axes(others)
        kept = [self.beside.axes[axis] for axis in others]
        return ProductSpace(self.base, kept)

    def factors_of(self, axes: Sequence[int]) -> list[int]:
        shift = len(self.base.spheres) - self.base.chart_dim
        of_base = list(range(len(self.base.spheres))) if min(axes) < self.base.chart_dim else []
        return [*of_base, *(axis + shift for axis in axes if axis >= self.base.chart_dim)]

    def settings(self) -> dict[str, Any]:
        base = {"name": self.base.name, **self.base.settings()}
        beside = self.beside.settings()
        del beside["unit"]
        return {"base": base, **beside}
