"""Bayesian networks on tori: each angle given a few others, by mixtures of von Mises chains."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from orbiflow.density.arguments import check_kind
from orbiflow.density.models.bases import Base
from orbiflow.density.models.chains import (
    BLOCK,
    SCALES,
    VonMisesChains,
    averaged,
    waves,
)
from orbiflow.density.models.terms import log_sum_exp, shares_of
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError
from orbiflow.typed_torch import listed, special


class Factor(NamedTuple):
    """An angle given others, its parents: a mixture of all of them over its marginal of the parents.

    - `axes`: numbers of the parents, and of the angle, last.
    - `chains`: on the torus of those, in this order.
    """

    axes: tuple[int, ...]
    chains: VonMisesChains


class VonMisesNetwork(Base):
    """A Bayesian network of angles (Pearl, 1988): the product of each given its parents.

    A mixture of all angles at once needs a component for each combination of states that they take; a
    network needs a few for each angle and its parents. A factor is a mixture f of von Mises chains:
    f(parents, angle) / f(parents), both in closed form, since in chains the last angle integrates to
    1. So the product is exact and normalised.

    Args:
        space: a `Torus`.
        factors: one for each angle, parents before their children.

    Raises:
        OrbiflowError: for another space, angles without a factor or with two, or parents after a child.
    """

    def __init__(self, space: Space, factors: Sequence[Factor]) -> None:
        super().__init__(space)
        if not space.is_torus:
            raise OrbiflowError(f"a von Mises network needs a torus, got the {space.name}")
        placed: list[int] = []
        for axes, chains in factors:
            check_kind(chains, VonMisesChains, "a factor's chains")
            if not axes or chains.space.dim != len(axes) or len(set(axes)) < len(axes):
                raise OrbiflowError(
                    f"a factor of the angles {axes} has chains of {chains.space.dim} angles"
                )
            if not set(axes[:-1]) <= set(placed) or axes[-1] in placed:
                raise OrbiflowError(
                    f"a factor of the angles {axes} comes before one of its parents, or is the "
                    "second of its angle"
                )
            if not torch.equal(
                chains.order.cpu(), torch.arange(len(axes)).expand(chains.order.shape)
            ):
                raise OrbiflowError("chains of a factor must end in its own angle, in their order")
            placed.append(axes[-1])
        if sorted(placed) != list(range(space.dim)):
            raise OrbiflowError(f"a network of {space.dim} angles needs a factor for each")
        self.factors = tuple(factors)

    def log_prob(self, points: Tensor) -> Tensor:
        """Log density (...,) at points (..., d), in their dtype; differentiable in the points."""
        flat = points.reshape(-1, self.space.dim)
        parts = [self._block(block) for block in torch.split(flat, BLOCK)]
        return torch.cat(parts).reshape(points.shape[:-1])

    def _block(self, points: Tensor) -> Tensor:
        angles = points.unbind(dim=1)
        found = [
            log_conditional(chains, torch.stack([angles[axis] for axis in axes], dim=1))
            for axes, chains in self.factors
        ]
        return torch.stack(found).sum(dim=0)

    def sample(self, count: int, generator: torch.Generator) -> Tensor:
        rng = np.random.default_rng(int(torch.randint(2**31, (), generator=generator)))
        points = torch.zeros(count, self.space.dim, dtype=torch.float64)
        for axes, chains in self.factors:
            own = chains.to("cpu")
            angle = 2 * math.pi * points[:, list(axes)]
            chosen = [_drawn(own, block, generator) for block in torch.split(angle, BLOCK)]
            part = torch.cat([angle.new_zeros(0).long(), *chosen])
            component, scale = part // len(SCALES), part % len(SCALES)
            mean = (waves(angle) * own.means[component, -1]).sum(dim=1)
            kappa = own.concentrations[component, -1] / torch.tensor(SCALES)[scale]
            drawn = mean + torch.tensor(rng.vonmises(0.0, kappa.numpy()))
            points[:, axes[-1]] = drawn / (2 * math.pi)
        return self.space.project(points)

    def to(self, device: torch.device | str) -> VonMisesNetwork:
        return VonMisesNetwork(
            self.space, [Factor(axes, chains.to(device)) for axes, chains in self.factors]
        )

    def __repr__(self) -> str:
        arrows = ", ".join(
            f"{listed(torch.tensor(axes[:-1]))} -> {axes[-1]}" for axes, _ in self.factors
        )
        return f"VonMisesNetwork({self.space!r}, {arrows})"


def log_conditional(chains: VonMisesChains, points: Tensor) -> Tensor:
    """Log density (N,) of the last angle given those before it, at points (N, d) of all."""
    before, own = _terms(chains, points)
    return log_sum_exp((before + own).flatten(1)) - log_sum_exp(before.flatten(1))


def log_of_parents(chains: VonMisesChains, points: Tensor) -> Tensor:
    """Log (N, L, K) of the density of all but the last angle, and of being that scale and component."""
    return _terms(chains, points)[0]


def _terms(chains: VonMisesChains, points: Tensor) -> tuple[Tensor, Tensor]:
    """Logs (N, L, K): of weight times the parents' density, and of the last angle's given them."""
    kappa = chains.concentrations.to(points)
    scale = points.new_tensor(SCALES)[:, None]
    fit = (chains.residuals(points).cos() - 1) * kappa
    normal = special.i0e(kappa / scale[..., None]).log()  # (L, K, d)
    before = fit[..., :-1].sum(dim=-1)[:, None] / scale
    before = before + chains.log_weights.to(points).mT - normal[..., :-1].sum(dim=-1)
    return before, fit[..., -1][:, None] / scale - normal[..., -1]


def _drawn(chains: VonMisesChains, angle: Tensor, generator: torch.Generator) -> Tensor:
    """A component and scale (N,) for each row, K * len(SCALES) + L, given the parents in it."""
    shares = shares_of(log_of_parents(chains, angle / (2 * math.pi)).mT.flatten(1))
    return torch.multinomial(shares, 1, generator=generator)[:, 0]


def averaged_networks(networks: Sequence[VonMisesNetwork]) -> VonMisesNetwork:
    """Of networks with the same arrows: that whose factors' mixtures are the means of theirs.

    Raises:
        OrbiflowError: for other arrows.
    """
    first = networks[0]
    if len({tuple(axes for axes, _ in one.factors) for one in networks}) > 1:
        raise OrbiflowError("networks with other arrows have no common mean")
    columns = zip(*(one.factors for one in networks), strict=True)
    return VonMisesNetwork(
        first.space,
        [Factor(column[0].axes, averaged([own.chains for own in column])) for column in columns],
    )
