"""The paper's three target densities on the unit square, samples of them, and their divergences.

Four and six Gaussians of variance 0.005, and the 5 x 5 checkerboard (paper, section 5.3). On round
spaces also with the round area in place of the square's: the same function times the area factor.
"""

from __future__ import annotations

import math
from typing import Literal

import torch
from torch import Tensor

from orbiflow.density import (
    Space,
    kl_by_quadrature,
    midpoints,
)

TARGETS = ("4-gaussian", "6-gaussian", "checkerboard")

TargetMeasure = Literal["flat", "round"]

_SMOOTH = {"max_frequency": 6, "segments": 8, "roughness": (1e-3, 1e-3)}
_SHARP = {"max_frequency": 8, "segments": 6, "roughness": (1e-4, 1e-4)}
FIT_SETTINGS = {"4-gaussian": _SMOOTH, "6-gaussian": _SMOOTH, "checkerboard": _SHARP}
"""Knobs of `FlowSettings` that suit each target."""


def target(name: str, points: Tensor) -> Tensor:
    """Density (N,) at points (N, 2) of the square, per its area and not quite normalised.

    >>> target("checkerboard", torch.tensor([[0.1, 0.1], [0.3, 0.1]])).round(decimals=2).tolist()
    [1.9199999570846558, 0.0]
    """
    if name == "checkerboard":
        cells = (points * 5).floor().clamp(0, 4).sum(dim=-1)
        return (cells % 2 == 0).to(points) * 25 / 13
    if name == "4-gaussian":
        means = torch.tensor([[x, y] for x in (0.25, 0.75) for y in (0.25, 0.75)])
    else:
        angle = torch.arange(6) * math.pi / 3
        means = 0.5 + 0.3 * torch.stack([angle.cos(), angle.sin()], dim=-1)
    squared = ((points[..., None, :] - means.to(points)) ** 2).sum(dim=-1)
    return (-squared / 0.01).exp().mean(dim=-1) / (2 * math.pi * 0.005)


def weighted(name: str, space: Space, points: Tensor, measure: TargetMeasure) -> Tensor:
    """The target (N,) with respect to the square's area, given in `measure`."""
    factor = space.log_area(points).exp() if measure == "round" else 1.0
    return target(name, points) * factor


def drawn(name: str, space: Space, measure: TargetMeasure, count: int, seed: int) -> Tensor:
    """Samples (count, 2) of a target, by rejection."""
    generator = torch.Generator().manual_seed(seed)
    most = 1.1 * float(weighted(name, space, midpoints(space, 400), measure).max())
    found: list[Tensor] = []
    while sum(len(part) for part in found) < count:
        points = torch.rand(4 * count, 2, dtype=torch.float64, generator=generator)
        chance = torch.rand(4 * count, dtype=torch.float64, generator=generator)
        found.append(points[chance * most < weighted(name, space, points, measure)])
    return torch.cat(found)[:count]


def kl_of_uniform(name: str, space: Space, grid: int = 400) -> float:
    """KL divergence of the even density of the square from a target: what no fit at all scores.

    >>> from orbiflow.density import make_space
    >>> round(kl_of_uniform("checkerboard", make_space("torus")), 3)  # log(25 / 13)
    0.654
    """
    points = midpoints(space, grid)
    return kl_by_quadrature(target(name, points), torch.zeros(len(points), dtype=torch.float64))
