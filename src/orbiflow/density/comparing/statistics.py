"""Statistics of tests of two or more samples of angles, directions or axes.

All take unit vectors (N, p) of all samples together and the number (N,) of each row's sample. Those
whose p is from permutations take a table (N, B) of such numbers, one column for each permutation, in
which samples may have other sizes.

Sources: Mardia and Jupp, Directional Statistics (2000), chapters 7 and 10; Fisher, Statistical
Analysis of Circular Data (1993), chapter 5; Rizzo and Szekely, DISCO analysis (2010).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special
from scipy.spatial.distance import cdist

from orbiflow.arrays import Array
from orbiflow.density.fitting import concentration

Labels = NDArray[np.int64]
"""The number of each row's sample, from 0."""

BLOCK_ENTRIES = 1_000_000
"""Entries of a table of permutations worked on at a time."""

TIED = 1e-12
"""Turns by which angles that count as equal may differ."""


class TestStatistic(NamedTuple):
    """A statistic, its degrees of freedom, the distribution that p is from, and p."""

    __test__ = False  # pytest would take it for a test

    statistic: float
    degrees: tuple[float, ...]
    by: str
    p: float


def _f_test(statistic: float, above: float, below: float) -> TestStatistic:
    p: Any = special.fdtrc(above, below, max(0.0, statistic))
    return TestStatistic(statistic, (above, below), "F", float(p))


def chi_square(statistic: float, degrees: int) -> TestStatistic:
    """Return a statistic with its p by the chi-square distribution."""
    return TestStatistic(
        statistic, (degrees,), "chi-square", float(special.chdtrc(degrees, max(0.0, statistic)))
    )


def _sizes(labels: Labels) -> Array:
    return np.bincount(labels).astype(np.float64)


def _sums(values: Array, labels: Labels) -> Array:
    """Return sums (r, k) over each sample of values (N, k)."""
    return np.stack([np.bincount(labels, column) for column in values.T], axis=1)


def watson_williams(vectors: Array, labels: Labels) -> TestStatistic:
    """Test of equal mean directions of von Mises-Fisher samples of one concentration.

    The F test of Watson and Williams (1956), on the circle with the factor 1 + 3 / (8 k) of Stephens
    (1972).
    """
    count, width = vectors.shape
    lengths = np.linalg.norm(_sums(vectors, labels), axis=1)
    total = float(np.linalg.norm(vectors.sum(axis=0)))
    samples, within = len(lengths), float(lengths.sum())
    kappa = concentration(min(1.0, within / count), width) or math.inf
    factor = 1 + 3 / (8 * kappa) if width == 2 else 1.0
    between = (within - total) / (samples - 1)
    rest = (count - within) / (count - samples)
    return _f_test(
        factor * between / rest, (width - 1) * (samples - 1), (width - 1) * (count - samples)
    )


def common_mean(vectors: Array, labels: Labels) -> TestStatistic:
    """Test of equal mean directions of large samples, whatever their densities.

    Each sample's mean direction has its own circular standard error (Watson, Statistics on spheres,
    1983; Fisher, 1993, chapter 5, for angles).
    """
    width = vectors.shape[1]
    sums, sizes = _sums(vectors, labels), _sizes(labels)
    lengths = np.linalg.norm(sums, axis=1)
    means = sums / lengths[:, None]
    along = (vectors * means[labels]).sum(axis=1)
    across = np.bincount(labels, np.maximum(0.0, 1 - along**2)) / sizes / (width - 1)
    weights = sizes * (lengths / sizes) ** 2 / across  # 1 / variance of each mean
    total = float(np.linalg.norm(weights @ means))
    return chi_square(2 * (float(weights.sum()) - total), (width - 1) * (len(sizes) - 1))


def common_concentration(vectors: Array, labels: Labels) -> TestStatistic:
    """Test of equal concentrations: an analysis of variance of the sines of deviations.

    Fisher (1993), chapter 5, for angles; on spheres of the lengths across the mean alike.
    """
    sums, sizes = _sums(vectors, labels), _sizes(labels)
    means = sums / np.linalg.norm(sums, axis=1, keepdims=True)
    along = (vectors * means[labels]).sum(axis=1)
    sines = np.sqrt(np.maximum(0.0, 1 - along**2))
    means = np.bincount(labels, sines) / sizes
    samples, count = len(sizes), len(sines)
    between = float(sizes @ (means - sines.mean()) ** 2) / (samples - 1)
    rest = float(((sines - means[labels]) ** 2).sum()) / (count - samples)
    return _f_test(between / rest, samples - 1, count - samples)


def common_median(vectors: Array, labels: Labels) -> TestStatistic:
    """Test of equal median directions of angles, whatever their densities (Fisher, 1993)."""
    turns = _turns(vectors)
    side = (turns - median_direction(turns) + 0.5) % 1.0 < 0.5
    sizes, below = _sizes(labels), np.bincount(labels, side)
    count, lower = len(turns), float(side.sum())
    if lower in (0, count):
        return TestStatistic(0.0, (len(sizes) - 1,), "chi-square", 1.0)
    rest = lower * (count - lower)
    statistic = count**2 / rest * float((below**2 / sizes).sum()) - count * lower / (count - lower)
    return chi_square(statistic, len(sizes) - 1)


