"""Kernel widths of columns that have nothing in common: a direction's, a depth's, a day's."""

from __future__ import annotations

import math

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

STEPS = 150
"""Steps of the search for each start, at most."""


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
    used = sorted(set(groups))
    if len(used) < 2:
        return None
    points = rows.points[:MOST_ROWS]
    images = by_sphere(space.features(points), len(groups))
    entries = images.shape[0] * len(points) * len(groups)
    count = min(len(points), max(20, min(MOST_ASKED, MOST_ENTRIES // entries)))
    asked = images[0, :count]
    away = torch.stack([((own[None] - asked[:, None]) ** 2).sum(dim=2) / 2 for own in images])
    own = torch.arange(count)
    away[:, own, own] = math.inf
    where = [used.index(group) for group in groups]

    def loss(logs: Array) -> float:
        kappa = torch.tensor(np.exp(logs))[where].clamp(1e-2, narrowest)
        table = -(away @ kappa)
        likely = table.logsumexp(dim=(0, 2)).clamp_min(-1e4).mean() + kernel_peaks(
            space, kappa[None]
        )
        return -float(likely)

    found = [
        minimize(loss, np.full(len(used), start), method="Nelder-Mead", options={"maxiter": STEPS})
        for start in STARTS
    ]
    best = min(found, key=lambda one: float(one.fun))
    return torch.tensor(np.exp(best.x))[where].clamp(1e-2, narrowest)
