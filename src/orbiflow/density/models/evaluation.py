"""Densities on grids, integrals, and gradients in the data's own coordinates."""

from __future__ import annotations

import math

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models.density import Density
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import one_thread
from orbiflow.settings import as_instance, as_tensor

GRADIENT_BLOCK = 16_384
"""Points evaluated at a time, as a flow keeps all its steps for the gradient."""


@one_thread()
def log_density_gradient(density: Density, data: ArrayLike) -> tuple[Array, Array]:
    """Return log densities (N,) in natural measure at data (N, k), and their gradients (N, k).

    Gradients are in the coordinates and units of the data: in nats per radian, degree or turn of each
    angle, and per degree of latitude and longitude. For unit vectors it is the vector of R^3 that is
    tangent to the sphere and points uphill, in nats per radian. At a pole nothing depends on the
    longitude. At a cone point of the chart (`RoundSpace.cone_vectors`) the gradient is not a number.

    Exact: in closed form for kernels, by automatic differentiation for flows.

    >>> from orbiflow.density import DensityEstimator
    >>> angles = np.random.default_rng(0).vonmises(0.0, 4.0, (100, 1))
    >>> estimator = DensityEstimator("torus", components="mixture").fit(angles)
    >>> values, slopes = log_density_gradient(estimator.density_, [[-1.0], [1.0]])
    >>> np.sign(slopes[:, 0]).tolist()
    [1.0, -1.0]
    """
    space = as_instance(density, Density, "density").space
    points = space.cover(data)
    values: list[Tensor] = []
    slopes: list[Tensor] = []
    for block in torch.split(points, GRADIENT_BLOCK):
        with torch.enable_grad():
            at = block.detach().clone().requires_grad_()
            logs = density.log_prob(at, measure="natural")
            (slope,) = torch.autograd.grad(logs.sum(), at)
        values.append(logs.detach().double())
        slopes.append(slope.double())
    if not values:
        return np.zeros(0), np.zeros(np.shape(data))
    table = np.asarray(data, dtype=np.float64)
    gradient = space.data_gradient(table, points, torch.cat(slopes))
    return torch.cat(values).numpy(), gradient


def midpoints(space: Space, resolution: int) -> Tensor:
    """Return points (resolution^d, d) at which a mean is an integral over the space, float64.

    They are the midpoints of an even grid on the unit cube or, where that is not the fundamental
    domain, on the lattice's cell.
    """
    as_instance(space, Space, "space", "see `make_space`")
    return space.midpoints(resolution)


def kl_by_quadrature(target: Tensor, log_density: Tensor) -> float:
    """Return KL(p || p_hat) in nats from values (N,) of p and log p_hat on an even grid."""
    target, log_density = as_tensor(target, "target"), as_tensor(log_density, "log_density")
    if target.dim() != 1 or target.shape != log_density.shape:
        raise OrbiflowError(
            f"expected two tables (N,), got {tuple(target.shape)} and {tuple(log_density.shape)}"
        )
    weight = target / target.sum()
    live = weight > 0
    log_target = (weight[live] * len(weight)).log()
    value = (weight[live] * (log_target - log_density[live])).sum()
    return float(value) if math.isfinite(float(value)) else math.inf


CELLS = 720
"""Cells of the circle of the column whose mean is found: half a degree each."""


def cell_masses(density: Density, axis: int) -> Tensor:
    """Return the masses (CELLS,) of even cells of one column of a density on a torus."""
    whole = density.space.dim == 1
    logs = density.log_prob(cells()) if whole else density.log_marginal(cells(), [axis])
    return torch.softmax(logs, dim=0)


def cells() -> Tensor:
    """Return the middles (CELLS, 1) of even cells of a circle, in turns."""
    return (torch.arange(CELLS, dtype=torch.float64)[:, None] + 0.5) / CELLS
