"""A flow's density beside adaptive kernels and a uniform floor."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from orbiflow.density.arguments import check_kind, float_tensor
from orbiflow.density.models.bases import Base, UniformBase
from orbiflow.density.models.kernels import AdaptiveKernels
from orbiflow.density.models.symmetric import SymmetricDensity, shape_of
from orbiflow.density.spaces.space import Space
from orbiflow.errors import OrbiflowError
from orbiflow.flows import Flow
from orbiflow.threads import one_thread


class BlendedDensity(SymmetricDensity):
    """shares_0 flow + shares_1 kernels + shares_2 uniform: exact, normalised, invariant.

    The flow gives the broad shape, the kernels what is sharper than its waves, the floor keeps a
    lone observation from being impossible. `to_base` and `from_base` are the flow's.

    Args:
        space, flow, base: see `SymmetricDensity`.
        kernels: on the same space.
        shares: (3,), positive, of sum 1.

    Raises:
        OrbiflowError: for shares that are no proportions.
    """

    def __init__(
        self, space: Space, flow: Flow, base: Base, kernels: AdaptiveKernels, shares: Tensor
    ) -> None:
        super().__init__(space, flow, base)
        check_kind(kernels, AdaptiveKernels, "kernels")
        shares = float_tensor(shares, "shares")
        if (
            shares.shape != (3,)
            or not bool((shares > 0).all())
            or abs(float(shares.sum()) - 1) > 1e-6
        ):
            raise OrbiflowError(f"shares must be three proportions, got {shares.tolist()}")
        self.kernels, self.shares = kernels, shares.double()
        self._uniform = UniformBase(space)

    @property
    def flow_density(self) -> SymmetricDensity:
        """The flow's part alone."""
        return SymmetricDensity(self.space, self.flow, self.base)

    def _log_prob(self, value: Tensor, measure: str) -> Tensor:
        start, log_det = self.flow.inverse_and_log_det(value)
        parts = [
            self.base.log_prob(start) + log_det,
            self.kernels.log_prob(value),
            self._uniform.log_prob(value),
        ]
        weighted = [part + s.log() for part, s in zip(parts, self.shares.to(value), strict=True)]
        blended = torch.stack(weighted).logsumexp(dim=0)
        return blended + self.space.log_density_factor(value, measure)

    @one_thread()
    def rsample(self, sample_shape: Any = (), generator: torch.Generator | None = None) -> Tensor:
        """As `sample`, differentiable in the flow's parameters."""
        shape = shape_of(sample_shape)
        source = generator or torch.default_generator
        part = torch.multinomial(self.shares, shape.numel(), replacement=True, generator=source)
        counts = torch.bincount(part, minlength=3).tolist()
        drawn = self._like().new_empty(shape.numel(), self.space.dim)
        drawn = drawn.index_put(
            (torch.nonzero(part == 0)[:, 0],), super().rsample((counts[0],), source)
        )
        for index, other in ((1, self.kernels), (2, self._uniform)):
            drawn = drawn.index_put(
                (torch.nonzero(part == index)[:, 0],),
                other.sample(counts[index], source).to(drawn),
            )
        return drawn.reshape(*shape, self.space.dim)

    @torch.no_grad()
    def mass(self, resolution: int = 64) -> float:
        """As of any density; kernels and floor, normalised in closed form, count as their shares.

        A grid would miss the narrowest kernels.
        """
        return self.mass_with(self.flow_density.mass(resolution))

    def mass_with(self, flow_mass: float) -> float:
        """The blend's integral, given that of the flow's part."""
        share = float(self.shares[0])
        return share * flow_mass + 1 - share

    def __repr__(self) -> str:
        flow, kernels, floor = (f"{100 * s:.1f}%" for s in self.shares.tolist())
        return f"BlendedDensity({self.space!r}, flow {flow}, kernels {kernels}, uniform {floor})"
