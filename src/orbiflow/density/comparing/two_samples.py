"""Whether two data sets come from one density: a permutation test with kernels of the space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.comparing.resampling import Groups
from orbiflow.density.spaces import Space
from orbiflow.runtime import one_thread
from orbiflow.typed_torch import listed

MOST_ROWS = 3_000
"""Of both data sets together: the test looks at all their pairs."""

QUANTILES = (0.005, 0.05, 0.4, 1.0)
"""Of the squared distances of pairs: a kernel has fallen to 1/e there. Narrow ones see clusters, the
widest a shift."""

PAIRS, LEAST_SCALE = 500_000, 1e-9
"""Pairs drawn for the quantiles, and half the squared width of a kernel at least."""

PERMUTATIONS = 999
BLOCK = 250
"""Permutations at a time."""


@dataclass(frozen=True)
class TestResult:
    """What the permutations say.

    - `p`: that labels at random give as large a difference. `z`: the largest of the differences at
      all widths, in standard deviations of those of the permutations.
    - `permutations`: how many. `rows`: that were looked at.
    """

    __test__ = False  # no test of pytest's

    p: float
    z: float
    permutations: int
    rows: int


@one_thread()
@torch.no_grad()
def mmd_test(
    space: Space,
    points: Tensor,
    first: Array,
    groups: Groups,
    *,
    permutations: int = PERMUTATIONS,
    seed: int = 0,
) -> TestResult:
    """Largest standardised maximum mean discrepancy over kernels of four widths.

    Kernels are von Mises-Fisher ones, summed over the space's images, so that they are positive
    definite on it (Gretton and others, A kernel two-sample test, 2012). Pairs within a group are left
    out. What is permuted are whole groups: those of one data set among all such, and of groups with
    rows in both the two halves change places. All permutations, the one that was observed among them,
    are standardised alike, so that p is exact.

    Args:
        points: chart points (N, d) of both data sets.
        first: (N,) whether a row is of the first one.
        groups: of the rows.
    """
    rng = np.random.default_rng(seed)
    labels = _permuted(first, groups, permutations, rng)
    index = torch.as_tensor(groups.index)
    apart = index[:, None] != index[None, :]
    dots = _dots(space, points)
    top = float(dots[0].diagonal().mean())
    scales = _scales(top - dots[0], apart, rng)
    counts = _difference(apart.double(), labels, None)
    found: list[tuple[Array, Array, Array]] = []
    for scale in scales:
        kernel = sum(((dot - top) / scale).exp() for dot in dots)
        assert isinstance(kernel, Tensor)
        found.append(_difference(kernel * apart, labels, counts))
    table = np.stack([mean_a + mean_b - 2 * mean_ab for mean_a, mean_b, mean_ab in found])
    spread = table.std(axis=1, keepdims=True)
    largest = ((table - table.mean(axis=1, keepdims=True)) / np.maximum(spread, 1e-300)).max(axis=0)
    as_large = int((largest[1:] >= largest[0] - 1e-12).sum())
    return TestResult(
        (1 + as_large) / (1 + permutations), float(largest[0]), permutations, len(points)
    )


def chosen_rows(first: Array, groups: Groups, most: int, seed: int = 0) -> Array:
    """Numbers of `most` rows at most, of whole groups, each data set's share as it is."""
    count = len(first)
    if count <= most:
        return np.arange(count)
    order = np.random.default_rng(seed).permutation(groups.count)
    place = np.empty(groups.count, dtype=np.int64)
    place[order] = np.arange(groups.count)
    by_group = np.argsort(place[groups.index], kind="stable")
    total = np.cumsum(np.bincount(place[groups.index], minlength=groups.count))
    whole = int(np.searchsorted(total, most, side="right"))
    return np.sort(by_group[: total[whole - 1] if whole else most])


def _dots(space: Space, points: Tensor) -> list[Tensor]:
    """(N, N) an image: what kernels are exponentials of."""
    images = space.features(points)
    return [images[0] @ image.mT for image in images]


def _scales(distances: Tensor, apart: Tensor, rng: np.random.Generator) -> list[float]:
    """Quantiles of half the squared distances of pairs that are not of one group."""
    pairs = torch.as_tensor(rng.integers(len(distances), size=(2, PAIRS)))
    found = distances[pairs[0], pairs[1]][apart[pairs[0], pairs[1]]]
    quantiles = torch.tensor(QUANTILES, dtype=found.dtype)
    return listed(torch.quantile(found, quantiles).clamp_min(LEAST_SCALE))


def _permuted(first: Array, groups: Groups, permutations: int, rng: np.random.Generator) -> Tensor:
    """Labels (N, 1 + P), 1 for the first data set: as observed, then permuted."""
    own = np.bincount(groups.index, first, groups.count) > 0
    other = np.bincount(groups.index, ~first, groups.count) > 0
    both, single = own & other, np.flatnonzero(own != other)
    found = np.empty((len(first), 1 + permutations))
    found[:, 0] = first
    for k in range(1, 1 + permutations):
        side = own.copy()
        side[single] = own[rng.permutation(single)]
        turned = both & (rng.random(groups.count) < 0.5)
        row = side[groups.index]
        shared = both[groups.index]
        found[:, k] = np.where(shared, first ^ turned[groups.index], row)
    return torch.as_tensor(found)


def _difference(
    kernel: Tensor, labels: Tensor, counts: tuple[Array, Array, Array] | None
) -> tuple[Array, Array, Array]:
    """(1 + P,) each: sums of the kernel over pairs within the first, the second, and between.

    Given `counts` of the pairs, their means.
    """
    rows = kernel.sum(dim=1)
    total = float(rows.sum())
    parts: list[Tensor] = []
    for block in torch.split(labels, BLOCK, dim=1):
        within = (block * (kernel @ block)).sum(dim=0)
        parts.append(torch.stack([within, rows @ block]))
    within, touching = torch.cat(parts, dim=1).numpy()
    between = touching - within
    sums = (within, total - touching - between, between)
    if counts is None:
        return sums
    a, b, c = (s / np.maximum(n, 1) for s, n in zip(sums, counts, strict=True))
    return a, b, c
