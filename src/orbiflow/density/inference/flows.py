"""The density of some angles of a flow on two or three, by the trapezoidal rule over the others."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from orbiflow.density.inference.axes import Split
from orbiflow.density.models import (
    AdaptiveKernels,
    SymmetricDensity,
    log_sum_exp,
    shares_of,
)
from orbiflow.density.spaces import Torus
from orbiflow.errors import OrbiflowError
from orbiflow.typed_torch import fft, special

FIRST_NODES, MOST_NODES = {1: 64, 2: 16}, {1: 512, 2: 64}
"""Nodes of each hidden angle at first and at most, by the number of hidden angles."""

SETTLED = 1e-7
"""Mean nats by which twice as many nodes may change the result."""

BLOCK = 65_536
"""Points at a time."""


def flow_at(density: SymmetricDensity, points: Tensor, observed: list[int]) -> Tensor:
    """Log density (N,) of the `observed` angles alone, at points (N, len(observed)).

    The others are integrated by the trapezoidal rule, which converges exponentially for periodic
    smooth functions; nodes are doubled until they change nothing.

    Raises:
        OrbiflowError: where more than two angles would have to be integrated out.
    """
    hidden = [axis for axis in range(density.space.dim) if axis not in observed]
    if len(hidden) > 2:
        raise OrbiflowError(
            f"a flow's density cannot be integrated over {len(hidden)} angles: fit without it, "
            '--parts kernels,mixture,chains (parts="kernels,mixture,chains")'
        )
    if not hidden:
        return _at(density, points, observed, hidden, points.new_zeros(1, 0))[:, 0]
    sums, count = None, FIRST_NODES[len(hidden)]
    now: Tensor | None = None
    while True:
        fresh = _nodes(count, len(hidden), all_of_them=sums is None)
        total = _at(density, points, observed, hidden, fresh).logsumexp(dim=1)
        sums = total if sums is None else torch.logaddexp(sums, total)
        last, now = now, sums - len(hidden) * math.log(count)
        settled = last is not None and float((now - last).abs().mean()) < SETTLED
        if settled or count >= MOST_NODES[len(hidden)]:
            return now
        count *= 2


def _nodes(count: int, axes: int, *, all_of_them: bool) -> Tensor:
    """An even grid (Q, axes) of `count` nodes an axis, or what half as many have not."""
    k = torch.arange(count)
    grid = torch.cartesian_prod(*[k] * axes).reshape(-1, axes)
    if not all_of_them:
        grid = grid[(grid % 2 == 1).any(dim=1)]
    return grid.double() / count


def _at(
    density: SymmetricDensity, points: Tensor, observed: list[int], hidden: list[int], nodes: Tensor
) -> Tensor:
    """Log densities (N, Q) of all angles, each point at each node."""
    parts: list[Tensor] = []
    for block in torch.split(points.double(), max(1, BLOCK // len(nodes))):
        whole = block.new_empty(len(block), len(nodes), density.space.dim)
        whole[:, :, observed] = block[:, None]
        whole[:, :, hidden] = nodes
        with torch.no_grad():
            parts.append(density.log_prob(whole))
    return torch.cat(parts)


BLOCK_ENTRIES = 250_000
"""Of the table of points against kernels worked on at a time."""


def partial_kernels(
    kernels: AdaptiveKernels, split: Split, space: Torus
) -> tuple[AdaptiveKernels, float]:
    """Kernels of the kept angles on `space`, and their log density at what is given.

    A kernel weighs as much more as it has the given values more likely.
    """
    kept, given = list(split.kept), list(split.given)
    weights, evidence = kernels.weights, 0.0
    if given:
        at = torch.tensor([split.values], dtype=torch.float64)
        logs = log_kernels(kernels, at, given)[0] + weights.log()
        evidence, weights = float(log_sum_exp(logs)), shares_of(logs)
    found = AdaptiveKernels(
        space, kernels.centers[:, kept], kernels.concentrations[:, kept], weights
    )
    return found, evidence


def kernels_at(kernels: AdaptiveKernels, points: Tensor, observed: list[int]) -> Tensor:
    """Log density (N,) of the `observed` angles alone, at points (N, len(observed))."""
    logs = kernels.weights.log()
    block = max(1, BLOCK_ENTRIES // len(kernels.weights))
    parts = [
        log_sum_exp(log_kernels(kernels, part, observed) + logs)
        for part in torch.split(points, block)
    ]
    return torch.cat(parts)


def log_kernels(kernels: AdaptiveKernels, points: Tensor, observed: list[int]) -> Tensor:
    """Log (N, K) of each kernel of the `observed` angles, at points (N, len(observed))."""
    kappa = kernels.concentrations[:, observed]
    angle, center = 2 * math.pi * points.double(), 2 * math.pi * kernels.centers[:, observed]
    images = torch.cat([angle.cos(), angle.sin()], dim=1)
    rows = torch.cat([kappa * center.cos(), kappa * center.sin()], dim=1)
    return images @ rows.mT - (special.i0e(kappa).log() + kappa).sum(dim=1)


FIRST_GRID, FINEST_GRID = {1: 256, 2: 48}, {1: 4096, 2: 192}
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
        most: points along an angle at most; default `FINEST_GRID`.
    """
    count, most = FIRST_GRID[space.dim], most or FINEST_GRID[space.dim]
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
