"""Kernel widths of columns that have nothing in common: a direction's, a depth's, a day's."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch
from scipy.optimize import minimize
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.fitting.rows import Rows
from orbiflow.density.models import kernel_peaks
from orbiflow.density.spaces import Space, by_sphere

MOST_ROWS, MOST_ASKED, MOST_ENTRIES = 4_000, 400, 20_000_000
"""The most rows with kernels, those at which they are judged, and entries of the table of both."""

STARTS = (3.0, 6.0)
"""Logarithms of the concentrations at which the search begins."""

STEPS = 30
"""Steps of the search for each start, at most."""

LEAST_CONCENTRATION, OUT_OF_REACH = 1e-2, 1e9
"""The least concentration, and a squared distance at which no kernel has any mass."""


def width_groups(space: Space) -> list[int]:
    """Return a number for each sphere of a space's kernels: those of one number have one width.

    All of a base or all angles share one; each column beside them has its own.
    """
    if space.parts:
        base, beside = (len(part.spheres) for part in space.parts)
        return [0] * base + [1 + k for k in range(beside)]
    if space.axes:
        is_angle = np.array([axis.is_angle for axis in space.axes])
        return np.where(is_angle, 0, np.cumsum(~is_angle)).tolist()
    return [0] * len(space.spheres)


def tuned_concentrations(space: Space, rows: Rows, narrowest: float) -> Tensor | None:
    """Return concentrations (F,) of kernels about rows in random order, by leaving rows out.

    They maximise the likelihood of some rows by kernels about the others. None if all share one width,
    for which there is a ladder.
    """
    groups = width_groups(space)
    groups = np.unique(groups, return_inverse=True)[1].tolist()  # from 0, without gaps
    if max(groups) == 0:
        return None
    away, where = _distances(space, rows.points[:MOST_ROWS], len(groups)), torch.tensor(groups)
    bounds = math.log(LEAST_CONCENTRATION), math.log(narrowest)
    count = len(set(groups))

    @torch.enable_grad()
    def loss(logs: Array) -> tuple[float, Array]:
        parameters = torch.tensor(logs, requires_grad=True)
        kappa = parameters.exp()[where]
        likely = (away @ -kappa.float()).logsumexp(dim=1).double().mean()
        value = -likely - kernel_peaks(space, kappa[None])[0]
        (gradient,) = torch.autograd.grad(value, parameters)
        return float(value.detach()), gradient.numpy()

    starts = (np.full(count, start).clip(*bounds) for start in STARTS)
    how: dict[str, Any] = {"jac": True, "method": "L-BFGS-B", "bounds": [bounds] * count}
    searches = [minimize(loss, start, options={"maxiter": STEPS}, **how) for start in starts]
    best = min(searches, key=lambda search: float(search.fun))
    return torch.tensor(np.exp(best.x))[where]


def _distances(space: Space, points: Tensor, spheres: int) -> Tensor:
    """Return halves of squared distances (n, E N, F), on each sphere, from points to others' images.

    They are those of a few points; the points themselves are out of reach.
    """
    images = by_sphere(space.features(points), spheres)
    entries = images.shape[0] * len(points) * spheres
    count = min(len(points), max(20, min(MOST_ASKED, MOST_ENTRIES // entries)))
    some, row = images[0, :count], torch.arange(count)
    away = torch.stack([((some[:, None] - image) ** 2).sum(dim=2) / 2 for image in images], dim=1)
    away[row, :, row] = OUT_OF_REACH
    return away.flatten(1, 2).float()
