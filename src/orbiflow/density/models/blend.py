"""A flow's density beside adaptive kernels, a uniform floor, von Mises chains and a network."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import torch
from torch import Tensor

from orbiflow.density.arguments import check_kind, float_tensor
from orbiflow.density.models.bases import Base, UniformBase
from orbiflow.density.models.chains import VonMisesChains
from orbiflow.density.models.kernels import AdaptiveKernels
from orbiflow.density.models.network import VonMisesNetwork
from orbiflow.density.models.symmetric import (
    BLOCK,
    SymmetricDensity,
    shape_of,
    source_of,
)
from orbiflow.density.spaces import (
    CHART,
    Space,
    check_measure,
)
from orbiflow.errors import OrbiflowError
from orbiflow.flows import Flow
from orbiflow.runtime import one_thread
from orbiflow.typed_torch import listed


class BlendedDensity(SymmetricDensity):
    """A mixture of a flow, kernels, the uniform density and, if there are, chains and a network.

    Exact and normalised. The flow, the chains and the network give the broad shape, the kernels what is
    sharper than a flow's waves, the floor keeps a lone observation from being impossible. `to_base` and
    `from_base` are the flow's.

    Args:
        space, flow, base: see `SymmetricDensity`.
        kernels: on the same space.
        shares: of flow, kernels, uniform floor, and of chains and network if they are there, in this
            order; of sum 1, positive but for the flow's: with 0 it is not evaluated.
        chains, network: on the same torus; None for none.

    Raises:
        OrbiflowError: for shares that are no proportions.
    """

    block: ClassVar[int] = 2**19  # tiles of many points cost less a point

    def __init__(
        self,
        space: Space,
        flow: Flow,
        base: Base,
        kernels: AdaptiveKernels,
        shares: Tensor,
        *,
        chains: VonMisesChains | None = None,
        network: VonMisesNetwork | None = None,
    ) -> None:
        super().__init__(space, flow, base)
        check_kind(kernels, AdaptiveKernels, "kernels")
        shares = float_tensor(shares, "shares")
        count = 3 + (chains is not None) + (network is not None)
        if (
            shares.shape != (count,)
            or not bool((shares[1:] > 0).all() and shares[0] >= 0)
            or abs(float(shares.sum()) - 1) > 1e-6
        ):
            raise OrbiflowError(f"shares must be {count} proportions, got {listed(shares)}")
        if chains is not None:
            check_kind(chains, VonMisesChains, "chains")
        if network is not None:
            check_kind(network, VonMisesNetwork, "network")
        self.kernels, self.shares = kernels, shares.double()
        self.chains, self.network = chains, network
        self._uniform = UniformBase(space)

    @property
    def flow_density(self) -> SymmetricDensity:
        """The flow's part alone."""
        return SymmetricDensity(self.space, self.flow, self.base)

    @property
    def _broad(self) -> dict[str, Base]:
        """What else there is, by name, in the order of `shares`, of which they are the last."""
        named = {"chains": self.chains, "network": self.network}
        return {name: part for name, part in named.items() if part is not None}

    @property
    def parts(self) -> dict[str, SymmetricDensity | Base]:
        """All parts by name, in the order of `shares`."""
        first = {"flow": self.flow_density, "kernels": self.kernels, "uniform": self._uniform}
        return {**first, **self._broad}

    def _log_prob(self, value: Tensor, measure: str) -> Tensor:
        return self._shifted(self._parts(value, kernels=True), value, measure)

    @one_thread()
    def log_prob_without_kernels(self, points: Tensor, *, measure: str = CHART) -> Tensor:
        """Log of the density less the kernels' share of it, (N,) at chart points (N, d).

        Of integral 1 - shares_1.
        """
        value = self._here(points).to(self._like().dtype)
        return self._shifted(self._parts(value, kernels=False), value, measure)

    @property
    def kernels_beside(self) -> float:
        """Logarithm of the floor over the kernels' share, for `AdaptiveKernels.log_density`."""
        ratio = float((self.shares[2] / self.shares[1]).log())
        return ratio - math.log(self.space.volume) if self.space.is_round else ratio

    def _parts(self, value: Tensor, *, kernels: bool) -> Tensor:
        """Log density (...,) per round area on round spaces, per area of the square on flat ones."""
        log_shares = self.shares.log().to(value)
        floor = -math.log(self.space.volume) if self.space.is_round else 0.0
        total = (log_shares[2] + floor).expand(value.shape[:-1])
        if kernels:
            own = self.kernels.log_density(value, self.kernels_beside)
            total = torch.logaddexp(total, own + log_shares[1])
        for own, log_share in zip(self._broad.values(), log_shares[3:], strict=True):
            total = torch.logaddexp(total, own.log_prob(value) + log_share)
        if float(self.shares[0]) > 0:
            flow = self._of_flow(value)
            if self.space.is_round:
                flow = flow - self.space.log_area(value)
            total = torch.logaddexp(total, flow + log_shares[0])
        return total

    def _of_flow(self, value: Tensor) -> Tensor:
        """The flow's log density (...,) per area of the square; in blocks if it needs no gradient."""
        if torch.is_grad_enabled():
            start, log_det = self.flow.inverse_and_log_det(value)
            return self.base.log_prob(start) + log_det
        parts: list[Tensor] = []
        for block in torch.split(value.reshape(-1, self.space.dim), BLOCK):
            start, log_det = self.flow.inverse_and_log_det(block)
            parts.append(self.base.log_prob(start) + log_det)
        return torch.cat(parts).reshape(value.shape[:-1])

    def _shifted(self, values: Tensor, points: Tensor, measure: str) -> Tensor:
        """Log densities as of `_parts` with respect to `measure`."""
        check_measure(measure)
        volume = math.log(self.space.volume)
        if measure == CHART:
            return values + self.space.log_area(points) if self.space.is_round else values
        shift = (0.0 if self.space.is_round else -volume) + (
            volume if measure == "uniform" else 0.0
        )
        return values + shift

    @one_thread()
    def rsample(self, sample_shape: Any = (), generator: torch.Generator | None = None) -> Tensor:
        """As `sample`, differentiable in the flow's parameters."""
        shape = shape_of(sample_shape)
        source = source_of(generator)
        if not shape.numel():
            return self._like().new_empty(*shape, self.space.dim)
        shares = self.shares.cpu()
        part = torch.multinomial(shares, shape.numel(), replacement=True, generator=source)
        counts: list[int] = listed(torch.bincount(part, minlength=len(shares)))
        drawn = self._like().new_empty(shape.numel(), self.space.dim)
        for index, (count, own_part) in enumerate(zip(counts, self.parts.values(), strict=True)):
            if not count:  # as a flow without a share
                continue
            if isinstance(own_part, Base):
                own = own_part.sample(count, source)
            else:
                own = super().rsample((count,), source)
            at = torch.nonzero(part == index)[:, 0].to(drawn.device)
            drawn = drawn.index_put((at,), own.to(drawn))
        return drawn.reshape(*shape, self.space.dim)

    @torch.no_grad()
    def mass(self, resolution: int = 64) -> float:
        """As of any density; all but the flow, normalised in closed form, counts as its shares.

        A grid would miss the narrowest kernels.
        """
        if float(self.shares[0]) == 0:
            return 1.0
        return self.mass_with(self.flow_density.mass(resolution))

    def mass_with(self, flow_mass: float) -> float:
        """The blend's integral, given that of the flow's part."""
        share = float(self.shares[0])
        return share * flow_mass + 1 - share

    def __repr__(self) -> str:
        shares = zip(self.parts, listed(self.shares), strict=True)
        parts = ", ".join(f"{name} {100 * share:.1f}%" for name, share in shares)
        return f"BlendedDensity({self.space!r}, {parts})"
