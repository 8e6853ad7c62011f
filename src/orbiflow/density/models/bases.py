"""Base distributions: what the flow carries to the data."""

from __future__ import annotations

import copy
import math
from abc import ABC, abstractmethod
from typing import Self

import numpy as np
import torch
from torch import Tensor

from orbiflow.arguments import is_a
from orbiflow.density.arguments import check_kind
from orbiflow.density.models.moving import moved
from orbiflow.density.models.neural import NeuralFlow
from orbiflow.density.spaces import Space, rectangle
from orbiflow.errors import OrbiflowError
from orbiflow.fields import NeuralTorusField, SplineField
from orbiflow.flows import Flow
from orbiflow.typed_torch import special


class Base(ABC):
    """A distribution on a space that needs no fit, invariant under the space's group."""

    def __init__(self, space: Space) -> None:
        self.space = check_kind(space, Space, "space", "see `make_space`")

    @abstractmethod
    def log_prob(self, points: Tensor) -> Tensor:
        """Log density (...,) with respect to the area of the square, at points (..., d)."""

    @abstractmethod
    def sample(self, count: int, generator: torch.Generator) -> Tensor:
        """Canonical points (count, d), float64, on the CPU: the same ones wherever the base is."""

    def to(self, device: torch.device | str) -> Self:
        """A copy on a device. It stays in float64: sharp kernels need its digits."""
        new, to = copy.copy(self), torch.device(device)
        for name, value in vars(self).items():
            setattr(new, name, moved(value, to))
        return new


class UniformBase(Base):
    """Uniform in natural measure: on sphere and projective plane J / 4 pi and J / 2 pi.

    An equivariant flow fixes the cone points, so a base that is flat in the chart could never be
    corrected there (design point 13).
    """

    def log_prob(self, points: Tensor) -> Tensor:
        return self.space.log_area(points) - math.log(self.space.volume)

    def sample(self, count: int, generator: torch.Generator) -> Tensor:
        return self.space.uniform(count, generator)


class VonMisesBase(Base):
    """The paper's base: a product of von Mises distributions about the square's centre.

    Made invariant by summing over the group: with periods those of the lattice, the sum over coset
    representatives integrates to 1 over the square.

    Args:
        space: any.
        concentration: kappa > 0 of each factor.
    """

    def __init__(self, space: Space, concentration: float = 1.0) -> None:
        super().__init__(space)
        real = is_a(concentration, int | float)
        if not real or not concentration > 0 or not math.isfinite(concentration):
            raise OrbiflowError(f"concentration must be positive, got {concentration!r}")
        self.concentration = float(concentration)
        self.periods = rectangle(space)

    def log_prob(self, points: Tensor) -> Tensor:
        images = self.space.group.images(points)
        periods = self.periods.to(points)
        angle = 2 * math.pi * (images - 0.5) / periods
        kappa = self.concentration
        log_normal = torch.log(special.i0e(torch.tensor(kappa, dtype=torch.float64))) + kappa
        terms = kappa * angle.cos() - log_normal.to(points) - periods.log()
        return terms.sum(dim=-1).logsumexp(dim=0)

    def sample(self, count: int, generator: torch.Generator) -> Tensor:
        seed = int(torch.randint(2**31, (), generator=generator))
        angle = np.random.default_rng(seed).vonmises(
            0.0, self.concentration, (count, self.space.dim)
        )
        return self.space.project(0.5 + torch.tensor(angle) / (2 * math.pi) * self.periods.cpu())


MOST_DIM = 3
"""Dimensions of a spline's grid; beyond, it would be too large."""


def still_flow(space: Space) -> Flow:
    """A flow on the space that is the identity: a new field is zero.

    >>> from orbiflow.density import make_space
    >>> len(still_flow(make_space("torus")).segments)
    1
    """
    if space.dim > MOST_DIM:
        return NeuralFlow(NeuralTorusField(space.dim, width=1, depth=1, waves=1), steps=1)
    return Flow([SplineField(space.group, 1)], steps=1, warn=False)
