"""Gradients of log densities in the data's own coordinates."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.arguments import check_kind
from orbiflow.density.models import SymmetricDensity
from orbiflow.runtime import one_thread

BLOCK = 16_384
"""Points at a time: a flow keeps all its steps for the way back."""


@one_thread()
def log_density_gradient(density: SymmetricDensity, data: ArrayLike) -> tuple[Array, Array]:
    """Log densities (N,) in natural measure at data (N, k), and their gradients (N, k).

    In the coordinates and units that the data have: in nats per radian, degree or turn of each angle,
    and per degree of latitude and of longitude; of unit vectors the vector of R^3 that is tangent to
    the sphere and points uphill, in nats per radian. At a pole nothing depends on the longitude. At a
    cone point of the chart (`RoundSpace.cone_vectors`) the gradient is not a number.

    Exact: in closed form for kernels, by automatic differentiation for flows.

    Raises:
        OrbiflowError: for data that are not of the space.

    >>> from orbiflow.density import DensityEstimator
    >>> angles = np.random.default_rng(0).vonmises(0.0, 4.0, (100, 1))
    >>> estimator = DensityEstimator("torus", parts="mixture").fit(angles)
    >>> values, slopes = log_density_gradient(estimator.density_, [[-1.0], [1.0]])
    >>> np.sign(slopes[:, 0]).tolist()
    [1.0, -1.0]
    """
    space = check_kind(density, SymmetricDensity, "density").space
    points = space.cover(data)
    values: list[Tensor] = []
    slopes: list[Tensor] = []
    for block in torch.split(points, BLOCK):
        with torch.enable_grad():
            at = block.detach().clone().requires_grad_()
            found = density.log_prob(at, measure="natural")
            (slope,) = torch.autograd.grad(found.sum(), at)
        values.append(found.detach().double())
        slopes.append(slope.double())
    if not values:
        return np.zeros(0), np.zeros(np.shape(data))
    table = np.asarray(data, dtype=np.float64)
    gradient = space.data_gradient(table, points, torch.cat(slopes))
    return torch.cat(values).numpy(), gradient
