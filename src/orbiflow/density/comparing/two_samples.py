"""A permutation test of whether two data sets come from one density, with kernels of the space."""

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

MAX_ROWS = 3_000
"""Rows of both data sets together at most: the test looks at all their pairs."""

QUANTILES = (0.005, 0.05, 0.4, 1.0)
"""Quantiles of the squared distances of pairs at which kernels have fallen to 1/e. Narrow kernels see
clusters, the widest a shift."""

PAIRS, MIN_SCALE = 500_000, 1e-9
"""Pairs drawn for the quantiles, and the least half of a kernel's squared width."""

BLOCK = 250
"""Permutations computed at a time."""


@dataclass(frozen=True)
class TestResult:
    """The result of a permutation test.

    - `p`: The share of random labels that give as large a difference.
    - `z`: The largest of the differences at all widths, in standard deviations of those of the
      permutations.
    - `permutations`: Their number. `rows`: The number of rows that were looked at.
    """

    __test__ = False  # pytest would take it for a test

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
    permutations: int = 999,
    seed: int = 0,
) -> TestResult:
    """Test by the largest standardised maximum mean discrepancy over kernels of four widths.

    Kernels are von Mises-Fisher ones, summed over the space's images, so that they are positive
    definite on it (Gretton and others, A kernel two-sample test, 2012). Pairs within a group are left
    out. Whole groups are permuted: groups of one data set among each other, while the two halves of
    a group with rows in both change places. All permutations, with the observed one among them, are
    standardised alike, so that p is exact.
    `points` are chart points (N, d) of both data sets; `first` says which (N,) are of the first one.
    The test looks at `MAX_ROWS` of them at most.
    """
    kept = chosen_rows(first, groups, MAX_ROWS, seed)
    points, first = points[torch.as_tensor(kept)], first[kept]
    groups = Groups.of(groups.index[kept] if groups.given else None, len(kept))
    rng = np.random.default_rng(seed)
    labels = _permuted(first, groups, permutations, rng)
    index = torch.as_tensor(groups.index)
    apart = index[:, None] != index[None, :]
    images = space.features(points)
    dots = [images[0] @ image.mT for image in images]  # their exponentials are kernels
    top = float(dots[0].diagonal().mean())
    scales = _scales(top - dots[0], apart, rng)
    counts = np.maximum(_pair_sums(apart.double(), labels), 1)
    found: list[Array] = []
    for scale in scales:
        kernel = sum(((dot - top) / scale).exp() for dot in dots)
        assert isinstance(kernel, Tensor)
        own, other, between = _pair_sums(kernel * apart, labels) / counts
        found.append(own + other - 2 * between)
    table = np.stack(found)
    spread = table.std(axis=1, keepdims=True)
    largest = ((table - table.mean(axis=1, keepdims=True)) / np.maximum(spread, 1e-300)).max(axis=0)
    as_large = int((largest[1:] >= largest[0] - 1e-12).sum())
    return TestResult(
        (1 + as_large) / (1 + permutations), float(largest[0]), permutations, len(points)
    )


def chosen_rows(first: Array, groups: Groups, most: int, seed: int = 0) -> Array:
    """Return the numbers of at most `most` rows, in whole groups, drawn from both data sets alike."""
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


def _scales(distances: Tensor, apart: Tensor, rng: np.random.Generator) -> list[float]:
    """Return quantiles of half the squared distances of pairs that are not of one group."""
    pairs = torch.as_tensor(rng.integers(len(distances), size=(2, PAIRS)))
    found = distances[pairs[0], pairs[1]][apart[pairs[0], pairs[1]]]
    quantiles = torch.tensor(QUANTILES, dtype=found.dtype)
    return listed(torch.quantile(found, quantiles).clamp_min(MIN_SCALE))


def _permuted(first: Array, groups: Groups, permutations: int, rng: np.random.Generator) -> Tensor:
    """Return labels (N, 1 + P), 1 for the first data set: first as observed, then permuted."""
    own = np.bincount(groups.index, first, groups.count) > 0
    other = np.bincount(groups.index, ~first, groups.count) > 0
    both, single = own & other, np.flatnonzero(own != other)
    found = np.empty((len(first), 1 + permutations))
    found[:, 0] = first
    for k in range(1, 1 + permutations):
        side = own.copy()
        side[single] = own[rng.permutation(single)]
        turned = both & (rng.random(groups.count) < 0.5)
        of_row = groups.index
        found[:, k] = np.where(both[of_row], first ^ turned[of_row], side[of_row])
    return torch.as_tensor(found)


def _pair_sums(kernel: Tensor, labels: Tensor) -> Array:
    """Return sums (3, 1 + P) over pairs within the first, within the second, and between."""
    rows = kernel.sum(dim=1)
    parts = [
        torch.stack([(block * (kernel @ block)).sum(dim=0), rows @ block])
        for block in torch.split(labels, BLOCK, dim=1)
    ]
    within, touching = torch.cat(parts, dim=1).numpy()
    between = touching - within
    return np.stack([within, float(rows.sum()) - touching - between, between])
