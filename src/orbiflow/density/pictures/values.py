"""Values of a density for a picture: at points, and on a grid whose pixels average narrow peaks."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models import (
    AdaptiveKernels,
    BlendedDensity,
    SymmetricDensity,
    midpoints,
)
from orbiflow.density.pictures.scale import (
    DARKEST,
    SCALES,
    dark_share,
)
from orbiflow.density.pictures.surfaces import off_cones
from orbiflow.density.spaces import rectangle
from orbiflow.errors import OrbiflowError

_TOLERANCE = 1e-5
"""Of what is drawn, relative to it."""

_KERNELS = 4096
"""Summed at a time: tables of all would be gigabytes."""

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
    kernels, pixel = density.kernels, pixel or float(x[1] - x[0])
    kappa = _widened(kernels, _half_pixels(kernels, pixel))
    if space.is_round:
        sums = _round_sums(kernels, kappa, points).reshape(shape)
    else:
        sums = _flat_sums(kernels, kappa, x, y)
    values = values.reshape(shape) + float(density.shares[1]) * sums.numpy()
    return values * space.log_density_factor(points, measure).exp().numpy().reshape(shape)


@torch.no_grad()
def density_on_map(density: SymmetricDensity, points: Tensor, measure: str, angle: float) -> Array:
    """Density (N,) at chart points (N, 2) of a round space, that of kernels averaged over pixels.

    Args:
        angle: a pixel's side on the sphere, in radians.

    Raises:
        OrbiflowError: for an unknown measure.
    """
    if not isinstance(density, BlendedDensity):
        return density_at(density, points, measure)
    points = off_cones(points)
    kappa = _widened(density.kernels, torch.tensor(angle / 2))
    values = density.log_prob_without_kernels(points).exp()
    values = values + float(density.shares[1]) * _round_sums(density.kernels, kappa, points)
    return (values * density.space.log_density_factor(points, measure).exp()).numpy()


class Chosen(NamedTuple):
    """Whether colours are by logarithms, and why, in words for a caption."""

    log: bool
    why: str


def chosen_scale(density: SymmetricDensity, measure: str, scale: str) -> Chosen:
    """The scale of colours: the same for all pictures of a density.

    Raises:
        OrbiflowError: for a scale that is not one of `SCALES`, or an unknown measure.
    """
    if scale not in SCALES:
        raise OrbiflowError(f"scale must be one of {', '.join(SCALES)}, got {scale!r}")
    if scale != "auto":
        return Chosen(scale == "log", f"{_SAID[scale == 'log']}, as asked for")
    t = (torch.arange(_COARSE, dtype=torch.float64) + 0.5) / _COARSE
    values = density_on_grid(density, t, t, measure, pixel=0.5 / _COARSE).ravel()
    areas = density.space.log_area(midpoints(density.space, _COARSE)).exp().numpy()
    dark = dark_share(values, areas)
    log = dark > DARKEST
    # never more than what is true: 99.6 % are not all
    share, side = (int(100 * dark), "below") if log else (math.ceil(100 * (1 - dark)), "above")
    reason = f"the density is {side} a tenth of its peak on {share} % of the area"
    return Chosen(log, f"{_SAID[log]}, as {reason}")


_SAID = {False: "colours are linear", True: "colours are logarithmic"}


def takes_logarithms(density: SymmetricDensity, measure: str, scale: str) -> bool:
    """`chosen_scale` without the reason."""
    return chosen_scale(density, measure, scale).log


def is_sharp(density: SymmetricDensity, pixel: float) -> bool:
    """Whether peaks of the density may be narrower than pixels of that side show."""
    if not isinstance(density, BlendedDensity):
        return False
    return _is_narrower(density.kernels, _half_pixels(density.kernels, pixel))


def is_sharp_on_map(density: SymmetricDensity, angle: float) -> bool:
    """The same of pixels `angle` radians wide on the sphere."""
    if not isinstance(density, BlendedDensity):
        return False
    return _is_narrower(density.kernels, torch.tensor(angle / 2))


def _is_narrower(kernels: AdaptiveKernels, half: Tensor) -> bool:
    return bool((kernels.concentrations**-0.5 < 2 * half).any())


def _widened(kernels: AdaptiveKernels, half: Tensor) -> Tensor:
    """Concentrations of kernels whose deviations are at least `half` a pixel."""
    return 1 / (1 / kernels.concentrations + half**2)


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
        for part in torch.arange(len(kappa)).split(_KERNELS):
            tables: list[Tensor] = []
            sides = zip(images, rectangle(space).tolist(), strict=True)
            for axis, (image, period) in enumerate(sides):
                own = kappa[part, axis]
                angle = 2 * math.pi * (image[:, None] - kernels.centers[part, axis]) / period
                tables.append((own * (angle.cos() - 1)).exp() / (period * torch.special.i0e(own)))
            total += (tables[0] * kernels.weights[part]) @ tables[1].T
    return total


def _round_sums(kernels: AdaptiveKernels, kappa: Tensor, points: Tensor) -> Tensor:
    """The mixture of kernels (N,) at points off the cone points, per area of the square."""
    widened = AdaptiveKernels(kernels.space, kernels.centers, kappa, kernels.weights)
    values = widened.log_density(points, tolerance=_TOLERANCE)
    return (values + kernels.space.log_area(points)).exp()
