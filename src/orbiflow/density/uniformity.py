"""Tests of uniformity: how likely such angles, directions or axes are if all are equally likely.

Sources: Mardia and Jupp, Directional Statistics (2000); Rao, Some tests based on arc-lengths for the
circle (1976).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import special

from orbiflow.arrays import Array
from orbiflow.density.weighed_rows import WeighedRows, tail

MOST_EXACT, SKEWNESS = 200, 0.566
"""Angles up to which Rao's p is exact; then its distribution is nearly normal, and this is its skewness
times the square root of their number."""

MOST_REPEATED = 0.05
"""The largest share of angles that repeat another for Rao's test: rounding makes gaps even."""


def rayleigh_p(vectors: Array, rows: WeighedRows) -> float | None:
    """Return Rayleigh's probability of unit vectors (n, p) if all directions are equally likely.

    For angles, the approximation of Wilkie (1983); for directions, Jupp's correction of the score
    (Mardia and Jupp, 2000, equation 10.4.6). With weights, n is their effective number (Kish).
    """
    width = vectors.shape[1]
    if rows.groups is not None:
        return groups_p(vectors, rows)
    count = 1 / float(rows.weights @ rows.weights)
    square = float((rows.mean(vectors) ** 2).sum())
    if width == 2:
        root = math.sqrt(1 + 4 * count + 4 * count**2 * max(0.0, 1 - square))
        return min(1.0, math.exp(root - 1 - 2 * count))
    score = width * count * square
    score = (1 - 1 / (2 * count)) * score + score**2 / (2 * count * (width + 2))
    return tail(special.chdtrc, width, score)


def groups_p(values: Array, rows: WeighedRows) -> float | None:
    """Return Hotelling's probability that sums of values (n, q) over groups have mean 0."""
    sums, width = rows.sums(values), values.shape[1]
    free = len(sums) - width
    if free < 1:
        return None
    mean = sums.mean(axis=0)
    covariance: Array = np.cov(sums.T)
    if np.linalg.matrix_rank(covariance) < width:
        return None
    inverse: Array = np.linalg.inv(covariance)
    square = len(sums) / (len(sums) - 1) * float(mean @ inverse @ mean)
    return tail(special.fdtrc, width, free, square * free / width)


def kuiper_p(turns: NDArray[np.float64]) -> float:
    """Return Kuiper's probability of independent angles (n,), in turns, if all are equally likely.

    Stephens' (1970) modification of the statistic (Mardia and Jupp, 2000, section 6.3.2).
    """
    x, count = np.sort(turns % 1.0), len(turns)
    steps = np.arange(1, count + 1) / count
    range_of = float((steps - x).max() + (x - steps + 1 / count).max())
    value = range_of * (math.sqrt(count) + 0.155 + 0.24 / math.sqrt(count))
    if value < 0.4:  # the series is slow, and its sum 1
        return 1.0
    squares = (np.arange(1, 30) * value) ** 2
    return float(np.clip(2 * ((4 * squares - 1) * np.exp(-2 * squares)).sum(), 0.0, 1.0))


def watson_p(turns: NDArray[np.float64]) -> float:
    """Return Watson's probability (U^2) of independent angles (n,), in turns, if all are as likely.

    Stephens' (1970) modification of the statistic (Mardia and Jupp, 2000, section 6.3.3).
    """
    x, count = np.sort(turns % 1.0), len(turns)
    off = x - (np.arange(1, count + 1) - 0.5) / count
    value = float(((off - off.mean()) ** 2).sum()) + 1 / (12 * count)
    value = (value - 0.1 / count + 0.1 / count**2) * (1 + 0.8 / count)
    if value < 0.005:
        return 1.0
    steps = np.arange(1, 60)
    terms = (-1.0) ** (steps - 1) * np.exp(-2 * (np.pi * steps) ** 2 * value)
    return float(np.clip(2 * terms.sum(), 0.0, 1.0))


def rao_p(turns: NDArray[np.float64]) -> float | None:
    """Return Rao's spacing probability of independent angles (n,), in turns, if all are as likely.

    The statistic is the sum of what gaps between neighbours exceed 1 / n by, of which Rao (1976) has
    the distribution. None of fewer than 4 angles, and of those so rounded that many are equal.

    >>> round(rao_p(np.array([0.0, 0.5, 0.6, 0.62, 0.7])), 3)
    0.24
    """
    x = np.sort(turns % 1.0)
    count = len(x)
    gaps = np.diff(x, append=x[0] + 1)
    if count < 4 or np.count_nonzero(gaps == 0) > MOST_REPEATED * count:
        return None
    excess = float(np.maximum(gaps - 1 / count, 0).sum())
    mean = (1 - 1 / count) ** count
    square = 2 * (1 - 1 / count) ** (count + 1) + (count - 1) * (1 - 2 / count) ** (count + 1)
    deviation = math.sqrt(square / (count + 1) - mean**2)
    if count <= MOST_EXACT:
        return _rao_tail(excess, count, min(1 - 1 / count, mean + 14 * deviation))
    score = (excess - mean) / deviation
    normal = math.exp(-(score**2) / 2) / math.sqrt(2 * math.pi)
    skew = SKEWNESS / math.sqrt(count) / 6 * (score**2 - 1) * normal
    return min(1.0, max(0.0, tail(special.ndtr, -score) + skew))


def _rao_tail(excess: float, count: int, end: float) -> float:
    """Return the integral of Rao's density from a value up to `end`, beyond which is nothing.

    Of count gaps j are short; their shortfalls are uniform numbers on the line, whose sum has the
    density of Irwin and Hall, and the others' excesses fill a simplex. All terms are positive.
    """
    if excess >= end:
        return 0.0
    inside = np.arange(math.ceil(excess * count), math.floor(end * count) + 1) / count
    knots = np.unique(np.concatenate([[excess], inside, [end]]))
    nodes, weights = np.polynomial.legendre.leggauss(8)
    half = np.diff(knots) / 2
    at = ((knots[1:] + knots[:-1])[:, None] / 2 + half[:, None] * nodes).ravel()
    shifted = count * at - np.arange(count)[:, None]
    sums = ((shifted >= 0) & (shifted < 1)).astype(np.float64)
    total, logs = np.zeros_like(at), special.gammaln(np.arange(1.0, count + 2))
    for short in range(1, count):
        if short > 1:
            after = np.concatenate([sums[1:], np.zeros((1, len(at)))])
            sums = (shifted * sums + (short - shifted) * after) / (short - 1)
            sums[(shifted <= 0) | (shifted >= short)] = 0.0
        long = count - short
        log = logs[count - 1] + logs[count] - logs[short] - logs[long] - logs[long - 1]
        log = log + (long - 1) * np.log(at) - (short - 1) * math.log(count)
        total += np.exp(log) * sums[0]
    return float(min(1.0, (half[:, None] * weights).ravel() @ total))


def bingham_p(vectors: Array, rows: WeighedRows) -> float | None:
    """Return Bingham's probability of axes if all are equally likely (Mardia and Jupp, 10.7.3)."""
    x, y, z = vectors.T
    parts = [x * y * 2, x * z * 2, y * z * 2, x * x - y * y, (3 * z * z - 1) / math.sqrt(3)]
    values = np.stack(parts, axis=1) / math.sqrt(2)  # coordinates of the traceless tensor
    if rows.groups is not None:
        return groups_p(values, rows)
    count = 1 / float(rows.weights @ rows.weights)
    return tail(special.chdtrc, 5, 7.5 * count * float((rows.mean(values) ** 2).sum()))
