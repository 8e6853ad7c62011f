"""A density on an identification space: a base distribution carried by a symmetric flow."""

from __future__ import annotations

import copy
import math
from typing import Any, ClassVar, Self

import torch
from torch import Tensor
from torch.distributions import Distribution, constraints

from orbiflow.density.bases import Base, UniformBase
from orbiflow.density.space import Space
from orbiflow.errors import OrbiflowError
from orbiflow.flows import Flow

BLOCK = 65536
"""Points integrated at a time where no gradient is asked for: bounds the memory."""

CARRIED = 4096
"""Points carried at a time with the Jacobian of the carrying."""


class SymmetricDensity(Distribution):
    """The push-forward of `base` by `flow` (paper, section 5; design point 14).

    A `torch.distributions.Distribution` over chart points: canonical representatives in [0, 1]^d,
    though any point of an orbit may be given. Densities are with respect to the area of the square
    unless another measure of `orbiflow.density.space.MEASURES` is asked for.

    Args:
        space: the identification space.
        flow: from the base to the data; its fields commute with `space.group`.
        base: default uniform on the space.
    """

    arg_constraints: ClassVar[dict[str, Any]] = {}
    has_rsample = True

    def __init__(self, space: Space, flow: Flow, base: Base | None = None) -> None:
        self.space, self.flow = space, flow
        self.base = UniformBase(space) if base is None else base
        super().__init__(event_shape=torch.Size([space.dim]), validate_args=False)

    @property
    def support(self) -> Any:  # pyright: ignore[reportIncompatibleMethodOverride]
        """All of R^d: every point stands for its orbit."""
        return constraints.independent(constraints.real, 1)

    def log_prob(self, value: Tensor, *, measure: str = "square") -> Tensor:
        """Log density (...,) at chart points (..., d).

        Raises:
            OrbiflowError: for points of another dimension, or an unknown measure.
        """
        if value.shape[-1] != self.space.dim:
            raise OrbiflowError(
                f"expected points (..., {self.space.dim}), got {tuple(value.shape)}"
            )
        if torch.is_grad_enabled() or value[..., 0].numel() <= BLOCK:
            return self._log_prob(value, measure)
        flat = value.reshape(-1, self.space.dim)
        parts = [self._log_prob(block, measure) for block in flat.split(BLOCK)]
        return torch.cat(parts).reshape(value.shape[:-1])

    def _log_prob(self, value: Tensor, measure: str) -> Tensor:
        # flow, base and area are invariant: no need to project
        start, log_det = self.flow.inverse_and_log_det(value)
        density = self.base.log_prob(start) + log_det
        return density + self.space.log_density_factor(value, measure)

    def sample(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, sample_shape: Any = (), generator: torch.Generator | None = None
    ) -> Tensor:
        """Canonical points (*sample_shape, d), float64; the same generator state, the same points."""
        with torch.no_grad():
            return self.rsample(sample_shape, generator)

    def rsample(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, sample_shape: Any = (), generator: torch.Generator | None = None
    ) -> Tensor:
        """As `sample`, differentiable in the flow's parameters."""
        shape = torch.Size(sample_shape)
        source = generator or torch.default_generator
        start = self.base.sample(shape.numel(), source).to(self._like())
        if torch.is_grad_enabled():
            moved = self.flow(start)
        else:
            moved = torch.cat([self.flow(block) for block in start.split(BLOCK)])
        return self.space.project(moved).reshape(*shape, self.space.dim)

    def to_base(self, points: Tensor) -> Tensor:
        """Where data points (..., d) come from: canonical points distributed as the base."""
        return self.space.project(self.flow.inverse(self.space.project(points)))

    def from_base(self, points: Tensor) -> Tensor:
        """Where base points (..., d) are carried, canonical."""
        return self.space.project(self.flow(points))

    @torch.no_grad()
    def entropy(
        self,
        count: int = 16384,
        *,
        measure: str = "natural",
        generator: torch.Generator | None = None,
    ) -> Tensor:
        """Monte Carlo estimate of -E[log p], in nats, from `count` samples."""
        return -self.log_prob(self.sample((count,), generator), measure=measure).mean()

    @torch.no_grad()
    def kl_to(
        self, other: Distribution, count: int = 16384, *, generator: torch.Generator | None = None
    ) -> Tensor:
        """Monte Carlo estimate of KL(self || other) from `count` samples of self."""
        points = self.sample((count,), generator)
        return (self.log_prob(points) - other.log_prob(points)).mean()

    def mass(self, resolution: int = 64) -> float:
        """The density's integral over the square, by the midpoint rule on resolution^2 points.

        The points are spread evenly over the base and carried by the flow, so that they crowd where
        the density is high, and each counts for the area that its surroundings are carried to: the
        Jacobian of the carrying, taken by automatic differentiation. What is off from 1 is the
        integrator's error: a plain grid of 512^2 misses 1 % of a density in sharp clusters.

        Raises:
            OrbiflowError: in more than two dimensions, where a grid is out of reach.
        """
        grid = midpoints(self.space, resolution).to(self._like())
        parts = [self._carried_mass(block) for block in grid.split(CARRIED)]
        return float(torch.cat(parts).mean())

    def _carried_mass(self, start: Tensor) -> Tensor:
        with torch.enable_grad():
            start = start.requires_grad_()
            end = self.flow(start)
            rows = [
                torch.autograd.grad(end[:, k].sum(), start, retain_graph=k == 0)[0] for k in (0, 1)
            ]
        with torch.no_grad():
            # signed: a map that folds still covers the square once
            area = torch.linalg.det(torch.stack(rows, dim=1))
            return self.log_prob(end.detach()).exp() * area

    @torch.no_grad()
    def integration_error(self, points: Tensor) -> float:
        """Largest change of the log density at `points` when the steps are doubled."""
        finer = self.with_steps(2 * self.flow.steps)
        return float((finer.log_prob(points) - self.log_prob(points)).abs().max())

    def with_steps(self, steps: int) -> Self:
        """The same density with its flow integrated in other steps: a view, see `Flow.with_steps`."""
        view = copy.copy(self)
        view.flow = self.flow.with_steps(steps)
        return view

    def _like(self) -> Tensor:
        return next(iter(self.flow.parameters()), torch.zeros((), dtype=torch.float64))

    def __repr__(self) -> str:
        return f"SymmetricDensity({self.space!r}, {type(self.base).__name__}, {self.flow})"


def midpoints(space: Space, resolution: int) -> Tensor:
    """Midpoints (resolution^2, 2) of a grid on the canonical square, float64.

    Raises:
        OrbiflowError: if the space has another dimension than two.
    """
    if space.dim != 2:
        raise OrbiflowError(f"a grid needs two dimensions, this {space.name} has {space.dim}")
    t = (torch.arange(resolution, dtype=torch.float64) + 0.5) / resolution
    return torch.stack(torch.meshgrid(t, t, indexing="ij"), dim=-1).reshape(-1, 2)


def kl_by_quadrature(target: Tensor, log_density: Tensor) -> float:
    """KL(p || p_hat) in nats from values on an even grid of the square.

    Args:
        target: p >= 0 (N,), density on the square.
        log_density: log p_hat (N,).
    """
    weight = target / target.sum()
    live = weight > 0
    log_target = (weight[live] * len(weight)).log()
    value = (weight[live] * (log_target - log_density[live])).sum()
    return float(value) if math.isfinite(float(value)) else math.inf
