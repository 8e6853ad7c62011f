"""Mixtures of von Mises chains: the component for dependent angles on tori."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from orbiflow.arguments import as_tensor
from orbiflow.density.models.chain_integrals import SCALES, chains_at, waves
from orbiflow.density.models.density import Density, Restriction, Split, in_blocks
from orbiflow.density.models.terms import log_sum_exp, shares_of
from orbiflow.density.spaces import Space, Torus
from orbiflow.errors import OrbiflowError
from orbiflow.typed_torch import special

BLOCK = 256
"""Points at a time: few enough for the cache."""


class VonMisesChains(Density, kind="chains"):
    """A mixture of chains of von Mises distributions, exact and normalised on the torus.

    In a component, angle i is von Mises about a trigonometric polynomial of the angles before it,
    m_i = b_i + sum over j before i of (s_ij sin x_j + c_ij cos x_j): a circular regression (Fisher
    and Lee, 1992), correlations at no cost, since each factor is normalised whatever the others are.
    Each component comes at several scales, its concentrations divided by `SCALES`.

    Args:
        space: A `Torus` of d angles.
        log_weights: Logarithms (K, L) of the weight of each component and scale, of sum 1.
        means: The regressions (K, d, 1 + 2 d): b_i, s_ij, c_ij in radians, zero unless j is before i.
        concentrations: Concentrations (K, d), at least 0; 0 is uniform.
        order: The numbers (K, d) of the angles from the first to the last of each chain; default
            0, 1, ..., d - 1.

    Raises:
        OrbiflowError: for another space, wrong shapes or values that make no distribution.
    """

    stored = ("log_weights", "means", "concentrations", "order")

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
        given = zip(self.stored, (log_weights, means, concentrations), strict=False)
        log_weights, means, concentrations = (as_tensor(value, name) for name, value in given)
        count = concentrations.shape[0] if concentrations.dim() == 2 else 0
        if order is None:
            order = torch.arange(d, device=concentrations.device).repeat(count, 1)
        tensors = (log_weights, means, concentrations, order)
        shapes = ((count, len(SCALES)), (count, d, 1 + 2 * d), (count, d), (count, d))
        for name, tensor, shape in zip(self.stored, tensors, shapes, strict=True):
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

    def log_chart(self, points: Tensor) -> Tensor:
        return in_blocks(lambda p: log_sum_exp(self.joint(p).flatten(1)), points, BLOCK)

    def joint(self, points: Tensor) -> Tensor:
        """Return the log density (N, L, K) at points (N, d) of each scale and component, weighted."""
        residual = self.residuals(points)
        kappa = self.concentrations.to(points)
        fit = torch.einsum("nkd,kd->nk", residual.cos() - 1, kappa)
        # log weights less log normalising constants, per unit of the cube: (L, K)
        scaled = self.concentrations / self.concentrations.new_tensor(SCALES)[:, None, None]
        constant = self.log_weights.mT - special.i0e(scaled).log().sum(dim=-1)
        return fit[:, None] / fit.new_tensor(SCALES)[:, None] + constant.to(points)

    def residuals(self, points: Tensor) -> Tensor:
        """Return angles less their regressions, in radians (N, K, d), for points (N, d)."""
        angle = 2 * math.pi * points
        mean = waves(angle) @ self.means.to(points).flatten(0, 1).mT
        # in place: at this size, fresh memory costs more than the arithmetic
        return mean.reshape(len(points), *self.concentrations.shape).neg_().add_(angle[:, None])

    def draw(self, count: int, generator: torch.Generator) -> Tensor:
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

    @classmethod
    def joined(cls, components: Sequence[Any], weights: Tensor) -> Self:
        """Return all chains of several densities on one torus, in proportions (P,)."""
        logs = (weights.double() / weights.sum()).log()
        return cls(
            components[0].space,
            torch.cat([own.log_weights + log for own, log in zip(components, logs, strict=True)]),
            torch.cat([own.means for own in components]),
            torch.cat([own.concentrations for own in components]),
            torch.cat([own.order for own in components]),
        )

    def log_marginal(self, points: Tensor, axes: list[int], seed: int = 0) -> Tensor:
        return chains_at(self, points, axes, seed)

    def restricted(self, split: Split, space: Torus) -> Restriction:
        """Keep the chains in which all that is given comes first and all that is hidden last."""
        place = self.order.argsort(dim=1)
        kept, given = list(split.kept), list(split.given)
        hidden = [axis for axis in range(split.dim) if axis not in split.observed]
        closed = torch.ones(len(self.order), dtype=torch.bool)
        first = place[:, kept].amin(dim=1)
        last = place[:, list(split.observed)].amax(dim=1)
        if given:
            closed &= place[:, given].amax(dim=1) < first
        if hidden:
            closed &= place[:, hidden].amin(dim=1) > last
        parts: list[tuple[float, Density]] = []
        for log, chains in self._some(closed):
            evidence, some = chains._closed(split, space)
            parts.append((log + evidence, some))
        return Restriction(parts, [*self._some(~closed)])

    def _some(self, chosen: Tensor) -> list[tuple[float, VonMisesChains]]:
        """Return the chains of a mask (K,), with the logarithm of their weight, if they have any."""
        if not bool(chosen.any()) or bool((self.log_weights[chosen] == -math.inf).all()):
            return []
        logs = self.log_weights[chosen]
        total = float(logs.flatten().logsumexp(0))
        parts = (self.means[chosen], self.concentrations[chosen], self.order[chosen])
        return [(total, VonMisesChains(self.space, logs - total, *parts))]

    def _closed(self, split: Split, space: Torus) -> tuple[float, VonMisesChains]:
        """Return the log density of what is given, and chains of the angles kept.

        Their constants are moved and their weights changed by what is given.
        """
        kept, given, d = list(split.kept), list(split.given), split.dim
        logs, means, evidence = self.log_weights, self.means, 0.0
        constant = means[:, :, 0]
        if given:
            angle = torch.zeros(1, d, dtype=torch.float64)
            angle[0, given] = 2 * math.pi * torch.tensor(split.values, dtype=torch.float64)
            known = torch.zeros(1 + 2 * d, dtype=torch.float64)
            at = [0, *(1 + j for j in given), *(1 + d + j for j in given)]
            known[at] = waves(angle)[0, at]
            constant = means @ known
            residual = angle[0, given] - constant[:, given]
            kappa = self.concentrations[:, given, None] / torch.tensor(SCALES)
            logs = logs + (kappa * (residual.cos() - 1)[..., None] - special.i0e(kappa).log()).sum(
                dim=1
            )
            evidence = float(log_sum_exp(logs.flatten()))
            logs = shares_of(logs.flatten()).log().reshape(logs.shape)
        at = [*(1 + j for j in kept), *(1 + d + j for j in kept)]
        some = torch.cat([constant[:, kept, None], means[:, kept][:, :, at]], dim=2)
        order = self.order.argsort(dim=1)[:, kept].argsort(dim=1)
        return evidence, VonMisesChains(space, logs, some, self.concentrations[:, kept], order)

    def header(self) -> dict[str, Any]:
        return {"components": len(self.concentrations), "scales": list(SCALES)}


def chained(order: Tensor) -> Tensor:
    """Return which means (..., d, 1 + 2 d) chains of an order (..., d) may use.

    These are the constants and the waves of the angles before.

    >>> chained(torch.tensor([1, 0])).int()
    tensor([[1, 0, 1, 0, 1],
            [1, 0, 0, 0, 0]], dtype=torch.int32)
    """
    place = order.argsort(dim=-1)
    before = place[..., None, :] < place[..., :, None]
    return torch.cat([torch.ones_like(before[..., :1]), before, before], dim=-1)
