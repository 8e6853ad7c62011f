"""Densities on grids and off tables, integrals, and gradients in the data's own coordinates."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.arguments import as_instance, as_points, as_tensor, as_whole
from orbiflow.arrays import Array
from orbiflow.density.models.density import Density, destination, log_area_factor, moved
from orbiflow.density.models.kernels import AdaptiveKernels
from orbiflow.density.spaces import CHART, Space, rectangle
from orbiflow.errors import OrbiflowError
from orbiflow.fields import padded, spline_sum, symbol
from orbiflow.runtime import one_thread
from orbiflow.typed_torch import fft

GRADIENT_BLOCK = 16_384
"""Points evaluated at a time, as a flow keeps all its steps for the gradient."""


@one_thread()
def log_density_gradient(density: Density, data: ArrayLike) -> tuple[Array, Array]:
    """Return log densities (N,) in natural measure at data (N, k), and their gradients (N, k).

    Gradients are in the coordinates and units of the data: in nats per radian, degree or turn of each
    angle, and per degree of latitude and longitude. For unit vectors it is the vector of R^3 that is
    tangent to the sphere and points uphill, in nats per radian. At a pole nothing depends on the
    longitude. At a cone point of the chart (`RoundSpace.cone_vectors`) the gradient is not a number.

    Exact: in closed form for kernels, by automatic differentiation for flows.

    >>> from orbiflow.density import DensityEstimator
    >>> angles = np.random.default_rng(0).vonmises(0.0, 4.0, (100, 1))
    >>> estimator = DensityEstimator("torus", components="mixture").fit(angles)
    >>> values, slopes = log_density_gradient(estimator.density_, [[-1.0], [1.0]])
    >>> np.sign(slopes[:, 0]).tolist()
    [1.0, -1.0]
    """
    space = as_instance(density, Density, "density").space
    points = space.cover(data)
    values: list[Tensor] = []
    slopes: list[Tensor] = []
    for block in torch.split(points, GRADIENT_BLOCK):
        with torch.enable_grad():
            at = block.detach().clone().requires_grad_()
            found = density.log_prob(at, measure="natural")
            (slope,) = torch.autograd.grad(found.sum(), at)
        values.append(found.detach().double())
        slopes.append(slope.double())
    if not values:
        return np.zeros(0), np.zeros(np.shape(data))
    table = np.asarray(data, dtype=np.float64)
    gradient = space.data_gradient(table, points, torch.cat(slopes))
    return torch.cat(values).numpy(), gradient


def midpoints(space: Space, resolution: int) -> Tensor:
    """Return points (resolution^d, d) at which a mean is an integral over the space, float64.

    They are the midpoints of an even grid on the unit cube or, where that is not the fundamental
    domain, on the lattice's cell.
    """
    as_instance(space, Space, "space", "see `make_space`")
    return space.midpoints(resolution)


def kl_by_quadrature(target: Tensor, log_density: Tensor) -> float:
    """Return KL(p || p_hat) in nats from values (N,) of p and log p_hat on an even grid."""
    target, log_density = as_tensor(target, "target"), as_tensor(log_density, "log_density")
    if target.dim() != 1 or target.shape != log_density.shape:
        raise OrbiflowError(
            f"expected two tables (N,), got {tuple(target.shape)} and {tuple(log_density.shape)}"
        )
    weight = target / target.sum()
    live = weight > 0
    log_target = (weight[live] * len(weight)).log()
    value = (weight[live] * (log_target - log_density[live])).sum()
    return float(value) if math.isfinite(float(value)) else math.inf


CHECKED = 4096
"""Random points at which the table is compared with the density."""

BLOCK = 16384
"""Points looked up at a time: their sixteen coefficients stay in the cache."""


CELLS = 4.0
"""Deviation, in cells of the table, of the narrowest kernels that it can follow."""

LOOSE = 1e-7
"""The share of the density that may be left out of the sum of narrower kernels."""


class TabulatedDensity:
    """The cubic spline through a density's logarithm, relative to the uniform one, on an even grid.

    Kernels narrower than `CELLS` cells are not on the table: those near a point are summed, so the
    error is that of what is smooth. Invariant under the group as the density is. No longer normalised
    to rounding, only to `error`.

    Args:
        density: A density in two dimensions, on a rectangular lattice.
        resolution: Grid points along a side of the square.

    Attributes:
        error: The root mean square difference of log densities at samples of the density, in nats.
        largest: The largest difference at those samples and as many uniform points.
    """

    @one_thread()
    def __init__(self, density: Density, resolution: int = 512) -> None:
        space = as_instance(density, Density, "density").space
        if space.dim != 2 or not space.has_square:
            raise OrbiflowError(
                f"a table needs a space of two dimensions with a canonical square, which this "
                f"{space.name} of {space.dim} is not: evaluate the density itself"
            )
        as_whole(resolution, "resolution", 8, 4096)
        self.space, self.resolution = space, resolution
        self._narrow: AdaptiveKernels | None = None
        smooth = self._smooth_part(density)
        self._table = padded(self._coefficients(smooth)[None])
        generator = torch.Generator().manual_seed(0)
        with torch.no_grad():
            drawn = density.sample((CHECKED,), generator)
            even = space.uniform(CHECKED, generator)
            off = [self.log_prob(p) - density.log_prob(p) for p in (drawn, even)]
        self.error = float(off[0].square().mean().sqrt())
        self.largest = float(torch.cat(off).abs().max())

    def _smooth_part(self, density: Density) -> Callable[[Tensor], Tensor]:
        """Return the log of what is tabulated at points (N, 2), relative to the uniform density.

        Kernels that are too narrow for the table are set aside.
        """
        part = density.kernel_part
        if part is None:
            return lambda points: density.log_prob(points, measure="uniform")
        weight, kernels = part
        uniform = log_area_factor(self.space, "uniform")
        wide, self._narrow, share = kernels.parted(_wide(kernels, self.resolution))
        # the kernels' own measure is the area of the sphere, or that of the square
        self._shift, self._log_floor = uniform, density.log_floor + uniform
        self._log_weight = math.log(weight * (1 - share)) if self._narrow else -math.inf

        def smooth(points: Tensor) -> Tensor:
            rest = density.log_density_without_kernels(points) + uniform
            if wide is None:
                return rest
            own = wide.log_density(points, tolerance=LOOSE).to(rest)
            return torch.logaddexp(rest, own + math.log(weight * share) + uniform)

        return smooth

    def _coefficients(self, smooth: Callable[[Tensor], Tensor]) -> Tensor:
        space, n = self.space, self.resolution
        sides = [round(n * float(p)) for p in rectangle(space)]
        # half a step off: no point falls on a cone point, where the area factor is singular
        axes = [(torch.arange(m, dtype=torch.float64) + 0.5) / n for m in sides]
        grid = torch.stack(torch.meshgrid(*axes, indexing="ij"), dim=-1).reshape(-1, 2)
        cell = (space.project(grid) * n).floor().long().clamp(0, n - 1)
        with torch.no_grad():
            values = smooth(midpoints(space, n)).double().reshape(n, n)
        whole = values[cell[:, 0], cell[:, 1]].reshape(sides)
        along, across = (symbol(m) for m in sides)
        spectrum = fft.fft2(whole) / (along[:, None] * across[None, :])
        return fft.ifft2(spectrum).real.contiguous()

    def to(self, device: torch.device | str) -> TabulatedDensity:
        """Return a copy on a device; it stays in float64."""
        new, (to, _) = copy.copy(self), destination(device)
        for name, value in vars(self).items():
            setattr(new, name, moved(value, to))
        return new

    @one_thread()
    def log_prob(self, points: Tensor, *, measure: str = CHART) -> Tensor:
        """Return interpolated log densities (...,) at chart points (..., 2); see `error`.

        Differentiable once in the points.
        """
        points = as_points(points, 2)
        flat = points.reshape(-1, 2).double()
        cells = flat.mT * self.resolution - 0.5
        parts = [spline_sum(self._table, block)[0] for block in torch.split(cells, BLOCK, dim=1)]
        values = torch.cat(parts)
        if self._narrow is not None:
            beside = self._log_floor - self._log_weight - self._shift
            own = self._narrow.log_density(flat, beside, LOOSE)
            values = torch.logaddexp(values, own + (self._log_weight + self._shift))
        if measure == "natural":  # the area factor, costlier than the table, drops out
            values = values - math.log(self.space.volume)
        elif measure != "uniform":
            values = values - self.space.log_density_factor(flat, "uniform")
            values = values + self.space.log_density_factor(flat, measure)
        return values.reshape(points.shape[:-1])

    def __repr__(self) -> str:
        return (
            f"TabulatedDensity({self.space!r}, {self.resolution} points a side, "
            f"error {self.error:.1e} nats)"
        )


def _wide(kernels: AdaptiveKernels, resolution: int) -> Tensor:
    """Return which kernels (N,) a table of this resolution can follow along both axes."""
    space = kernels.space
    if space.is_round:  # the chart is conformal
        scale = (space.log_area(kernels.centers) / 2).exp()[:, None]
        # it is far from even across a wide kernel: nothing is narrower than it would be at best
        scale = scale.clamp_min(0.5)
    else:
        scale = 2 * math.pi / rectangle(space)
    return (kernels.concentrations**-0.5 > CELLS / resolution * scale).all(dim=1)
