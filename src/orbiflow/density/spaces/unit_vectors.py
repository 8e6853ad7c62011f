"""Spheres of any dimension and their quotients by finite groups, such as axes."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Self

import numpy as np
import torch
from numpy.typing import ArrayLike
from scipy.special import gammaln
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.spaces.checked import checked_table
from orbiflow.density.spaces.flat import MAX_DIM
from orbiflow.density.spaces.round import UNIT_TOLERANCE, to_unit
from orbiflow.density.spaces.space import Space
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_whole
from orbiflow.symmetry import CrystallographicGroup
from orbiflow.typed_torch import linalg


class UnitVectorSpace(Space):
    """The unit sphere S^d in d + 1 coordinates, modulo a finite group of isometries.

    There is no chart of the square: chart points are unit vectors (N, d + 1), and the measure
    "square" is the sphere's own area. So there are kernels and mixtures of von Mises-Fisher
    densities, but neither flows nor pictures. Of the images of a point, the canonical one has the
    largest last coordinate. A subclass gives its elements, `columns`, `for_data` and `settings`.

    Args:
        elements: Orthogonal matrices (E, d + 1, d + 1): all elements of the group, the identity first.
    """

    is_round = True
    has_chart = False

    def __init__(self, elements: Array) -> None:
        self.elements = torch.tensor(elements)
        # nothing but the last coordinate, until two images are as high
        side = 1e-6 / np.arange(2.0, elements.shape[1] + 2) ** 0.5
        self._height = torch.tensor(side + np.eye(len(side))[-1])

    @property
    def dim(self) -> int:
        return self.chart_dim - 1

    @property
    def chart_dim(self) -> int:
        return self.elements.shape[1]

    @property
    def group(self) -> CrystallographicGroup:  # pyright: ignore[reportIncompatibleVariableOverride]
        raise OrbiflowError(
            f"the {self.name} has no chart of the square and no crystallographic group: densities "
            "there are made of kernels and mixtures"
        )

    @property
    def volume(self) -> float:
        half = self.chart_dim / 2
        return 2 * math.exp(half * math.log(math.pi) - float(gammaln(half))) / len(self.elements)

    def log_area(self, points: Tensor) -> Tensor:
        return torch.zeros_like(points[..., 0])

    def project(self, points: Tensor) -> Tensor:
        first = best = self._unit(points)
        height = self._height.to(best)
        for element in self.elements.to(best)[1:]:
            image = first @ element.mT
            best = torch.where((image @ height > best @ height)[..., None], image, best)
        return best

    def retracted(self, points: Tensor) -> Tensor:
        return points / linalg.vector_norm(points, dim=-1, keepdim=True)

    def features(self, points: Tensor, which: slice = slice(None)) -> Tensor:
        unit = self._unit(points)
        return torch.stack([unit @ element.mT for element in self.elements.to(unit)[which]])

    @property
    def kernel_images(self) -> int:
        return len(self.elements)

    def lifted(self, features: Tensor) -> Tensor:
        return features

    def _unit(self, points: Tensor) -> Tensor:
        points = self._checked(points)
        length = linalg.vector_norm(points, dim=-1, keepdim=True)
        if bool(((length - 1).abs() > UNIT_TOLERANCE).any()):
            raise OrbiflowError(f"chart points of the {self.name} must be unit vectors")
        return points / length

    def to_chart(self, data: ArrayLike) -> Tensor:
        return self.project(self.cover(data))

    def cover(self, data: ArrayLike) -> Tensor:
        table = checked_table(data, (self.chart_dim,), f"unit vectors of {self.chart_dim} numbers")
        return torch.tensor(to_unit(table))

    def from_chart(self, points: Tensor) -> Array:
        return self.project(points).detach().double().cpu().numpy()

    def data_gradient(self, data: ArrayLike, points: Tensor, gradient: Tensor) -> Array:
        del data, points
        return gradient.numpy()

    def step_angle(self, step: float) -> float:
        return step

    def uniform(self, count: int, generator: torch.Generator) -> Tensor:
        vectors = torch.randn(count, self.chart_dim, dtype=torch.float64, generator=generator)
        return self.project(vectors / linalg.vector_norm(vectors, dim=1, keepdim=True))


class Hypersphere(UnitVectorSpace):
    """The unit sphere S^d of d + 1 coordinates; densities are per unit of its area.

    Args:
        dim: The dimension d, 1 to 64.

    >>> Hypersphere(3).columns, round(Hypersphere(3).volume / math.pi**2, 12)
    (('x1', 'x2', 'x3', 'x4'), 2.0)
    """

    name = "hypersphere"
    signs: ClassVar[tuple[int, ...]] = (1,)

    def __init__(self, dim: int = 3) -> None:
        size = as_whole(dim, "dim", 1, MAX_DIM) + 1
        self.columns = tuple(f"x{k + 1}" for k in range(size))
        super().__init__(np.stack([sign * np.eye(size) for sign in self.signs]))

    @classmethod
    def for_data(cls, data: Array, *, unit: str = "radians", seed: int = 0) -> Self:
        del unit, seed
        width = data.shape[1]
        if not 2 <= width <= MAX_DIM + 1:
            raise OrbiflowError(
                f"unit vectors on the {cls.name} have 2 to {MAX_DIM + 1} coordinates, not {width}: "
                "project them to fewer coordinates first"
            )
        return cls(width - 1)

    def settings(self) -> dict[str, Any]:
        return {"dim": self.dim}


class ProjectiveSpace(Hypersphere):
    """The space of axes in d + 1 coordinates, which are unit vectors without a sense."""

    name, signs = "projective-space", (1, -1)
