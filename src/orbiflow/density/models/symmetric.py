"""A density on an identification space: a base distribution carried by a symmetric flow."""

from __future__ import annotations

import copy
import math
import numbers
from typing import Any, ClassVar, Self

import torch
from torch import Tensor
from torch.distributions import Distribution, constraints

from orbiflow.density.arguments import (
    check_kind,
    check_range,
    float_tensor,
    points_tensor,
)
from orbiflow.density.models.bases import Base, UniformBase
from orbiflow.density.models.moving import destination, moved
from orbiflow.density.spaces import CHART, Space
from orbiflow.errors import OrbiflowError
from orbiflow.flows import Flow
from orbiflow.runtime import one_thread
from orbiflow.typed_torch import linalg

BLOCK = 65536
"""Points integrated at a time where no gradient is asked for: bounds the memory."""

CARRIED = 4096
"""Points carried at a time with the Jacobian of the carrying."""


class SymmetricDensity(Distribution):
    """The push-forward of `base` by `flow` (paper, section 5; design point 14).

    A `torch.distributions.Distribution` over chart points: canonical representatives in [0, 1]^d,
    though any point of an orbit may be given. Densities are with respect to the area of the square
    unless another measure of `orbiflow.density.spaces.space.MEASURES` is asked for.

    Args:
        space: the identification space.
        flow: from the base to the data; its fields commute with `space.group`.
        base: default uniform on the space.
    """

    arg_constraints: ClassVar[dict[str, Any]] = {}  # pyright: ignore[reportIncompatibleMethodOverride]
    has_rsample = True
    block: ClassVar[int] = BLOCK

    error: float = 0.0
    """Nats, root mean square, by which a density with tabulated parts is off what it stands for; see
    `orbiflow.density.marginal`."""

    def __init__(self, space: Space, flow: Flow, base: Base | None = None) -> None:
        self.space = check_kind(space, Space, "space", "see `make_space`")
        self.flow = check_kind(flow, Flow, "flow")
        self.base = UniformBase(space) if base is None else check_kind(base, Base, "base")
        super().__init__(event_shape=torch.Size([space.dim]), validate_args=False)

    @property
    def support(self) -> Any:  # pyright: ignore[reportIncompatibleMethodOverride]
        """All of R^d: every point stands for its orbit."""
        return constraints.independent(constraints.real, 1)

    @one_thread()
    def log_prob(self, value: Tensor, *, measure: str = CHART) -> Tensor:
        """Log density (...,) at chart points (..., d), with respect to `measure`.

        Evaluated in the dtype of the flow, returned in that of the points.

        Raises:
            OrbiflowError: for points of another dimension or on another device, points that are not
                finite, or an unknown measure.
        """
        points = self._here(value)
        own = points.to(self._like().dtype)
        if torch.is_grad_enabled() or own[..., 0].numel() <= self.block:
            return self._log_prob(own, measure).to(points.dtype)
        flat = own.reshape(-1, self.space.dim)
        parts = [self._log_prob(block, measure) for block in torch.split(flat, self.block)]
        return torch.cat(parts).reshape(points.shape[:-1]).to(points.dtype)

    def _log_prob(self, value: Tensor, measure: str) -> Tensor:
        # flow, base and area are invariant: no need to project
        start, log_det = self.flow.inverse_and_log_det(value)
        density = self.base.log_prob(start) + log_det
        return density + self.space.log_density_factor(value, measure)

    def sample(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, sample_shape: Any = (), generator: torch.Generator | None = None
    ) -> Tensor:
        """Canonical points (*sample_shape, d) in the flow's dtype, of a shape or a number of points.

        The same generator state, the same points; default torch's own generator.

        Raises:
            OrbiflowError: for what is no shape.
        """
        with torch.no_grad():
            return self.rsample(sample_shape, generator)

    @one_thread()
    def rsample(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, sample_shape: Any = (), generator: torch.Generator | None = None
    ) -> Tensor:
        """As `sample`, differentiable in the flow's parameters."""
        shape = shape_of(sample_shape)
        source = source_of(generator)
        start = self.base.sample(shape.numel(), source).to(self._like())
        if torch.is_grad_enabled():
            moved = self.flow(start)
        else:
            moved = torch.cat([self.flow(block) for block in torch.split(start, BLOCK)])
        return self.space.project(moved).reshape(*shape, self.space.dim)

    @one_thread()
    def to_base(self, points: Tensor) -> Tensor:
        """Where data points (..., d) come from: canonical points distributed as the base."""
        own = self._here(points).to(self._like().dtype)
        return self.space.project(self.flow.inverse(self.space.project(own)))

    @one_thread()
    def from_base(self, points: Tensor) -> Tensor:
        """Where base points (..., d) are carried, canonical."""
        own = self._here(points).to(self._like().dtype)
        return self.space.project(self.flow(own))

    @torch.no_grad()
    def entropy(
        self,
        count: int = 16384,
        *,
        measure: str = CHART,
        generator: torch.Generator | None = None,
    ) -> Tensor:
        """Monte Carlo estimate of -E[log p], in nats, from `count` samples.

        With respect to `measure`, by default that of `log_prob`; "natural" for the entropy in the
        user's units or per steradian.
        """
        return -self.log_prob(self.sample((count,), generator), measure=measure).mean()

    @torch.no_grad()
    def kl_to(
        self, other: Distribution, count: int = 16384, *, generator: torch.Generator | None = None
    ) -> Tensor:
        """Monte Carlo estimate of KL(self || other) from `count` samples of self."""
        points = self.sample((count,), generator)
        return (self.log_prob(points) - other.log_prob(points)).mean()

    @one_thread()
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
        parts = [self._carried_mass(block) for block in torch.split(grid, CARRIED)]
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
            area = linalg.det(torch.stack(rows, dim=1))
            return self._log_prob(end.detach(), CHART).exp() * area

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

    def to(self, *wanted: Any) -> Self:
        """A copy elsewhere: `to("cuda")`, `to(torch.float32)`, `to("cuda", torch.float32)`.

        Or where a tensor is: `to(tensor)`. The dtype is the flow's. Kernels, chains, networks and
        shares stay in float64 on any device. Samples are drawn on the CPU and moved, so that the same
        state of a generator gives the same points.

        Raises:
            OrbiflowError: for what is neither a device nor a floating dtype.

        >>> from orbiflow.density import make_space
        >>> from orbiflow.density.models import still_flow
        >>> space = make_space("torus")
        >>> single = SymmetricDensity(space, still_flow(space)).to(torch.float32)
        >>> single.sample(5).dtype
        torch.float32
        """
        device, dtype = destination(*wanted)
        new = copy.copy(self)
        for name, value in vars(self).items():
            if isinstance(value, Flow):  # a module moves in place
                setattr(new, name, moved(copy.deepcopy(value), device, dtype))
            else:
                setattr(new, name, moved(value, device))
        return new

    def _here(self, value: Any) -> Tensor:
        """Points (..., d), which no device's are moved from another."""
        points, device = points_tensor(value, self.space.dim), self._like().device
        if not isinstance(value, Tensor):
            return points.to(device)
        if points.device != device and next(self.flow.parameters(), None) is not None:
            raise OrbiflowError(
                f"the points are on {points.device}, the density is on {device}: move one of them, "
                "such as density.to(points.device)"
            )
        return points

    def _like(self) -> Tensor:
        return next(iter(self.flow.parameters()), torch.zeros((), dtype=torch.float64))

    def __repr__(self) -> str:
        return f"SymmetricDensity({self.space!r}, {type(self.base).__name__}, {self.flow})"


