"""Densities that need no fit: the uniform one, and the paper's product of von Mises densities."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from orbiflow.arguments import is_a
from orbiflow.density.models.density import Density, Restriction, Split
from orbiflow.density.spaces import Space, Torus, rectangle
from orbiflow.errors import OrbiflowError
from orbiflow.typed_torch import special


class UniformDensity(Density, kind="uniform"):
    """The uniform density in natural measure: on sphere and projective plane J / 4 pi and J / 2 pi.

    An equivariant flow fixes the cone points, so a base that is flat in the chart could never be
    corrected there (design point 13). As a component it keeps a lone observation from being
    impossible.
    """

    @property
    def log_floor(self) -> float:
        return -math.log(self.space.volume) if self.space.is_round else 0.0

    def log_density(self, points: Tensor, beside: float = -math.inf) -> Tensor:
        del beside
        return self.log_floor + 0 * points[..., 0]  # which has gradients

    def log_chart(self, points: Tensor) -> Tensor:
        values = self.log_density(points)
        return self.space.log_area(points) + values if self.space.is_round else values

    def draw(self, count: int, generator: torch.Generator) -> Tensor:
        return self.space.uniform(count, generator)

    def log_marginal(self, points: Tensor, axes: list[int], seed: int = 0) -> Tensor:
        del axes, seed
        return torch.zeros(len(points), dtype=torch.float64)

    def restricted(self, split: Split, space: Torus) -> Restriction:
        del split
        return Restriction([(0.0, UniformDensity(space))], [])


class VonMisesDensity(Density, kind="von-mises"):
    """The paper's base: a product of von Mises densities about the square's centre.

    It is made invariant by summing over the group: with periods those of the lattice, the sum over
    coset representatives integrates to 1 over the square.

    Args:
        space: Any space.
        concentration: The concentration kappa > 0 of each factor.
    """

    def __init__(self, space: Space, concentration: float = 1.0) -> None:
        super().__init__(space)
        real = is_a(concentration, int | float)
        if not real or not concentration > 0 or not math.isfinite(concentration):
            raise OrbiflowError(f"concentration must be positive, got {concentration!r}")
        self.concentration = float(concentration)
        self.periods = rectangle(space)

    def log_chart(self, points: Tensor) -> Tensor:
        images = self.space.group.images(points)
        periods = self.periods.to(points)
        angle = 2 * math.pi * (images - 0.5) / periods
        kappa = self.concentration
        log_normal = torch.log(special.i0e(torch.tensor(kappa, dtype=torch.float64))) + kappa
        terms = kappa * angle.cos() - log_normal.to(points) - periods.log()
        return terms.sum(dim=-1).logsumexp(dim=0)

    def draw(self, count: int, generator: torch.Generator) -> Tensor:
        seed = int(torch.randint(2**31, (), generator=generator))
        angle = np.random.default_rng(seed).vonmises(
            0.0, self.concentration, (count, self.space.dim)
        )
        return self.space.project(0.5 + torch.tensor(angle) / (2 * math.pi) * self.periods.cpu())

    def header(self) -> dict[str, Any]:
        return {"concentration": self.concentration}

    @classmethod
    def from_header(
        cls, space: Space, header: Mapping[str, Any], tensors: Mapping[str, Tensor]
    ) -> Self:
        del tensors
        return cls(space, float(header["concentration"]))
