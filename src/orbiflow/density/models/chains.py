"""Mixtures of von Mises chains: a base for concentrated data on tori of many angles, by EM."""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor

from orbiflow.density.arguments import float_tensor
from orbiflow.density.models.bases import Base
from orbiflow.density.models.terms import log_sum_exp
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError
from orbiflow.typed_torch import special

SCALES = (1.0, 4.0, 16.0)
"""A component's concentrations are divided by these, each with its own weight: heavy tails."""

BLOCK = 256
"""Points at a time: few enough for the cache."""


class VonMisesChains(Base):
    """A mixture of chains of von Mises distributions, exact and normalised on the torus.

    In a component, angle i is von Mises about a trigonometric polynomial of the angles before it,
    m_i = b_i + sum over j before i of (s_ij sin x_j + c_ij cos x_j): a circular regression (Fisher
    and Lee, 1992), correlations at no cost, since each factor is normalised whatever the others are.
    Each component comes at several scales, its concentrations divided by `SCALES`.

    Args:
        space: a `Torus` of d angles.
        log_weights: (K, L) of each component and scale; exp sums to 1.
        means: (K, d, 1 + 2 d): b_i, s_ij, c_ij in radians, zero unless j is before i.
        concentrations: (K, d), at least 0; 0 is uniform.
        order: (K, d), the numbers of the angles from the first to the last of each chain; default
            0, 1, ..., d - 1.

    Raises:
        OrbiflowError: for another space, wrong shapes or values that make no distribution.
    """

    def __init__(
        self,
        space: Space,
        log_weights: Tensor,
        means: Tensor,
        concentrations: Tensor,
        order: Tensor | None = None,
    ) -> None:
        super().__init__(space)
        if not space.is_torus:
            raise OrbiflowError(f"von Mises chains need a torus, got the {space.name}")
        d = space.dim
        log_weights, means, concentrations = (
            float_tensor(value, name)
            for value, name in (
                (log_weights, "log_weights"),
                (means, "means"),
                (concentrations, "concentrations"),
            )
        )
        count = concentrations.shape[0] if concentrations.dim() == 2 else 0
        if order is None:
            order = torch.arange(d, device=concentrations.device).repeat(count, 1)
        shapes = (
            (log_weights, (count, len(SCALES)), "log_weights"),
            (means, (count, d, 1 + 2 * d), "means"),
            (concentrations, (count, d), "concentrations"),
            (order, (count, d), "order"),
        )
        for tensor, shape, name in shapes:
            if count < 1 or tuple(tensor.shape) != shape:
                raise OrbiflowError(f"{name} has shape {tuple(tensor.shape)}, expected {shape}")
        # a weight may be 0, its logarithm -inf
        if not bool((log_weights < 1e-3).all() and abs(log_weights.exp().sum() - 1) < 1e-3):
            raise OrbiflowError("the weights of a mixture must sum to 1")
        if not bool(means.isfinite().all() and (concentrations >= 0).all()):
            raise OrbiflowError("the means and concentrations of a mixture must be finite")
        if not torch.equal(order.sort(dim=1).values, torch.arange(d).to(order).expand(count, d)):
            raise OrbiflowError(f"each order of a mixture must hold 0 to {d - 1} once")
        if not bool((concentrations <= 1e9).all()) or bool((means * ~chained(order)).any()):
            raise OrbiflowError("a mixture needs concentrations of at most 1e9 and chained means")
        self.log_weights, self.means, self.concentrations = (
            t.detach().double().clone() for t in (log_weights, means, concentrations)
        )
        self.order = order.detach().long().clone()

    def log_prob(self, points: Tensor) -> Tensor:
        """Log density (...,) at points (..., d), in their dtype; differentiable in the points."""
        flat = points.reshape(-1, self.space.dim)
        parts = [log_sum_exp(self.joint(block).flatten(1)) for block in torch.split(flat, BLOCK)]
        return torch.cat(parts).reshape(points.shape[:-1])

    def joint(self, points: Tensor) -> Tensor:
        """Log density (N, L, K) at points (N, d), of being there and of that scale and component."""
        residual = self.residuals(points)
        kappa = self.concentrations.to(points)
        fit = torch.einsum("nkd,kd->nk", residual.cos() - 1, kappa)
        return fit[:, None] / fit.new_tensor(SCALES)[:, None] + self._constant().to(points)

    def residuals(self, points: Tensor) -> Tensor:
        """Angles less their regressions, radians (N, K, d), for points (N, d)."""
        angle = 2 * math.pi * points
        mean = waves(angle) @ self.means.to(points).flatten(0, 1).mT
        # in place: at this size, fresh memory costs more than the arithmetic
        return mean.reshape(len(points), *self.concentrations.shape).neg_().add_(angle[:, None])

    def sample(self, count: int, generator: torch.Generator) -> Tensor:
        own = self.to("cpu")
        weights = own.log_weights.exp().flatten()
        chosen = torch.multinomial(weights, count, replacement=True, generator=generator)
        component = chosen // len(SCALES)
        kappa = own.concentrations[component] / torch.tensor(SCALES)[chosen % len(SCALES), None]
        rng = np.random.default_rng(int(torch.randint(2**31, (), generator=generator)))
        noise = torch.tensor(rng.vonmises(0.0, kappa.numpy()))
        angle, rows = torch.zeros(count, self.space.dim, dtype=torch.float64), torch.arange(count)
        for now in own.order[component].mT:
            mean = (waves(angle) * own.means[component, now]).sum(dim=-1)
            angle[rows, now] = mean + noise[rows, now]
        return self.space.project(angle / (2 * math.pi))

    def _constant(self) -> Tensor:
        """Log weights less log normalising constants, per unit of the cube: (L, K)."""
        kappa = self.concentrations / self.concentrations.new_tensor(SCALES)[:, None, None]
        return self.log_weights.mT - special.i0e(kappa).log().sum(dim=-1)


def chained(order: Tensor) -> Tensor:
    """Which of the means (..., d, 1 + 2 d) chains of order (..., d) may use: constants, angles before.

    >>> chained(torch.tensor([1, 0])).int()
    tensor([[1, 0, 1, 0, 1],
            [1, 0, 0, 0, 0]], dtype=torch.int32)
    """
    place = order.argsort(dim=-1)
    before = place[..., None, :] < place[..., :, None]
    return torch.cat([torch.ones_like(before[..., :1]), before, before], dim=-1)


def waves(angle: Tensor) -> Tensor:
    """1, sin and cos of angles (N, d) in radians: (N, 1 + 2 d)."""
    return torch.cat([torch.ones_like(angle[:, :1]), angle.sin(), angle.cos()], dim=1)


def averaged(mixtures: list[VonMisesChains]) -> VonMisesChains:
    """The mean of the densities, again a mixture."""
    first = mixtures[0]
    return VonMisesChains(
        first.space,
        torch.cat([m.log_weights for m in mixtures]) - math.log(len(mixtures)),
        torch.cat([m.means for m in mixtures]),
        torch.cat([m.concentrations for m in mixtures]),
        torch.cat([m.order for m in mixtures]),
    )
