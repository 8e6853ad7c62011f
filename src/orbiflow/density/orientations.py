"""Summaries of orientations: their mean modulo symmetry, its cone, and how far rows are from it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.data import alongside, as_data
from orbiflow.density.spaces import RotationSpace
from orbiflow.density.weighed_rows import WeighedRows, chosen_rows, principal_axes
from orbiflow.settings import as_instance

STARTS, STEPS, MOST_LOOKED_AT = 16, 100, 2_000
"""Rows from which a mean is looked for, the most steps of each, and the most rows of a first look."""


@dataclass(frozen=True)
class OrientationSummary:
    """Orientations modulo the symmetry of their space; angles are in degrees.

    - `mean`: The orientation of the least mean square of misorientations, by quaternions, in the
      columns of the space.
    - `cone`: The misorientation within which the true mean is, at the level asked for, for any
      distribution about one mean; None if rows spread too much to tell.
    - `spread`: The mean misorientation of rows from the mean.
    - `half`: The misorientation within which half of the rows are.
    """

    rows: int
    mean: tuple[float, ...]
    cone: float | None
    spread: float
    half: float


def summarize_orientations(
    space: RotationSpace,
    data: ArrayLike,
    *,
    weights: ArrayLike | None = None,
    groups: ArrayLike | None = None,
    level: float = 0.95,
) -> OrientationSummary:
    """Summarise orientations.

    Args:
        space: Their space, which says how rows write them, and their symmetry.
        data: Rows (N, k) of the space.
        weights: How much each row counts (N,); only ratios matter.
        groups: What each row belongs to, (N,); rows of one group are not independent.
        level: Level of the intervals.

    Raises:
        OrbiflowError: If rows or weights do not fit.

    >>> space = RotationSpace(form="bunge", unit="degrees", symmetry="432")
    >>> round(summarize_orientations(space, [[1, 0, 0], [89, 0, 0], [0, 0, 0]]).half, 6)
    1.0
    """
    as_instance(space, RotationSpace, "space")
    data, weights, groups = alongside(data=data, weights=weights, groups=groups)
    points = space.to_chart(as_data(data).values)
    kept, rows = chosen_rows(points.numpy(), weights, groups, level)
    points, shares = torch.tensor(kept), rows.weights
    mean, images = _mean(space, points, torch.tensor(shares))
    angles = np.degrees(space.misorientations(points, mean).numpy())
    order = np.argsort(angles)
    half = float(angles[order][np.searchsorted(np.cumsum(shares[order]), 0.5 - 1e-12)])
    written = space.from_chart(mean[None])[0]
    return OrientationSummary(
        len(points),
        tuple(float(v) for v in written),
        _cone(images, rows),
        float(shares @ angles),
        half,
    )


def _mean(space: RotationSpace, points: Tensor, shares: Tensor) -> tuple[Tensor, Array]:
    """Return the mean (4,), and the image (N, 4) of each row that is nearest to it.

    From several rows on, each row takes its image nearest to the mean, and the mean is the principal
    axis of these, until nothing changes.
    """
    some = torch.linspace(0, len(points) - 1, min(MOST_LOOKED_AT, len(points))).round().long()
    begin = some[torch.linspace(0, len(some) - 1, min(STARTS, len(some))).round().long()]
    settled = [_settled(space, points[some], shares[some], start) for start in points[begin]]
    best = max(settled, key=lambda one: one[0])[1]
    _, mean, near = _settled(space, points, shares, best)
    return space.project(mean[None])[0], near.numpy()


def _settled(
    space: RotationSpace, points: Tensor, shares: Tensor, mean: Tensor
) -> tuple[float, Tensor, Tensor]:
    """Return the share of rows' squares along a mean that no step changes, it, and nearest images."""
    last, near = -1.0, points
    for _ in range(STEPS):
        around = space.features(mean[None])[:, 0]
        chosen = (around @ points.mT).argmax(dim=0)
        # what takes the mean to its image takes the row back along
        near = torch.einsum("nji,nj->ni", space.elements[chosen], points)
        tensor = torch.einsum("n,ni,nj->ij", shares, near, near)
        values, axes = np.linalg.eigh(tensor.numpy())
        mean = torch.tensor(axes[:, -1])
        if values[-1] - last < 1e-15:
            break
        last = float(values[-1])
    return last, mean, near


def _cone(images: Array, rows: WeighedRows) -> float | None:
    """Return the misorientation in degrees that holds the true mean, by the errors of an axis.

    The mean is the principal axis of quaternions, in four dimensions.
    """
    if rows.units < 5:
        return None
    *_, angle = principal_axes(images, rows)
    # the angle of a rotation is twice that of quaternions
    return math.degrees(2 * angle) if angle is not None and angle < math.pi / 4 else None
