"""Linear-circular regressions: the part for few rows, and for what goes plainly with the covariates."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Self

import numpy as np
import torch
from scipy import optimize
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.covariates.parts import Part, mean_cosines
from orbiflow.density.fitting import Rows
from orbiflow.density.models import AdaptiveKernels
from orbiflow.density.spaces import Space, Torus
from orbiflow.errors import OrbiflowError
from orbiflow.typed_torch import special

RIDGE = 1e-3
"""Weight of the mean square of slopes: of words, features are linearly dependent."""

STEPS, LEAST_GAIN = 200, 1e-6
"""The most steps, and the least relative gain of one: rare words make thousands that gain nothing."""

LOG_KAPPA = (-6.0, 12.0)
"""Logarithms of the least and the largest concentration."""


class CircularRegression(Part):
    """Angles that are von Mises about m + 2 atan(b.x), with concentrations exp(c + g.x).

    Each angle by itself (Fisher and Lee, Regression models for an angular response, 1992).

    Args:
        space: A torus of d angles.
        means: Directions m (d,), in radians.
        slopes: The slopes b (d, k) of features.
        spreads: c and g (d, 1 + k).
    """

    kind = "regression"

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

    @torch.no_grad()
    def mean_features(self, x: Tensor) -> Tensor:
        mean, kappa = self._shape(x)
        length = mean_cosines(kappa)
        return torch.cat([length * mean.cos(), length * mean.sin()], dim=1)

    def header(self) -> dict[str, Any]:
        return {}

    def tensors(self) -> dict[str, Tensor]:
        return {"means": self.means, "slopes": self.slopes, "spreads": self.spreads}

    @classmethod
    def from_header(
        cls, space: Space, number: Tensor, header: Mapping[str, Any], tensors: Mapping[str, Tensor]
    ) -> Self:
        del header
        given = [tensors[name] for name in ("means", "slopes", "spreads")]
        d, k = space.dim, len(number)
        if (
            not isinstance(space, Torus)
            or [tuple(own.shape) for own in given] != [(d,), (d, k), (d, 1 + k)]
            or not all(own.dtype == torch.float64 and bool(own.isfinite().all()) for own in given)
        ):
            raise OrbiflowError("a regression of other shapes or values")
        return cls(space, *given)


def fit_regression(space: Torus, rows: Rows, x: Tensor) -> CircularRegression:
    """Fit to points (N, d) and features (N, k) by maximum likelihood, from both sides of the mean."""
    d, k = space.dim, x.shape[1]
    weights = torch.ones(len(x)).to(x) if rows.weights is None else rows.weights
    shares = weights / weights.sum()
    angle = 2 * math.pi * rows.points

    def made(values: Tensor) -> CircularRegression:
        means, slopes, spreads = values.split([d, d * k, d * (1 + k)])
        return CircularRegression(space, means, slopes.reshape(d, k), spreads.reshape(d, 1 + k))

    def loss(values: Array) -> tuple[float, Array]:
        own = torch.tensor(values, requires_grad=True)
        now = made(own)
        ridge = RIDGE * (now.slopes.square().mean() + now.spreads[:, 1:].square().mean())
        value = ridge - (shares @ now.logs(rows.points, x)).sum()
        (gradient,) = torch.autograd.grad(value, own)
        return float(value.detach()), gradient.numpy()

    mean = torch.atan2(shares @ angle.sin(), shares @ angle.cos())
    found: list[CircularRegression] = []
    for start in (mean, mean + math.pi):
        first = np.concatenate([start.numpy(), np.zeros(d * k + d * (1 + k))])
        best = optimize.minimize(
            loss, first, jac=True, method="L-BFGS-B", options={"maxiter": STEPS, "ftol": LEAST_GAIN}
        ).x
        found.append(made(torch.tensor(best)))
    logs = torch.stack([shares @ own.logs(rows.points, x) for own in found])
    better = logs.argmax(dim=0)
    every = torch.arange(d)
    means, slopes, spreads = (
        torch.stack([getattr(own, name) for own in found])[better, every]
        for name in ("means", "slopes", "spreads")
    )
    return CircularRegression(space, means, slopes, spreads)
