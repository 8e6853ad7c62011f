"""Summaries of orientations: their mean modulo symmetry, its cone, and shares near named ones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import ArrayLike
from scipy import special
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.data import alongside, as_data
from orbiflow.density.inference import misorientations
from orbiflow.density.spaces import ORIENTATIONS, RotationSpace, named_orientation, rotations_of
from orbiflow.density.weighed_rows import WeighedRows, chosen_rows, half_angle, tail
from orbiflow.errors import SettingError
from orbiflow.settings import as_instance, as_number

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


@dataclass(frozen=True)
class NearSummary:
    """The share of rows within an angle of an ideal orientation, and its interval (Wilson, 1927).

    - `random`: The share of a random texture there.
    """

    name: str
    share: float
    low: float
    high: float
    random: float


def summarize_orientations(
    space: RotationSpace,
    data: ArrayLike,
    *,
    weights: ArrayLike | None = None,
    groups: ArrayLike | None = None,
    level: float = 0.95,
    near: Sequence[str] | None = None,
    within: float = 15.0,
) -> tuple[OrientationSummary, list[NearSummary]]:
    """Summarise orientations.

    Args:
        space: Their space, which says how rows write them, and their symmetry.
        data: Rows (N, k) of the space.
        weights: How much each row counts (N,); only ratios matter.
        groups: What each row belongs to, (N,); rows of one group are not independent.
        level: Level of the intervals.
        near: Names of ideal orientations (cube, goss, brass, copper, s) with all their variants in a
            rolled sheet. Default: all of them for cubic crystals, else none.
        within: The angle in degrees within which rows are counted as near.

    Raises:
        OrbiflowError: If rows or weights do not fit, or names are unknown.

    >>> space = RotationSpace(form="bunge", unit="degrees", symmetry="432")
    >>> found, shares = summarize_orientations(space, [[1, 0, 0], [89, 0, 0], [90, 1, 0], [0, 45, 0]])
    >>> shares[0].name, shares[0].share
    ('cube', 0.75)
    """
    as_instance(space, RotationSpace, "space")
    data, weights, groups = alongside(data=data, weights=weights, groups=groups)
    points = space.to_chart(as_data(data).values)
    kept, rows = chosen_rows(points.numpy(), weights, groups, level)
    points, shares = torch.tensor(kept), rows.weights
    mean, images = _mean(space, points, torch.tensor(shares))
    angles = np.degrees(misorientations(space, points, mean).numpy())
    order = np.argsort(angles)
    half = float(angles[order][np.searchsorted(np.cumsum(shares[order]), 0.5 - 1e-12)])
    written = space.from_chart(mean[None])[0]
    found = OrientationSummary(
        len(points),
        tuple(float(v) for v in written),
        _cone(images, rows),
        float(shares @ angles),
        half,
    )
    return found, _near(space, points, rows, near, within)


def _mean(space: RotationSpace, points: Tensor, shares: Tensor) -> tuple[Tensor, Array]:
    """Return the mean (4,), and the image (N, 4) of each row that is nearest to it.

    From several rows on, each row takes its image nearest to the mean, and the mean is the principal
    axis of these, until nothing changes.
    """
    some = torch.linspace(0, len(points) - 1, min(MOST_LOOKED_AT, len(points))).round().long()
    begin = some[torch.linspace(0, len(some) - 1, min(STARTS, len(some))).round().long()]
    found = [_settled(space, points[some], shares[some], start) for start in points[begin]]
    best = max(found, key=lambda one: one[0])[1]
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

    The principal axis of quaternions is that of Fisher, Lewis and Embleton (1987), section 6.3.1, in
    four dimensions.
    """
    tensor = np.einsum("n,ni,nj->ij", rows.weights, images, images)
    values, axes = np.linalg.eigh(tensor)
    along, gaps = images @ axes[:, ::-1], values[-1] - values[-2::-1]
    if gaps.min() < 1e-12 or rows.units < 5:
        return None
    errors = np.zeros_like(along)
    errors[:, 1:] = along[:, :1] * along[:, 1:] / gaps
    angle = half_angle(errors, rows)
    # the angle of a rotation is twice that of quaternions
    return math.degrees(2 * angle) if angle is not None and angle < math.pi / 4 else None


def _near(
    space: RotationSpace,
    points: Tensor,
    rows: WeighedRows,
    near: Sequence[str] | None,
    within: float,
) -> list[NearSummary]:
    """Return the shares of rows near ideal orientations."""
    reach = math.radians(as_number(within, "within", above=0, most=60))
    names = near_names(space, near)
    even = space.uniform(2**14 if names else 1, torch.Generator().manual_seed(0))
    count, square = rows.effective, tail(special.chdtri, 1, 1 - rows.level)
    found: list[NearSummary] = []
    for name in names:
        variants = ideal_variants(name)
        share = float(rows.mean(nearest(space, points, variants) <= reach))
        middle = (share + square / (2 * count)) / (1 + square / count)
        half = math.sqrt(square) / (1 + square / count)
        half *= math.sqrt(share * (1 - share) / count + square / (4 * count * count))
        by_chance = float((nearest(space, even, variants) <= reach).mean())
        low, high = max(0.0, middle - half), min(1.0, middle + half)
        found.append(NearSummary(name, share, low, high, by_chance))
    return found


def near_names(space: RotationSpace, near: Sequence[str] | None) -> list[str]:
    """Return the names of ideal orientations that are asked for, by default those of cubic crystals."""
    if near is None:
        return list(ORIENTATIONS) if space.symmetry in ("T", "O") else []
    names = [name.strip().casefold() for name in near]
    for name in names:
        if name not in ORIENTATIONS:
            raise SettingError(f"{{near}} must be among {', '.join(ORIENTATIONS)}, got {name}")
    if space.symmetry not in ("T", "O"):
        raise SettingError("{near} names orientations of cubic crystals")
    return names


def ideal_variants(name: str) -> Tensor:
    """Return an ideal orientation and its images in a rolled sheet (4, 4), unit quaternions."""
    return torch.tensor((rotations_of("D2") * named_orientation(name)).as_quat())


def nearest(space: RotationSpace, points: Tensor, variants: Tensor) -> Array:
    """Return the angles (N,) in radians from orientations (N, 4) to the nearest of several (V, 4)."""
    return np.min([misorientations(space, points, one).numpy() for one in variants], axis=0)
