"""Values of a density for a picture: at points, and on a grid whose pixels average narrow peaks."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from orbiflow.density.models.blend import BlendedDensity
from orbiflow.density.models.kernels import AdaptiveKernels, kernel_rows
from orbiflow.density.models.symmetric import SymmetricDensity, midpoints
from orbiflow.density.spaces.space import rectangle
from orbiflow.errors import OrbiflowError
from orbiflow.figures.density_scale import SCALES, is_outshone
from orbiflow.figures.immersions import off_cones
from orbiflow.symmetry.isometry import Array

_BLOCK = 200_000
"""Pairs of points and kernels worked on at a time: few enough for the processor's cache."""

_COARSE = 120
"""Points along a side by which a scale is chosen."""


@torch.no_grad()
def density_at(density: SymmetricDensity, points: Tensor, measure: str) -> Array:
    """Density (N,) at chart points (N, 2) of the plane; at cone points, next to them.

    Raises:
        OrbiflowError: for an unknown measure.
    """
    if density.space.is_round:
        points = off_cones(points)
    like = next(iter(density.flow.parameters()), points)
    return density.log_prob(points.to(like), measure=measure).double().cpu().exp().numpy()


@torch.no_grad()
def density_on_grid(
    density: SymmetricDensity, x: Tensor, y: Tensor, measure: str, *, pixel: float | None = None
) -> Array:
    """Density (len(x), len(y)) on the grid of chart coordinates x and y, float64.

    A kernel narrower than a pixel would be seen or missed by where the grid falls. To each kernel's
    deviation half a pixel is added, in squares: then its values on the grid sum to its mass within
    2 %, wherever it lies, and broad kernels stay as they are.

    Args:
        pixel: its side, default the step of x.

    Raises:
        OrbiflowError: for an unknown measure.
    """
    space, shape = density.space, (len(x), len(y))
    points = torch.stack(torch.meshgrid(x, y, indexing="ij"), dim=-1).reshape(-1, 2)
    if not isinstance(density, BlendedDensity):
        return density_at(density, points, measure).reshape(shape)
    if space.is_round:
        points = off_cones(points)
    values = density.log_prob_without_kernels(points).exp().numpy()
    kappa = _widened(density.kernels, pixel or float(x[1] - x[0]))
    sums = _round_sums if space.is_round else _flat_sums
    values = (
        values.reshape(shape)
        + float(density.shares[1]) * sums(density.kernels, kappa, x, y).numpy()
    )
    return values * space.log_density_factor(points, measure).exp().numpy().reshape(shape)


def takes_logarithms(density: SymmetricDensity, measure: str, scale: str) -> bool:
    """Whether colours are by logarithms: the same for all pictures of a density.

    Raises:
        OrbiflowError: for a scale that is not one of `SCALES`, or an unknown measure.
    """
    if scale not in SCALES:
        raise OrbiflowError(f"scale must be one of {', '.join(SCALES)}, got {scale!r}")
    if scale != "auto":
        return scale == "log"
    t = (torch.arange(_COARSE, dtype=torch.float64) + 0.5) / _COARSE
    values = density_on_grid(density, t, t, measure, pixel=0.5 / _COARSE).ravel()
    return is_outshone(
        values, density.space.log_area(midpoints(density.space, _COARSE)).exp().numpy()
    )


def is_sharp(density: SymmetricDensity, pixel: float) -> bool:
    """Whether peaks of the density may be narrower than pixels of that side show."""
    if not isinstance(density, BlendedDensity):
        return False
    deviations = density.kernels.concentrations**-0.5
    return bool((deviations < 2 * _half_pixels(density.kernels, pixel)).any())


def _widened(kernels: AdaptiveKernels, pixel: float) -> Tensor:
    """Concentrations of kernels whose deviations are at least half a pixel."""
    return 1 / (1 / kernels.concentrations + _half_pixels(kernels, pixel) ** 2)


def _half_pixels(kernels: AdaptiveKernels, pixel: float) -> Tensor:
    """Half a pixel's side in the kernels' angles, (d,), or, on round spaces, (N, 1)."""
    if kernels.space.is_round:
        # the chart is conformal: a small square stays a square
        area = kernels.space.log_area(off_cones(kernels.centers)).exp()
        return pixel / 2 * area.sqrt()[:, None]
    return math.pi * pixel / rectangle(kernels.space)


def _flat_sums(kernels: AdaptiveKernels, kappa: Tensor, x: Tensor, y: Tensor) -> Tensor:
    """The mixture of kernels on the grid: a matrix product, as kernels are products of the axes'."""
    space = kernels.space
    # cosets are rotations by half a turn and glides along the axes: each image of a grid is one
    ends = [torch.stack([t, torch.zeros_like(t)], dim=-1) for t in (x, y)]
    across = space.group.images(ends[0])[..., 0]
    along = space.group.images(ends[1].flip(-1))[..., 1]
    total = x.new_zeros(len(x), len(y))
    for images in zip(across, along, strict=True):
        tables = []
        for axis, (image, period) in enumerate(zip(images, rectangle(space).tolist(), strict=True)):
            angle = 2 * math.pi * (image[:, None] - kernels.centers[:, axis]) / period
            peak = period * torch.special.i0e(kappa[:, axis])
            tables.append((kappa[:, axis] * (angle.cos() - 1)).exp() / peak)
        total += (tables[0] * kernels.weights) @ tables[1].T
    return total


def _round_sums(kernels: AdaptiveKernels, kappa: Tensor, x: Tensor, y: Tensor) -> Tensor:
    """The mixture of kernels on the grid, per area of the square."""
    space = kernels.space
    points = torch.stack(torch.meshgrid(x, y, indexing="ij"), dim=-1).reshape(-1, 2)
    points = off_cones(points)
    rows, offsets = kernel_rows(space, space.features(kernels.centers)[0], kappa)
    # exponents are at most the peaks' logarithms: plain sums, in single precision for their speed
    rows, offsets = rows.mT.float(), (offsets + kernels.weights.log()).float()
    block = max(1, _BLOCK // len(offsets))
    # the clamp, far below anything drawn, keeps exp() from its slow path, fifty times slower
    sums = [
        sum(torch.addmm(offsets, end, rows).clamp_(-80).exp_().sum(dim=1) for end in ends)
        for ends in space.features(points).float().split(block, dim=1)
    ]
    square = torch.cat([torch.as_tensor(part) for part in sums]).double()
    return (square * space.log_area(points).exp()).reshape(len(x), len(y))
