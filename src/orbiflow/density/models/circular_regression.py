"""Linear-circular regressions: the part for few rows, and for what goes plainly with the covariates."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Self

import torch
from torch import Tensor

from orbiflow.density.models.conditional_parts import ConditionalPart, checked
from orbiflow.density.models.kernels import AdaptiveKernels
from orbiflow.density.spaces import Space, Torus
from orbiflow.errors import OrbiflowError
from orbiflow.typed_torch import special

LOG_KAPPA = (-6.0, 12.0)
"""Logarithms of the least and the largest concentration."""


class CircularRegression(ConditionalPart):
    """Angles that are von Mises about m + 2 atan(b.x), with concentrations exp(c + g.x).

    Each angle by itself (Fisher and Lee, Regression models for an angular response, 1992).

    Args:
        space: A torus of d angles.
        means: Directions m (d,), in radians.
        slopes: The slopes b (d, k) of features.
        spreads: c and g (d, 1 + k).
    """

    kind = "regression"
    stored = ("means", "slopes", "spreads")

    def __init__(self, space: Space, means: Tensor, slopes: Tensor, spreads: Tensor) -> None:
        self.space, self.means, self.slopes, self.spreads = space, means, slopes, spreads

    def _shape(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Return means in radians and concentrations (N, d) where features are x (N, k)."""
        mean = self.means + 2 * (x @ self.slopes.mT).atan()
        logs = self.spreads[:, 0] + x @ self.spreads[:, 1:].mT
        return mean, logs.clamp(*LOG_KAPPA).exp()

    def logs(self, points: Tensor, x: Tensor) -> Tensor:
        """Return the log density (N, d) of each angle; differentiable."""
        mean, kappa = self._shape(x)
        cosine = (2 * math.pi * points - mean).cos()
        return kappa * (cosine - 1) - special.i0e(kappa).log()

    @torch.no_grad()
    def log_prob(self, points: Tensor, x: Tensor) -> Tensor:
        return self.logs(points, x).sum(dim=1)

    @torch.no_grad()
    def at(self, x: Tensor) -> AdaptiveKernels:
        mean, kappa = self._shape(x[None])
        center = self.space.project(mean / (2 * math.pi))
        return AdaptiveKernels(self.space, center, kappa, torch.ones(1, dtype=torch.float64))

    @classmethod
    def from_header(
        cls, space: Space, number: Tensor, header: Mapping[str, Any], tensors: Mapping[str, Tensor]
    ) -> Self:
        del header
        d, k = space.dim, len(number)
        if not isinstance(space, Torus):
            raise OrbiflowError("a regression of other data than angles")
        shapes = {"means": (d,), "slopes": (d, k), "spreads": (d, 1 + k)}
        return cls(space, *checked(tensors, shapes, "a regression"))