def _turns(vectors: Array) -> Array:
    turns = np.arctan2(vectors[:, 1], vectors[:, 0]) / (2 * np.pi) % 1.0
    return np.where(turns > 1 - TIED, 0.0, turns)


def median_direction(turns: Array) -> float:
    """Return the direction, in turns, to which angles (N,) in turns are nearest on average.

    >>> round(median_direction(np.array([0.95, 0.05, 0.15])), 12)
    0.05
    """
    x = np.sort(turns % 1.0)
    count = len(x)
    twice = np.concatenate([x, x + 1])
    sums = np.concatenate([[0.0], np.cumsum(twice)])
    start = np.arange(count)
    end = np.searchsorted(twice, x + 0.5, side="right")  # up to half a turn ahead
    ahead = sums[end] - sums[start] - (end - start) * x
    behind = (start + count - end) * (x + 1) - (sums[start + count] - sums[end])
    means = (ahead + behind) / count
    best = int(means.argmin())
    after = (best + 1) % count
    before = (best - 1) % count
    # between two middle ones all directions are as near
    other = min((after, before), key=lambda k: means[k])
    if count % 2 == 0 and means[other] - means[best] < TIED:
        return float((x[best] + ((x[other] - x[best] + 0.5) % 1.0 - 0.5) / 2) % 1.0)
    return float(x[best])


def _steps(turns: Array, table: Labels) -> tuple[Array, Array, Array]:
    """Return the difference (N, B) of two empirical distributions at each row, and both sizes (B,)."""
    order = np.argsort(turns, kind="stable")
    x, samples = turns[order], table[order]
    last = np.searchsorted(x, x + TIED, side="right") - 1  # those that are equal step together
    first = samples == 0
    sizes = first.sum(axis=0).astype(float), (~first).sum(axis=0).astype(float)
    steps: Array = np.cumsum(first / sizes[0] - ~first / sizes[1], axis=0)[last]
    return steps, *sizes


def watson_u2(vectors: Array, table: Labels) -> Array:
    """Return Watson's U^2 (B,) of two samples of angles (Watson, 1962; with ties as Zar has them)."""
    steps, n, m = _steps(_turns(vectors), table)
    count = n + m
    squares = (steps**2).sum(axis=0) - steps.sum(axis=0) ** 2 / count
    return n * m / count**2 * squares


def kuiper(vectors: Array, table: Labels) -> Array:
    """Return Kuiper's statistic (B,) of two samples of angles, times sqrt(n m / (n + m))."""
    steps, n, m = _steps(_turns(vectors), table)
    return np.sqrt(n * m / (n + m)) * (steps.max(axis=0) - steps.min(axis=0))


def mardia_watson_wheeler(vectors: Array, table: Labels) -> Array:
    """Return Mardia, Watson and Wheeler's W (B,) of uniform scores; equal angles share a rank."""
    turns = _turns(vectors)
    x = np.sort(turns)
    low = np.searchsorted(x, turns - TIED, side="left")
    high = np.searchsorted(x, turns + TIED, side="right")
    scores = 2 * np.pi * (low + high + 1) / 2 / len(turns)
    waves = np.stack([np.cos(scores), np.sin(scores)])
    statistic = np.zeros(table.shape[1])
    for sample in range(int(table[:, 0].max()) + 1):
        inside = (table == sample).astype(np.float64)
        statistic += 2 * ((waves @ inside) ** 2).sum(axis=0) / inside.sum(axis=0)
    return statistic


def energy(vectors: Array, table: Labels) -> Array:
    """Return the DISCO statistic (B,) of distances in the space of the vectors, of any samples.

    Distances in a Euclidean space tell any two densities apart (Szekely and Rizzo, 2004).
    """
    distances = cdist(vectors, vectors)
    count, samples = len(vectors), int(table[:, 0].max()) + 1
    within = np.zeros(table.shape[1])
    for sample in range(samples):
        inside = (table == sample).astype(np.float64)
        within += ((distances @ inside) * inside).sum(axis=0) / (2 * inside.sum(axis=0))
    total = float(distances.sum()) / (2 * count)
    return (total - within) / (samples - 1) / np.maximum(within / (count - samples), 1e-300)


def permuted(
    statistic: Callable[[Array, Labels], Array],
    vectors: Array,
    labels: Labels,
    permutations: int,
    seed: int,
    groups: Labels | None = None,
) -> TestStatistic:
    """Return a statistic with its p among random permutations of the samples.

    Rows of one of `groups` (N,), which all are of one sample, stay together.
    """
    rng = np.random.default_rng(seed)
    if groups is None:
        groups = np.arange(len(labels))
    _, first, member = np.unique(groups, return_index=True, return_inverse=True)
    member, samples = member.reshape(-1), labels[first]
    blocks = [statistic(vectors, labels[:, None])]
    size = max(1, BLOCK_ENTRIES // len(labels))
    for start in range(0, permutations, size):
        count = min(size, permutations - start)
        table = np.stack([rng.permutation(samples) for _ in range(count)], axis=1)
        blocks.append(statistic(vectors, table[member]))
    values = np.concatenate(blocks)
    p = float((values >= values[0] * (1 - 1e-12) - 1e-15).mean())
    return TestStatistic(float(values[0]), (), "permutation", p)
