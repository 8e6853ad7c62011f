"""The integral of a fitted density, from its values: no constant of the library is taken on trust.

A density is a sum, so its parts are integrated one by one, each by the rule that suits it. On spaces
of two dimensions flow, floor, chains and broad kernels are summed over a grid of the whole space, and
kernels narrower than a few of its cells are integrated each on a grid of its own width. On tori of
more angles no grid is fine enough. But a kernel is a product, and a chain is one in its residuals (to
which the angles go by a triangular map that keeps volume): their integrals are those of sections
through the center, angle by angle. Of narrow kernels, and on such tori of kernels and of components,
`LOOKED_AT` are integrated.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from orbiflow.density import AdaptiveKernels, Mixture, RoundSpace, VonMisesChains
from orbiflow.density.models import SCALES, midpoints, waves

GRID = 256
"""Points a side of the whole space's grid."""

BROAD = 150.0
"""Concentration up to which that grid sees a kernel: a deviation of three cells at least."""

LOOKED_AT, REACH, NODES = 100, 10.0, 81
"""Parts that are integrated by themselves, how many deviations of them, and points a side."""


class Integral(NamedTuple):
    """Its value, and the largest relative error of a part that was integrated by itself."""

    value: float
    worst: float


@torch.no_grad()
def integral(density: Mixture) -> Integral:
    """Of a density on a space of two dimensions, or on a torus of more angles without a flow."""
    if density.space.dim == 2:
        return _by_grid(density)
    ways = {"kernels": _mean, "chains": _chains, "uniform": lambda _: (1.0, 0.0)}
    found = [
        (weight, ways[part.kind](part))  # a flow or a network of many angles is not integrated
        for weight, part in zip(density.weights.tolist(), density.components, strict=True)
    ]
    value = sum(share * mean for share, (mean, _) in found)
    return Integral(value, max(worst for _, (_, worst) in found))


def _by_grid(density: Mixture) -> Integral:
    points = midpoints(density.space, GRID)
    values, fine, worst = points.new_zeros(len(points)), 0.0, 0.0
    share, kernels = next(one for one in density.parts() if one[1].kind == "kernels")
    assert isinstance(kernels, AdaptiveKernels)
    for weight, part in density.parts():
        if part is not kernels:
            values = values + weight * part.log_prob(points).exp()
    narrow = (kernels.concentrations > BROAD).any(dim=1)
    if not bool(narrow.all()):
        weight = share * float(kernels.weights[~narrow].sum())
        values = values + weight * _part(kernels, ~narrow).log_prob(points).exp()
    if bool(narrow.any()):
        mean, worst = _mean(_part(kernels, narrow))
        fine = share * float(kernels.weights[narrow].sum()) * mean
    return Integral(float(values.mean()) + fine, worst)


def _part(kernels: AdaptiveKernels, chosen: torch.Tensor) -> AdaptiveKernels:
    weights = kernels.weights[chosen]
    return AdaptiveKernels(
        kernels.space,
        kernels.centers[chosen],
        kernels.concentrations[chosen],
        weights / weights.sum(),
    )


def _looked_at(concentrations: torch.Tensor) -> list[int]:
    """Some of them, from the broadest to the narrowest."""
    order = concentrations.amax(dim=1).argsort()
    places = np.unique(np.linspace(0, len(order) - 1, min(len(order), LOOKED_AT)).round())
    return [int(order[int(place)]) for place in places]


def _summary(found: list[float]) -> tuple[float, float]:
    """Mean integral, and the error of the one farthest from 1."""
    return float(np.mean(found)), float(max(abs(value - 1) for value in found))


def _mean(kernels: AdaptiveKernels) -> tuple[float, float]:
    own = _round_integral if kernels.space.is_round else _product_integral
    return _summary([own(kernels, at) for at in _looked_at(kernels.concentrations)])


def _chains(chains: VonMisesChains) -> tuple[float, float]:
    found = []
    for at in _looked_at(chains.concentrations):
        found += [_chain_integral(chains, at, scale) for scale in range(len(SCALES))]
    return _summary(found)


def _chain_integral(chains: VonMisesChains, at: int, scale: int) -> float:
    """Of one component at one scale alone, in its residuals."""
    log_weights = torch.full((1, len(SCALES)), -math.inf)
    log_weights[0, scale] = 0.0
    stored = (chains.means, chains.concentrations, chains.order)
    alone = VonMisesChains(chains.space, log_weights, *(own[at][None] for own in stored))
    middle = float(alone.log_chart(_points(alone, torch.zeros(1, chains.space.dim))))
    log_value = middle
    for axis, concentration in enumerate((alone.concentrations[0] / SCALES[scale]).tolist()):
        nodes, weights = _section(concentration)
        residuals = torch.zeros(len(nodes), chains.space.dim, dtype=torch.float64)
        residuals[:, axis] = torch.tensor(2 * math.pi * nodes)
        values = alone.log_chart(_points(alone, residuals)) - middle
        log_value += math.log((weights * values.exp().numpy()).sum())
    return math.exp(log_value)


def _points(chain: VonMisesChains, residuals: torch.Tensor) -> torch.Tensor:
    """Points of the cube (N, d) at residuals (N, d) in radians of the only component."""
    angle = torch.zeros(residuals.shape, dtype=torch.float64)
    for now in chain.order[0].tolist():
        angle[:, now] = residuals[:, now] + waves(angle) @ chain.means[0, now]
    return angle / (2 * math.pi)


def _section(kappa: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Gauss's rule about 0 on the part of a turn, in turns, where a von Mises density is."""
    reach = min(0.5, REACH / math.sqrt(max(kappa, 1e-12)) / (2 * math.pi))
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    return reach * nodes, reach * weights


def _single(kernels: AdaptiveKernels, at: int) -> AdaptiveKernels:
    return AdaptiveKernels(
        kernels.space,
        kernels.centers[at][None],
        kernels.concentrations[at][None],
        torch.ones(1, dtype=torch.float64),
    )


def _round_integral(kernels: AdaptiveKernels, at: int) -> float:
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


def _product_integral(kernels: AdaptiveKernels, at: int) -> float:
    """Angle by angle, through the center."""
    single = _single(kernels, at)
    middle = float(single.log_prob(single.centers))
    log_value = middle
    for axis, kappa in enumerate(single.concentrations[0].tolist()):
        nodes, weights = _section(kappa)
        points = single.centers.repeat(len(nodes), 1)
        points[:, axis] += torch.tensor(nodes)
        log_value += math.log((weights * (single.log_prob(points) - middle).exp().numpy()).sum())
    return math.exp(log_value)
