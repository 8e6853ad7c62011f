"""A density of one or two angles from its values on a grid: kernels on the grid's points."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from orbiflow.density.models.kernels import AdaptiveKernels
from orbiflow.density.spaces.flat import Torus
from orbiflow.typed_torch import fft, special

FIRST, MOST = {1: 256, 2: 48}, {1: 4096, 2: 192}
"""Points of the grid along an angle, at first and at most, by the number of angles."""

ENOUGH = 1e-5
"""Nats by which the logarithm may be off, root mean square, where the grid need not be finer."""

CHECKED = 256
"""Random points at which it is compared, and as many on the even torus."""

DROPPED = 1e-8
"""Share of all kernels that the lightest may have together, to be left out."""


@dataclass(frozen=True)
class Tabulated:
    """What was found: normalised kernels, the log of the function's integral, the error in nats."""

    kernels: AdaptiveKernels
    log_total: float
    error: float


def tabulated(
    log_function: Callable[[Tensor], Tensor], space: Torus, most: int | None = None
) -> Tabulated:
    """Kernels on an even grid that take a function's values there; it is of one or two angles.

    Von Mises kernels whose deviation is one step interpolate what is smooth over a few steps nearly to
    rounding: their weights are one deconvolution by Fourier transform. The grid is refined until
    random points agree as well.

    Args:
        log_function: log of a positive function of points (N, r), of any integral.
        space: the torus of r = 1 or 2 angles.
        most: points along an angle at most; default `MOST`.
    """
    count, most = FIRST[space.dim], most or MOST[space.dim]
    while True:
        found = _on_grid(log_function, space, count)
        if found.error < ENOUGH or 2 * count > most:
            return found
        count *= 2


def _on_grid(log_function: Callable[[Tensor], Tensor], space: Torus, count: int) -> Tabulated:
    line = torch.arange(count, dtype=torch.float64) / count
    grid = torch.cartesian_prod(*[line] * space.dim).reshape(-1, space.dim)
    logs = log_function(grid)
    top = float(logs.max())
    values = (logs - top).exp()
    log_total = top + float(values.mean().log())
    kappa = (count / (2 * math.pi)) ** 2
    kernel = _kernel(line, kappa)
    shape = [count] * space.dim
    spectrum = fft.fftn(values.reshape(shape))
    smoothing = fft.fft(kernel).real
    for axis in range(space.dim):
        spectrum = spectrum / smoothing.reshape([-1 if i == axis else 1 for i in range(space.dim)])
    weights = fft.ifftn(spectrum).real.flatten().clamp_min(0)
    weights = weights / weights.sum()
    kept = _heaviest(weights)
    kernels = AdaptiveKernels(
        space,
        grid[kept],
        torch.full((int(kept.sum()), space.dim), kappa, dtype=torch.float64),
        weights[kept] / weights[kept].sum(),
    )
    generator = torch.Generator().manual_seed(0)
    drawn = kernels.sample(CHECKED, generator)
    off = kernels.log_prob(drawn) + log_total - log_function(drawn)
    return Tabulated(kernels, log_total, float(off.square().mean().sqrt()))


def _kernel(line: Tensor, kappa: float) -> Tensor:
    scaled = special.i0e(torch.tensor(kappa, dtype=torch.float64))
    return (kappa * ((2 * math.pi * line).cos() - 1)).exp() / scaled


def _heaviest(weights: Tensor) -> Tensor:
    """Which (K,) are left when the lightest go."""
    ordered, order = weights.sort()
    light = ordered.cumsum(0) < DROPPED
    kept = torch.ones_like(weights, dtype=torch.bool)
    kept[order[light]] = False
    return kept
