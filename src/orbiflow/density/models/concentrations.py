"""Constants and moments of von Mises-Fisher densities, of any dimension and any concentration."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import cache
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array

Numbers = TypeVar("Numbers", Tensor, Array)

LEAST_ORDER, TERMS = 16, 12
"""Order of a Bessel function from which its uniform expansion with so many terms has all digits."""

SERIES_CONCENTRATION = 2e4
"""Concentration for each coordinate from which the variance of the cosine is its asymptotic series."""

STEPS = 6
"""Newton steps to a concentration, of which four have been enough."""


class Moments(NamedTuple, Generic[Numbers]):
    """What is known of unit vectors of the density exp(k cos) / c, all (...,).

    - `log_mass`: The logarithm of the integral of exp(k (cos - 1)) over the unit sphere.
    - `mean`, `below`: The mean cosine, and 1 less it, which has its own digits.
    - `along`, `across`: The variance of the cosine, and that of each coordinate across the mean.
    """

    log_mass: Numbers
    mean: Numbers
    below: Numbers
    along: Numbers
    across: Numbers


def moments(kappa: Numbers, width: int) -> Moments[Numbers]:
    """Return moments of von Mises-Fisher densities of unit vectors of `width` numbers.

    They are of modified Bessel functions: log_mass = log((2 pi)^(v + 1) exp(-k) I_v(k) / k^v) with
    v = width / 2 - 1, mean = I_(v + 1) / I_v. Those of an order from 16 on are the uniform expansion
    (DLMF 10.41.3), and a stable recurrence leads down to the order (DLMF 10.29.1). Nothing
    underflows, and moments of tensors are differentiable.

    Args:
        kappa: Concentrations (...), at least 0; a few have theirs sooner as an array.
        width: The number of coordinates, at least 2.

    >>> even, sphere = torch.zeros(1).double(), moments(torch.tensor(2.0).double(), 3)
    >>> round(float(moments(even, 3).log_mass.exp()) / math.pi, 12)
    4.0
    >>> round(float(sphere.mean), 12) == round(1 / math.tanh(2) - 1 / 2, 12)
    True
    """
    of: Any = torch if isinstance(kappa, Tensor) else np
    k: Any = kappa
    order = width / 2 - 1
    steps = max(0, math.ceil(LEAST_ORDER - order))
    high = order + steps
    root = of.sqrt(high**2 + k**2)
    series, slope = _debye(high, high / root)
    logs = of.log(series) - of.log(root) / 2 - high * of.log(high + root) + high**2 / (root + k)
    # what is across is mean / kappa, which is known at 0
    rest = (1 / (2 * root) + high / root**2 * slope / series) / root
    across, below = 1 / (root + high) - rest, (high + high**2 / (root + k)) / (root + high)
    below = below + k * rest
    for step in range(steps):
        twice = 2 * (high - step)
        lower = 1 / (twice + k**2 * across)
        across, below = lower, (twice - k * below) * lower
        logs = logs - of.log(across)
    mean = k * across
    wide = k > SERIES_CONCENTRATION * width
    with np.errstate(divide="ignore", invalid="ignore"):  # of arrays, at 0
        far = (2 * below - (width - 1) / (2 * k)) / k
    along = of.where(wide, far, below * (1 + mean) - (width - 1) * across)
    return Moments(logs + (order + 0.5) * math.log(2 * math.pi), mean, below, along, across)


def concentration_for(mean: Tensor, below: Tensor, width: int) -> Tensor:
    """Return concentrations (...) of densities that have these mean cosines, from 0 to below 1.

    They are not tracked by autograd.
    `below` is 1 less the mean cosine, to its own digits (Banerjee and others, Clustering on the unit
    hypersphere using von Mises-Fisher distributions, 2005; then Newton).
    """
    r, less = (np.atleast_1d(one.detach().cpu().numpy()) for one in (mean, below))
    kappa = r * (width - r**2) / (less * (1 + r))
    for _ in range(STEPS):
        now = moments(kappa, width)
        kappa = kappa + np.where(r < 0.5, r - now.mean, now.below - less) / now.along
    return torch.as_tensor(kappa).reshape(mean.shape).to(mean)


def _debye(order: float, p: Any) -> tuple[Any, Any]:
    """Return the sum of U_k(p) / order^k (...) and its derivative by p."""
    total = slope = p * 0
    for factor in _debye_factors(order):
        slope = slope * p + total
        total = total * p + factor
    return total, slope


@cache
def _debye_factors(order: float) -> tuple[float, ...]:
    """Return the coefficients of that sum, the highest power first (DLMF 10.41.9)."""
    polynomial = [Fraction(1)]
    total = [Fraction(0)] * (3 * TERMS + 1)
    for k in range(TERMS + 1):
        for power, factor in enumerate(polynomial):
            total[power] += factor / Fraction(order) ** k
        after = [Fraction(0)] * (len(polynomial) + 3)
        for power, factor in enumerate(polynomial):
            after[power + 1] += factor * (Fraction(power, 2) + Fraction(1, 8 * (power + 1)))
            after[power + 3] -= factor * (Fraction(power, 2) + Fraction(5, 8 * (power + 3)))
        polynomial = after
    return tuple(float(factor) for factor in reversed(total))
