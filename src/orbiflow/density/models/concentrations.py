"""Constants and moments of von Mises-Fisher densities, of any dimension and any concentration."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import cache
from typing import NamedTuple

import torch
from torch import Tensor

LEAST_ORDER, TERMS = 16, 12
"""Order of a Bessel function from which its uniform expansion with so many terms has all digits."""

SERIES_CONCENTRATION = 2e4
"""Concentration for each coordinate from which the variance of the cosine is its asymptotic series."""

STEPS = 6
"""Newton steps to a concentration, of which four have been enough."""


class Moments(NamedTuple):
    """What is known of unit vectors of the density exp(k cos) / c, all (...,).

    - `log_mass`: The logarithm of the integral of exp(k (cos - 1)) over the unit sphere.
    - `mean`, `below`: The mean cosine, and 1 less it, which has its own digits.
    - `along`, `across`: The variance of the cosine, and that of each coordinate across the mean.
    """

    log_mass: Tensor
    mean: Tensor
    below: Tensor
    along: Tensor
    across: Tensor


def moments(kappa: Tensor, width: int) -> Moments:
    """Return moments of von Mises-Fisher densities of unit vectors of `width` numbers.

    They are of modified Bessel functions: log_mass = log((2 pi)^(v + 1) exp(-k) I_v(k) / k^v) with
    v = width / 2 - 1, mean = I_(v + 1) / I_v. Those of an order from 16 on are the uniform expansion
    (DLMF 10.41.3), and a stable recurrence leads down to the order (DLMF 10.29.1). Nothing
    underflows, and all is differentiable.

    Args:
        kappa: Concentrations (...), at least 0.
        width: The number of coordinates, at least 2.

    >>> even, sphere = torch.zeros(1).double(), moments(torch.tensor(2.0).double(), 3)
    >>> round(float(moments(even, 3).log_mass.exp()) / math.pi, 12)
    4.0
    >>> round(float(sphere.mean), 12) == round(1 / math.tanh(2) - 1 / 2, 12)
    True
    """
    order = width / 2 - 1
    steps = max(0, math.ceil(LEAST_ORDER - order))
    high = order + steps
    root = (high**2 + kappa**2).sqrt()
    series, slope = _debye(high, high / root)
    logs = series.log() - root.log() / 2 - high * (high + root).log() + high**2 / (root + kappa)
    # what is across is mean / kappa, which is known at 0
    rest = (1 / (2 * root) + high / root**2 * slope / series) / root
    across, below = 1 / (root + high) - rest, (high + high**2 / (root + kappa)) / (root + high)
    below = below + kappa * rest
    for step in range(steps):
        twice = 2 * (high - step)
        lower = 1 / (twice + kappa**2 * across)
        across, below = lower, (twice - kappa * below) * lower
        logs = logs - across.log()
    mean = kappa * across
    wide = kappa > SERIES_CONCENTRATION * width
    far = (2 * below - (width - 1) / (2 * kappa)) / kappa
    along = torch.where(wide, far, below * (1 + mean) - (width - 1) * across)
    return Moments(logs + (order + 0.5) * math.log(2 * math.pi), mean, below, along, across)


def concentration_for(mean: Tensor, below: Tensor, width: int) -> Tensor:
    """Return concentrations (...) of densities that have these mean cosines, from 0 to below 1.

    `below` is 1 less the mean cosine, to its own digits (Banerjee and others, Clustering on the unit
    hypersphere using von Mises-Fisher distributions, 2005; then Newton).
    """
    kappa = mean * (width - mean**2) / (below * (1 + mean))
    for _ in range(STEPS):
        moments_now = moments(kappa, width)
        short = torch.where(mean < 0.5, mean - moments_now.mean, moments_now.below - below)
        kappa = kappa + short / moments_now.along
    return kappa


def _debye(order: float, p: Tensor) -> tuple[Tensor, Tensor]:
    """Return the sum of U_k(p) / order^k (...) and its derivative by p."""
    total, slope = torch.zeros_like(p), torch.zeros_like(p)
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
