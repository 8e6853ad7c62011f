"""Fitting conditional kernels: widths by leaving rows out."""

from __future__ import annotations

import math

import numpy as np
import torch
from scipy import optimize
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.fitting.rows import Rows
from orbiflow.density.models import (
    KERNEL_SCALES,
    LEAST_LOG_KAPPA,
    MOST_LOG_KAPPA,
    ConditionalKernels,
    KnownRows,
)
from orbiflow.density.spaces import Space

ASKED, NEAR = 800, 5_000
"""Rows by whose densities the widths are chosen, and rows whose kernels these are of."""

MOST_STEPS = 60
"""Steps of L-BFGS for the widths."""

LEAST_LOG_WIDTH, MOST_LOG_WIDTH = math.log(0.01), math.log(30.0)
"""The widths of covariates in their features: beyond the largest a covariate has no effect."""


def fit_kernels(space: Space, rows: Rows, x: Tensor, number: Tensor) -> ConditionalKernels:
    """Fit kernels to points and features (N, m), in random order.

    The widths make `ASKED` rows likeliest by the kernels of the others, of groups by those of others.
    """
    some, near = rows[:NEAR], x[:NEAR]
    scored = torch.arange(min(ASKED, len(some)))
    group = torch.arange(len(some)) if some.groups is None else some.groups
    apart = group[scored, None] == group
    count, width = int(number.max()) + 1, len(space.spheres)
    weights = None if some.weights is None else some.weights[scored]

    kernel_rows = KnownRows(some.points, some.weights, near, number)

    def made(values: Tensor) -> ConditionalKernels:
        widths, kappa, shares = torch.split(values, [count, width, len(KERNEL_SCALES)])
        of_scales = torch.softmax(shares, 0)
        return ConditionalKernels(space, kernel_rows, widths.exp(), kappa.exp(), of_scales)

    def loss(values: Array) -> tuple[float, Array]:
        parameters = torch.tensor(values, requires_grad=True)
        logs = made(parameters).logs(some.points[scored], near[scored], apart)
        mean = logs.mean() if weights is None else weights @ logs / weights.sum()
        (gradient,) = torch.autograd.grad(-mean, parameters)
        return -float(mean.detach()), gradient.numpy()

    start = [*[math.log(0.5)] * count, *[math.log(20.0)] * width, 0.5, 0.0, -0.5]
    bounds = [
        *[(LEAST_LOG_WIDTH, MOST_LOG_WIDTH)] * count,
        *[(LEAST_LOG_KAPPA, MOST_LOG_KAPPA)] * width,
        *[(-6.0, 6.0)] * len(KERNEL_SCALES),
    ]
    result = optimize.minimize(
        loss, np.array(start), jac=True, method="L-BFGS-B", bounds=bounds,
        options={"maxiter": MOST_STEPS},
    )  # fmt: skip
    best = made(torch.tensor(result.x))
    return best.with_rows(rows.points, rows.weights, x)
