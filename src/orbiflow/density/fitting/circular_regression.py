"""Fitting linear-circular regressions by maximum likelihood."""

from __future__ import annotations

import math

import numpy as np
import torch
from scipy import optimize
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.fitting.rows import Rows
from orbiflow.density.models import CircularRegression
from orbiflow.density.spaces import Torus

RIDGE = 1e-3
"""Weight of the mean square of slopes: of words, features are linearly dependent."""

STEPS, LEAST_GAIN = 200, 1e-6
"""The most steps, and the least relative gain of one: rare words make thousands that gain nothing."""


def fit_regression(space: Torus, rows: Rows, x: Tensor) -> CircularRegression:
    """Fit to points (N, d) and features (N, k) by maximum likelihood, from both sides of the mean."""
    d, k = space.dim, x.shape[1]
    weights = torch.ones(len(x)).to(x) if rows.weights is None else rows.weights
    shares = weights / weights.sum()
    angle = 2 * math.pi * rows.points

    def made(values: Tensor) -> CircularRegression:
        means, slopes, spreads = torch.split(values, [d, d * k, d * (1 + k)])
        return CircularRegression(space, means, slopes.reshape(d, k), spreads.reshape(d, 1 + k))

    def loss(values: Array) -> tuple[float, Array]:
        parameters = torch.tensor(values, requires_grad=True)
        now = made(parameters)
        ridge = RIDGE * (now.slopes.square().mean() + now.spreads[:, 1:].square().mean())
        value = ridge - (shares @ now.logs(rows.points, x)).sum()
        (gradient,) = torch.autograd.grad(value, parameters)
        return float(value.detach()), gradient.numpy()

    mean = torch.atan2(shares @ angle.sin(), shares @ angle.cos())
    fits: list[CircularRegression] = []
    for start in (mean, mean + math.pi):
        first = np.concatenate([start.numpy(), np.zeros(d * k + d * (1 + k))])
        best = optimize.minimize(
            loss, first, jac=True, method="L-BFGS-B", options={"maxiter": STEPS, "ftol": LEAST_GAIN}
        ).x
        fits.append(made(torch.tensor(best)))
    logs = torch.stack([shares @ fit.logs(rows.points, x) for fit in fits])
    better = logs.argmax(dim=0)
    every = torch.arange(d)
    means, slopes, spreads = (
        torch.stack([getattr(fit, name) for fit in fits])[better, every]
        for name in ("means", "slopes", "spreads")
    )
    return CircularRegression(space, means, slopes, spreads)
