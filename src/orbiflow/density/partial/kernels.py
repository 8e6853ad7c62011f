"""Kernels of some angles: closed forms, since they are products."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from orbiflow.density.models.kernels import AdaptiveKernels
from orbiflow.density.models.log_sum import log_sum_exp, shares_of
from orbiflow.density.partial.axes import Split
from orbiflow.density.spaces.flat import Torus
from orbiflow.typed_torch import special

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