def source_of(generator: torch.Generator | None) -> torch.Generator:
    """
    Raises:
        OrbiflowError: for a generator that is not on the CPU.
    """
    if generator is None:
        return torch.default_generator
    if generator.device.type != "cpu":
        raise OrbiflowError(
            f"samples are drawn on the CPU, the generator is on {generator.device}: give a "
            "torch.Generator() without a device"
        )
    return generator


def shape_of(sample_shape: Any) -> torch.Size:
    """A number of samples, or the shape in which they are wanted.

    Raises:
        OrbiflowError: for another thing, or a negative number.
    """
    sizes = (int(sample_shape),) if isinstance(sample_shape, numbers.Integral) else sample_shape
    try:
        shape = torch.Size(sizes)
    except TypeError as error:
        raise OrbiflowError(f"expected a number or shape of samples: {error}") from error
    if any(size < 0 for size in shape):
        raise OrbiflowError(f"expected a number or shape of samples, got {tuple(shape)}")
    return shape


def midpoints(space: Space, resolution: int) -> Tensor:
    """Midpoints (resolution^2, 2) of a grid on the canonical square, float64.

    Raises:
        OrbiflowError: if the space has another dimension than two, or for a resolution below 1.
    """
    check_range("resolution", resolution, 1, 1e6, integer=True)
    if space.dim != 2:
        raise OrbiflowError(f"a grid needs two dimensions, this {space.name} has {space.dim}")
    t = (torch.arange(resolution, dtype=torch.float64) + 0.5) / resolution
    return torch.stack(torch.meshgrid(t, t, indexing="ij"), dim=-1).reshape(-1, 2)


def kl_by_quadrature(target: Tensor, log_density: Tensor) -> float:
    """KL(p || p_hat) in nats from values on an even grid of the square.

    Args:
        target: p >= 0 (N,), density on the square.
        log_density: log p_hat (N,).

    Raises:
        OrbiflowError: for other shapes.
    """
    target, log_density = float_tensor(target, "target"), float_tensor(log_density, "log_density")
    if target.dim() != 1 or target.shape != log_density.shape:
        raise OrbiflowError(
            f"expected two tables (N,), got {tuple(target.shape)} and {tuple(log_density.shape)}"
        )
    weight = target / target.sum()
    live = weight > 0
    log_target = (weight[live] * len(weight)).log()
    value = (weight[live] * (log_target - log_density[live])).sum()
    return float(value) if math.isfinite(float(value)) else math.inf
