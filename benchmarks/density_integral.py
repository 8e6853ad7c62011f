"""The integral of a fitted density, from its values: no constant of the library is taken on trust.

A density is a sum, so its parts are integrated one by one, each by the rule that suits it. Broad
parts (flow, floor, chains, broad kernels) are summed over a grid of the whole space. Kernels
narrower than a few cells are integrated each on a grid of its own width, as many as `LOOKED_AT` of
them. On tori of many angles no grid is fine enough: a narrow kernel is a product, integrated angle
by angle, and the others and the chains are integrated by importance sampling, from a kernel
estimate with a floor.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import torch
from density_kde import KernelDensity
from numpy.typing import NDArray

from orbiflow.density import BlendedDensity, midpoints
from orbiflow.density.models.kernels import AdaptiveKernels
from orbiflow.density.spaces.round import RoundSpace

Data = NDArray[np.float64]

GRID = 256
"""Points a side of the whole space's grid."""

BROAD = 150.0
"""Concentration up to which that grid sees a kernel: a deviation of three cells at least."""

LOOKED_AT, REACH, NODES = 100, 10.0, 81
"""Narrow kernels, how many deviations of them, and points a side."""

DRAWN, PROPOSED, FLOOR = 40_000, 12.0, 0.1
"""Of importance sampling: points, the concentration of the estimate drawn from, its uniform part."""


class Integral(NamedTuple):
    """Its value, the standard error where it was sampled, the largest error of a narrow kernel's."""

    value: float
    error: float
    worst_kernel: float


@torch.no_grad()
def integral(density: BlendedDensity, train: Data) -> Integral:
    """Of a density fitted to rows `train`; in radians, where there are more angles than two."""
    kernels = density.kernels
    narrow = (kernels.concentrations > BROAD).any(dim=1)
    share = float(density.shares[1])
    fine, worst = 0.0, 0.0
    if bool(narrow.any()):
        mean, worst = _narrow(_part(kernels, narrow))
        fine = share * float(kernels.weights[narrow].sum()) * mean
    broad = None if bool(narrow.all()) else _part(kernels, ~narrow)
    weight = share * float(kernels.weights[~narrow].sum())
    value, error = (_grid if density.space.dim == 2 else _sampled)(density, broad, weight, train)
    return Integral(value + fine, error, worst)


def _part(kernels: AdaptiveKernels, chosen: torch.Tensor) -> AdaptiveKernels:
    weights = kernels.weights[chosen]
    return AdaptiveKernels(
        kernels.space,
        kernels.centers[chosen],
        kernels.concentrations[chosen],
        weights / weights.sum(),
    )


def _broad_values(
    density: BlendedDensity, broad: AdaptiveKernels | None, weight: float, points: torch.Tensor
) -> torch.Tensor:
    """Of all but the narrow kernels, with respect to the chart's area."""
    values = density.log_prob_without_kernels(points).exp()
    return values if broad is None else values + weight * broad.log_prob(points).exp()


def _grid(
    density: BlendedDensity, broad: AdaptiveKernels | None, weight: float, _train: Data
) -> tuple[float, float]:
    points = midpoints(density.space, GRID)
    return float(_broad_values(density, broad, weight, points).mean()), 0.0


def _sampled(
    density: BlendedDensity, broad: AdaptiveKernels | None, weight: float, train: Data
) -> tuple[float, float]:
    rng = np.random.default_rng(0)
    dim, count = train.shape[1], int(DRAWN * (1 - FLOOR))
    about = train[rng.integers(len(train), size=count)]
    drawn = np.concatenate(
        [rng.vonmises(about, PROPOSED), rng.uniform(-np.pi, np.pi, (DRAWN - count, dim))]
    )
    estimate = KernelDensity(train, PROPOSED, round_=False, floor=FLOOR)
    points = density.space.to_chart(drawn)
    factor = density.space.log_density_factor(points, "natural")
    values = _broad_values(density, broad, weight, points).log() + factor
    ratio = np.exp(values.numpy() - estimate.score_samples(drawn))
    return float(ratio.mean()), float(ratio.std() / math.sqrt(DRAWN))


def _narrow(kernels: AdaptiveKernels) -> tuple[float, float]:
    """Mean integral of narrow kernels, and the one farthest from 1."""
    order = kernels.concentrations.amax(dim=1).argsort()
    places = np.unique(np.linspace(0, len(order) - 1, min(len(order), LOOKED_AT)).round())
    own = _round_integral if kernels.space.is_round else _product_integral
    found = [own(kernels, order[int(k)]) for k in places]
    return float(np.mean(found)), float(max(abs(value - 1) for value in found))


def _single(kernels: AdaptiveKernels, at: torch.Tensor) -> AdaptiveKernels:
    return AdaptiveKernels(
        kernels.space,
        kernels.centers[at][None],
        kernels.concentrations[at][None],
        torch.ones(1, dtype=torch.float64),
    )


def _round_integral(kernels: AdaptiveKernels, at: torch.Tensor) -> float:
    """On a disc about the kernel's center, by Gauss's rule along the radius."""
    single, space = _single(kernels, at), kernels.space
    assert isinstance(space, RoundSpace)
    center = space.features(single.centers)[0, 0].numpy()
    across = np.linalg.svd(center[None])[2][1:]
    reach = min(math.pi, REACH / math.sqrt(float(single.concentrations)))
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    radius, turn = reach * (nodes + 1) / 2, np.arange(8) * np.pi / 4
    sideways = np.stack([np.cos(turn), np.sin(turn)], axis=-1) @ across
    vectors = np.cos(radius)[:, None, None] * center + np.sin(radius)[:, None, None] * sideways
    points = space.vectors_to_chart(vectors.reshape(-1, 3))
    values = (single.log_prob(points) - space.log_area(points)).exp().reshape(NODES, 8)
    ring = 2 * math.pi * np.sin(radius) * values.mean(dim=1).numpy()
    return float(reach / 2 * (weights * ring).sum())


def _product_integral(kernels: AdaptiveKernels, at: torch.Tensor) -> float:
    """Angle by angle, through the center: a product's integral is that of its sections, rescaled."""
    single = _single(kernels, at)
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    middle = float(single.log_prob(single.centers))
    log_value = middle
    for axis, kappa in enumerate(single.concentrations[0].tolist()):
        reach = min(0.5, REACH / math.sqrt(kappa) / (2 * math.pi))
        points = single.centers.repeat(NODES, 1)
        points[:, axis] += torch.tensor(reach * nodes)
        section = (single.log_prob(points) - middle).exp().numpy()
        log_value += math.log(reach * (weights * section).sum())
    return math.exp(log_value)
