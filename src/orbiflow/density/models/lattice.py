"""Von Mises kernels on an even grid that stand for a smooth function of one or two angles."""

from __future__ import annotations

import math
from collections.abc import Callable

import torch
from torch import Tensor

from orbiflow.density.models.density import Density, Split, Weighted
from orbiflow.density.models.kernels import AdaptiveKernels
from orbiflow.density.spaces import Torus
from orbiflow.typed_torch import fft, special

KERNEL_STEP = 0.65
"""Deviations of the sharpest bumps of a function between two points of a grid that resolves it."""

DROPPED_WEIGHT = 1e-7
"""The weight that the lightest kernels may have together, to be left out."""

FIRST_GRID, GRID_BLOCK = {1: 256, 2: 48}, 2**12
"""Points along an angle at first, by the number of angles, and points evaluated at a time."""


def kernels_for(
    density: Density, split: Split, space: Torus, level: int, tick: Callable[[], None]
) -> list[Weighted]:
    """Return kernels as `Density.approximated` does, if need be through marginals on a grid."""
    known = density.approximated(split, space, level, tick)
    if known is not None:
        return known
    count = FIRST_GRID[space.dim] * 2**level
    line = torch.arange(count, dtype=torch.float64) / count
    grid = torch.cartesian_prod(*[line] * space.dim).reshape(-1, space.dim)
    values = grid.new_tensor(split.values)
    parts: list[Tensor] = []
    for block in torch.split(grid, GRID_BLOCK):
        tick()
        whole = torch.cat([block, values.expand(len(block), -1)], dim=1)
        parts.append(density.log_marginal(whole, list(split.observed), level))
    logs = torch.cat(parts)
    log, kernels = lattice_kernels((logs - logs.max()).exp().reshape([count] * space.dim), space)
    return [(float(logs.max()) + log, kernels)]


def sharpest_on(count: int, step: float = KERNEL_STEP) -> float:
    """Return the largest concentration that `count` points on a circle resolve."""
    return (count * step / (2 * math.pi)) ** 2


def lattice_kernels(
    values: Tensor, space: Torus, start: float = 0.0
) -> tuple[float, AdaptiveKernels]:
    """Return kernels through values (n,) or (n, m) on an even grid that begins at `start`, in turns.

    The logarithm of the values' mean comes first. Kernels whose deviation is one step interpolate what
    is smooth over a few steps nearly to rounding: their weights are one deconvolution by Fourier
    transform.
    """
    spectrum = fft.fftn(values)
    lines: list[Tensor] = []
    kappas: list[float] = []
    for axis, count in enumerate(values.shape):
        line = torch.arange(count, dtype=torch.float64) / count
        kappa = sharpest_on(count, 1.0)
        scaled = special.i0e(torch.tensor(kappa, dtype=torch.float64))
        kernel = (kappa * ((2 * math.pi * line).cos() - 1)).exp() / scaled
        shape = [-1 if i == axis else 1 for i in range(space.dim)]
        spectrum = spectrum / fft.fft(kernel).real.reshape(shape)
        lines.append(line)
        kappas.append(kappa)
    weights = fft.ifftn(spectrum).real.flatten().clamp_min(0)
    weights = weights / weights.sum()
    ordered, order = weights.sort()
    kept = order[ordered.cumsum(0) >= DROPPED_WEIGHT].sort().values
    grid = torch.cartesian_prod(*lines).reshape(-1, space.dim)[kept]
    concentrations = torch.tensor(kappas, dtype=torch.float64).expand(len(kept), -1)
    own = AdaptiveKernels(
        space, (grid + start) % 1, concentrations, weights[kept] / weights[kept].sum()
    )
    return math.log(float(values.mean())), own
