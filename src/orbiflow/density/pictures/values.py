"""Values of a density for a picture: at points, and on pixels over which narrow peaks are averaged."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models import AdaptiveKernels, Density, midpoints
from orbiflow.density.pictures.scale import DARK_SHARE, dark_share
from orbiflow.density.pictures.surfaces import off_cones
from orbiflow.density.spaces import rectangle

_TOLERANCE = 1e-5
"""Relative error of the sums over kernels."""

_KERNELS = 4096
"""Kernels summed at a time: tables of all of them would be gigabytes."""

_COARSE = 120
"""Points along a side by which a scale is chosen."""


@torch.no_grad()
def density_at(density: Density, points: Tensor, measure: str) -> Array:
    """Return the density (N,) at chart points (N, 2), and next to them at cone points."""
    if density.space.is_round:
        points = off_cones(points)
    own = points.to(device=density.device, dtype=density.dtype)
    return density.log_prob(own, measure=measure).double().cpu().exp().numpy()


@torch.no_grad()
def density_on_grid(
    density: Density, x: Tensor, y: Tensor, measure: str, *, pixel: float | None = None
) -> Array:
    """Return the density (len(x), len(y)) on a grid of chart coordinates, float64.

    A kernel narrower than a pixel would be seen or missed depending on where the grid falls. So half
    a pixel is added to the deviation of each kernel, in squares: then its values on the grid sum to
    its mass within 2 %, wherever it lies, and broad kernels stay as they are.

    Args:
        density: The density.
        x: First coordinates.
        y: Second coordinates.
        measure: What the density is per.
        pixel: Side of a pixel. Default: the step of `x`.

    Raises:
        OrbiflowError: If the measure is unknown.
    """
    shape = (len(x), len(y))
    points = torch.stack(torch.meshgrid(x, y, indexing="ij"), dim=-1).reshape(-1, 2)
    part = density.kernel_part
    if part is None:
        return density_at(density, points, measure).reshape(shape)
    half = _half_pixels(part[1], pixel or float(x[1] - x[0]))
    if density.space.is_round:
        points = off_cones(points)
        return _averaged(density, part, points, measure, half, _round_sums).reshape(shape)
    sums = lambda wide, _: _flat_sums(wide, x, y).reshape(-1)  # noqa: E731
    return _averaged(density, part, points, measure, half, sums).reshape(shape)


@torch.no_grad()
def density_on_map(density: Density, points: Tensor, measure: str, angle: float) -> Array:
    """Return the density (N,) at chart points (N, 2) of a round space, averaged over pixels."""
    part = density.kernel_part
    if part is None:
        return density_at(density, points, measure)
    half = torch.tensor(angle / 2)
    return _averaged(density, part, off_cones(points), measure, half, _round_sums)


class ChosenScale(NamedTuple):
    """Whether colours are by logarithms, and why, in words for a caption."""

    log: bool
    reason: str


def chosen_scale(density: Density, measure: str, scale: str) -> ChosenScale:
    """Return the scale of colours, which is the same for all pictures of a density."""
    if scale != "auto":
        return ChosenScale(scale == "log", f"{_COLOURS_ARE[scale == 'log']}, as asked for")
    t = (torch.arange(_COARSE, dtype=torch.float64) + 0.5) / _COARSE
    values = density_on_grid(density, t, t, measure, pixel=0.5 / _COARSE).ravel()
    areas = density.space.log_area(midpoints(density.space, _COARSE)).exp().numpy()
    dark = dark_share(values, areas)
    log = dark > DARK_SHARE
    # never more than what is true: 99.6 % are not all
    share, side = (int(100 * dark), "below") if log else (math.ceil(100 * (1 - dark)), "above")
    reason = f"the density is {side} a tenth of its peak on {share} % of the area"
    return ChosenScale(log, f"{_COLOURS_ARE[log]}, as {reason}")


_COLOURS_ARE = {False: "colours are linear", True: "colours are logarithmic"}


def is_sharp(density: Density, *, pixel: float | None = None, angle: float | None = None) -> bool:
    """Return whether peaks of a density may be narrower than the pixels of a picture."""
    part = density.kernel_part
    if part is None:
        return False
    half = torch.tensor(angle / 2) if angle else _half_pixels(part[1], pixel or 0.0)
    return bool((part[1].concentrations ** -0.5 < 2 * half).any())


def _averaged(
    density: Density,
    part: tuple[float, AdaptiveKernels],
    points: Tensor,
    measure: str,
    half: Tensor,
    sums: Callable[[AdaptiveKernels, Tensor], Tensor],
) -> Array:
    """Return the density (N,) with kernels whose deviations are at least `half` a pixel."""
    weight, own = part
    kappa = 1 / (1 / own.concentrations + half**2)
    widened = AdaptiveKernels(own.space, own.centers, kappa, own.weights)
    logs = density.log_density_without_kernels(points)
    if density.space.is_round:
        logs = logs + density.space.log_area(points)
    values = logs.exp() + weight * sums(widened, points)
    return (values * density.space.log_density_factor(points, measure).exp()).numpy()


def _half_pixels(kernels: AdaptiveKernels, pixel: float) -> Tensor:
    """Return half a pixel's side in the kernels' angles, (d,), or, on round spaces, (N, 1)."""
    if kernels.space.is_round:
        # the chart is conformal: a small square stays a square
        area = kernels.space.log_area(off_cones(kernels.centers)).exp()
        return pixel / 2 * area.sqrt()[:, None]
    return math.pi * pixel / rectangle(kernels.space)


def _flat_sums(kernels: AdaptiveKernels, x: Tensor, y: Tensor) -> Tensor:
    """Return the mixture of kernels on a grid.

    It is a matrix product, since kernels are products of functions of one coordinate.
    """
    space = kernels.space
    # cosets are rotations by half a turn and glides along the axes: each image of a grid is one
    ends = [torch.stack([t, torch.zeros_like(t)], dim=-1) for t in (x, y)]
    across = space.group.images(ends[0])[..., 0]
    along = space.group.images(ends[1].flip(-1))[..., 1]
    total = x.new_zeros(len(x), len(y))
    for images in zip(across, along, strict=True):
        for part in torch.arange(len(kernels.concentrations)).split(_KERNELS):
            tables: list[Tensor] = []
            sides = zip(images, rectangle(space).tolist(), strict=True)
            for axis, (image, period) in enumerate(sides):
                own = kernels.concentrations[part, axis]
                angle = 2 * math.pi * (image[:, None] - kernels.centers[part, axis]) / period
                tables.append((own * (angle.cos() - 1)).exp() / (period * torch.special.i0e(own)))
            total += (tables[0] * kernels.weights[part]) @ tables[1].T
    return total


def _round_sums(kernels: AdaptiveKernels, points: Tensor) -> Tensor:
    """Return the mixture of kernels (N,) at points off the cone points, per area of the square."""
    values = kernels.log_density(points, tolerance=_TOLERANCE)
    return (values + kernels.space.log_area(points)).exp()
