"""Densities whose regions are known in closed form, shared by tests."""

import math
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import ArrayLike

from orbiflow.density import AdaptiveKernels, Mixture, Space, UniformDensity

FLOOR = 1e-9


def kernels_about(
    space: Space, centers: ArrayLike, concentrations: Sequence[float], weights: Sequence[float]
) -> Mixture:
    """Kernels about data (N, k), of equal widths along the axes, on next to no floor."""
    width = 1 if space.is_round else space.dim
    kappa = torch.tensor(concentrations, dtype=torch.float64)[:, None].expand(-1, width)
    share = torch.tensor(weights, dtype=torch.float64)
    parts = AdaptiveKernels(space, space.to_chart(centers), kappa.contiguous(), share / share.sum())
    return Mixture([parts, UniformDensity(space)], [1 - FLOOR, FLOOR])


def cap_height(mass: float, kappa: float) -> float:
    """1 - cos of the angle of the cap that holds a mass of a von Mises-Fisher density on the sphere."""
    return -math.log1p(-mass * -math.expm1(-2 * kappa)) / kappa


def angle_between(data: ArrayLike, lat: float, lon: float) -> np.ndarray:
    """Great-circle distance in radians of latitudes and longitudes (N, 2) from a place."""
    a, b = np.radians(np.asarray(data)).T
    c, d = np.radians([lat, lon])
    cosine = np.sin(a) * np.sin(c) + np.cos(a) * np.cos(c) * np.cos(b - d)
    return np.arccos(np.clip(cosine, -1, 1))
