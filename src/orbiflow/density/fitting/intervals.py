"""Estimates of a parametric fit as the data write them, with standard errors and intervals."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from scipy import optimize, special
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.fitting.maximum import Local
from orbiflow.density.fitting.parameters import Parameter
from orbiflow.density.models import concentration_for, moments
from orbiflow.typed_torch import linalg, listed

LEVEL = 0.95
"""The level of intervals and cones."""

STEP = 1e-5
"""Radians by which a direction is turned to see how its coordinates change."""

CLOSE_CONCENTRATION = 6.0
"""Concentration, for each dimension of the sphere, from which squares of deviations are chi-square."""

MAX_CONCENTRATION, SAME = 1e9, 1e-30
"""The largest concentration, and how far below 1 the resultant of equal rows is at most."""

QUANTILES = 1_000
"""Even quantiles of the normal distribution in an integral over it."""


@dataclass(frozen=True)
class Writing:
    """How a direction is written: `write` takes a unit vector (p,) to numbers of these `names`.

    - `periods`: Of each number, what goes around; 0 for what does not.
    - `limits`: The largest absolute value that each may have.
    """

    write: Callable[[Tensor], Array]
    names: tuple[str, ...]
    periods: tuple[float, ...]
    limits: tuple[float, ...]
    unit: str = ""


def quantile() -> float:
    """Return how many standard errors an interval goes to either side."""
    return float(special.ndtri((1 + LEVEL) / 2))


def direction_parameters(
    name: str, number: int, local: Local, covariance: Tensor, writing: Writing
) -> tuple[list[Parameter], float | None]:
    """Return a direction's coordinates, and half the angle in degrees of the cone that holds it.

    It is axis `number` of the frame; `covariance` (q, q) is that of the local coordinates.
    """
    axis = local.at.frame[number]
    ways: list[Tensor] = []
    places: list[int] = []
    for place, (first, other) in enumerate(local.planes):
        if number in (first, other):
            far = local.at.frame[other if number == first else first]
            ways.append(far if number == first else -far)
            places.append(place)
    tangent = covariance[places][:, places]
    values = writing.write(axis)
    slopes = np.stack([_slope(writing, axis, way) for way in ways], axis=1)
    cone, variances = None, np.full(len(values), np.inf)
    if bool(tangent.isfinite().all()):
        variances = np.einsum("ki,ij,kj->k", slopes, tangent.numpy(), slopes)
        across = special.chdtri(len(places), 1 - LEVEL) * float(linalg.eigvalsh(tangent)[-1])
        cone = math.degrees(math.sqrt(across)) if across < (math.pi / 2) ** 2 else None
    parameters: list[Parameter] = []
    columns = zip(writing.names, values.tolist(), variances, writing.limits, strict=True)
    for label, value, variance, most in columns:
        error = None if cone is None or not np.isfinite(variance) else math.sqrt(variance)
        low, high = _ends(value, error)
        if low is not None and high is not None:
            low, high = max(low, -most), min(high, most)
        parameters.append(Parameter(f"{name}_{label}", value, error, low, high, writing.unit))
    return parameters, cone


def _slope(writing: Writing, axis: Tensor, way: Tensor) -> Array:
    """Return by how much the numbers (k,) of a direction change for each radian that it turns."""
    ends = [writing.write(axis * math.cos(s) + way * math.sin(s)) for s in (-STEP, STEP)]
    moved = ends[1] - ends[0]
    periods = np.array(writing.periods)
    around = np.where(periods > 0, periods, np.inf)
    moved = np.where(periods > 0, moved - periods * np.round(moved / around), moved)
    return moved / (2 * STEP)


def _ends(value: float, error: float | None) -> tuple[float | None, float | None]:
    if error is None:
        return None, None
    return value - quantile() * error, value + quantile() * error


def shape_parameters(local: Local, covariance: Tensor) -> list[Parameter]:
    """Return the shape parameters as the family reports them, with Wald's intervals.

    Those of positive ones are even in the logarithm.
    """
    derivatives: Any = torch.autograd.functional

    def reported(q: Tensor) -> Tensor:
        frame, shape = local.place(q)
        return local.form.reported(shape, frame)

    origin = local.origin()
    values: list[float] = listed(reported(origin))
    slopes = derivatives.jacobian(reported, origin)
    unknown = covariance.diagonal().isinf()
    determined = torch.where(unknown | unknown[:, None], 0.0, covariance)
    variances = torch.einsum("ki,ij,kj->k", slopes, determined, slopes)
    lost = (slopes[:, unknown].abs() > 1e-9).any(dim=1)
    parameters: list[Parameter] = []
    for name, value, variance, is_lost in zip(
        local.form.names(local.width), values, listed(variances), listed(lost), strict=True
    ):
        error = None if is_lost else math.sqrt(max(0.0, variance))
        low, high = _ends(value, error)
        if error is not None and local.form.positive and value > 0:
            factor = math.exp(quantile() * error / value)
            low, high = value / factor, value * factor
        elif low is not None and high is not None:
            low, high = max(low, local.form.bounds[0]), min(high, local.form.bounds[1])
        parameters.append(Parameter(name, value, error, low, high))
    return parameters


def concentration_interval(shortfall: float, rows: float, width: int) -> tuple[float, float]:
    """Return the interval of a von Mises-Fisher concentration from the mean resultant length alone.

    `shortfall` is 1 less that length R, of unit vectors of `width` numbers. The interval holds the
    concentrations for which R is in the middle of its distribution. Where they are close together,
    n (1 - R) is proportional to a chi-square variable (Watson and Williams, 1956), with the mean that
    it has. Otherwise the mean vector is normal, also without any concentration: Rayleigh's test and
    this interval agree whether it may be 0. There the upper end is that of Read's ratio (Presentation
    of search results: the CLs technique, 2002).
    """
    tail = (1 - LEVEL) / 2
    free = (width - 1) * (rows - 1)
    if (width - 1) / (2 * shortfall) > CLOSE_CONCENTRATION * (width - 1):
        quantiles = special.chdtri(free, [1 - tail, tail])
        wanted = [2 * rows * shortfall * (width - 1) / (2 * q) for q in quantiles]
        low, high = (concentration(max(0.0, 1 - short), width, short) for short in wanted)
        return float(low or 0.0), math.inf if high is None else float(high)
    resultant = 1 - shortfall

    def below(kappa: float, at: float) -> float:
        return _resultant_cdf(resultant, kappa, rows, width) - at

    high = 1.0 + 4 * width / shortfall
    # a length that is short by chance, even without any concentration, would leave nothing
    least = tail * _resultant_cdf(resultant, 0.0, rows, width)
    upper: Any = optimize.brentq(below, 0.0, high, args=(least,), xtol=1e-10)
    if below(0.0, 1 - tail) <= 0:
        return 0.0, float(upper)
    low: Any = optimize.brentq(below, 0.0, high, args=(1 - tail,), xtol=1e-10)
    return float(low), float(upper)


def concentration(resultant: float, width: int, below: float | None = None) -> float | None:
    """Return the likeliest concentration of a von Mises-Fisher distribution, None if it is infinite.

    `below` is 1 less the resultant, if it is known to more digits.

    >>> round(concentration(0.5, 2), 3), round(concentration(0.5, 3), 3)
    (1.159, 1.797)
    """

    if resultant <= 1e-12:
        return 0.0
    short = 1 - resultant if below is None else below
    if short <= ((width - 1) / (2 * MAX_CONCENTRATION) if below is None else SAME):
        return None
    mean, apart = torch.tensor([resultant, short], dtype=torch.float64)
    return float(concentration_for(mean, apart, width))


def _resultant_cdf(resultant: float, kappa: float, rows: float, width: int) -> float:
    """Return the probability of a mean resultant length up to `resultant`, for a normal mean vector."""
    there = moments(np.array(kappa), width)
    mean, along, across = (float(there.mean), float(there.along), float(there.across))
    levels = (np.arange(QUANTILES) + 0.5) / QUANTILES
    first = mean + math.sqrt(along / rows) * special.ndtri(levels)
    rest = np.maximum(resultant**2 - first**2, 0.0) * rows / across
    return float(special.gammainc((width - 1) / 2, rest / 2).mean())
