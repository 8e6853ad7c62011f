"""Groups of rows that belong together: their bootstrap resamples, folds and test of two samples."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.data import group_numbers
from orbiflow.density.fitting import lightest_folds, lone_groups_note
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import one_thread
from orbiflow.settings import as_whole
from orbiflow.typed_torch import listed

MIN_GROUPS = 5
"""Number of independent rows or groups that an uncertainty needs."""

FEW_GROUPS = 20
"""Number of equal rows or groups below which a note says that the uncertainty is rough itself."""

BLOCK_ENTRIES = 4_000_000
"""Entries of a block of resamples times groups, which bounds the memory."""


@dataclass(frozen=True, eq=False)
class Groups:
    """Rows in groups: those of one group (a protein, a station, an event) are not independent.

    - `index`: The group (N,) of each row, from 0. `count`: The number of groups.
    - `given`: Whether there are groups; otherwise each row is one.

    >>> Groups.of(["a", "b", "a"], 3).index.tolist()
    [0, 1, 0]
    """

    index: NDArray[np.int64]
    count: int
    given: bool

    @classmethod
    def of(cls, labels: ArrayLike | None, rows: int) -> Groups:
        """Return groups from a label for each row, of any kind; None means independent rows."""
        if labels is None:
            return cls(np.arange(rows), rows, False)
        index = group_numbers(labels, rows)
        return cls(index, int(index.max(initial=-1)) + 1, True)

    @property
    def what(self) -> str:
        """What is independent, in a word."""
        return "groups" if self.given else "rows"

    def require(self) -> None:
        """Check that there are enough for an uncertainty."""
        if self.count < MIN_GROUPS:
            raise OrbiflowError(
                f"{self.count} {self.what} are too few for an uncertainty: there must be at least "
                f"{MIN_GROUPS}"
            )

    def notes(self) -> list[str]:
        """Return what the user should know of them."""
        lone = lone_groups_note(torch.as_tensor(self.index) if self.given else None)
        equal = len(self.index) ** 2 / (np.bincount(self.index) ** 2).sum()  # Kish, 1965
        if equal >= FEW_GROUPS:
            return lone
        like = f", no better than {equal:.1f} equal ones," if equal < 0.9 * self.count else ""
        return [
            *lone,
            f"of only {self.count} {self.what}{like} the uncertainties themselves are rough",
        ]

    def sums(self, values: Array) -> Array:
        """Return sums (G, ...) over each group of values (N, ...)."""
        flat = values.reshape(len(values), -1)
        columns = [np.bincount(self.index, column, minlength=self.count) for column in flat.T]
        return np.stack(columns, axis=1).reshape(self.count, *values.shape[1:])


def resampled_sums(table: Array, resamples: int, rng: np.random.Generator) -> Array:
    """Return sums (B, k) of a table (G, k) over G rows drawn with replacement, `resamples` times."""
    count = len(table)
    size = max(1, BLOCK_ENTRIES // count)
    sums: list[Array] = []
    for start in range(0, resamples, size):
        number = min(size, resamples - start)
        drawn = rng.integers(count, size=(number, count)) + count * np.arange(number)[:, None]
        weights = np.bincount(drawn.ravel(), minlength=number * count).reshape(number, count)
        sums.append(weights.astype(np.float64) @ table)
    return np.concatenate(sums)


MAX_FOLDS = 1000


def cross_validation_folds(
    rows: int, folds: int = 10, *, together: ArrayLike | None = None, seed: int = 0, split: int = 0
) -> NDArray[np.int64]:
    """Return the random fold (N,) of each row, from 0; each row is held out once.

    Groups are dealt out in random order, always to the fold that has the fewest rows so far. So the
    sizes of folds differ by at most one row, or by the size of the largest group.

    Args:
        rows: Number N of rows.
        folds: Number of folds, 2 or more.
        together: A label for each row; rows of one label are in one fold.
        seed: Seed of the folds.
        split: Number of the repetition; each is a split of its own, whatever others there are.

    Raises:
        OrbiflowError: If there is another number of labels than rows, or fewer groups than folds.

    >>> cross_validation_folds(6, 3, together=["a", "a", "b", "b", "c", "c"]).tolist()
    [1, 1, 2, 2, 0, 0]
    """
    folds = as_whole(folds, "folds", 2, MAX_FOLDS)
    units = Groups.of(together, rows)
    if units.count < folds:
        raise OrbiflowError(
            f"{folds} folds need as many {units.what}, there are {units.count}: ask for fewer folds"
        )
    order = np.random.default_rng([seed, split]).permutation(units.count)
    sizes = np.bincount(units.index, minlength=units.count)
    fold = np.empty(units.count, dtype=np.int64)
    fold[order] = lightest_folds(sizes[order], folds)
    return fold[units.index]


MAX_ROWS = 3_000
"""Rows of both data sets together at most: the test looks at all their pairs."""

DISTANCE_QUANTILES = (0.005, 0.05, 0.4, 1.0)
"""Quantiles of the squared distances of pairs at which kernels have fallen to 1/e. Narrow kernels see
clusters, the widest a shift."""

PAIRS, MIN_SCALE = 500_000, 1e-9
"""Pairs drawn for the quantiles, and the least half of a kernel's squared width."""

BLOCK_LABELS = 250
"""Random labels computed at a time."""


@dataclass(frozen=True)
class TestResult:
    """The result of a test of two samples.

    - `p`: The share of random labels that give as large a difference.
    - `z`: The largest of the differences at all widths, in standard deviations of those of random
      labels.
    - `permutations`: Number of random labels. `rows`: Number of rows that were looked at.
    - `exact`: Whether whole groups changed sides, so that p is exact. Otherwise their terms changed
      signs, and p is approximate.
    """

    __test__ = False  # pytest would take it for a test

    p: float
    z: float
    permutations: int
    rows: int
    exact: bool = True


@one_thread()
@torch.no_grad()
def mmd_test(
    space: Space,
    points: Tensor,
    first: Array,
    groups: Groups,
    *,
    permutations: int = 999,
    level: float = 0.95,
    seed: int = 0,
) -> TestResult:
    """Test by the largest standardised maximum mean discrepancy over kernels of four widths.

    Kernels are von Mises-Fisher ones, summed over the space's images, so that they are positive
    definite on it (Gretton and others, A kernel two-sample test, 2012).

    Where groups have equally many rows, whole groups are permuted: groups of one data set among each
    other, while the two halves of a group with rows in both change places. Pairs within a group are
    left out. All permutations, with the observed one among them, are standardised alike, so that p is
    exact. Groups of different sizes are not exchangeable. There, the difference of the data sets' mean
    features is a sum with one term for each group, and the signs of the terms are drawn: a wild cluster
    bootstrap (Cameron, Gelbach and Miller, Bootstrap-based improvements for inference with clustered
    errors, 2008; Leucht and Neumann, Dependent wild bootstrap for degenerate U- and V-statistics,
    2013).

    `points` are chart points (N, d) of both data sets; `first` says which (N,) are of the first one.
    The test looks at `MAX_ROWS` of them at most.

    Raises:
        OrbiflowError: If there are too few groups or permutations for any p to reach 1 - `level`.
    """
    kept = chosen_rows(first, groups, MAX_ROWS, seed)
    points, first = points[torch.as_tensor(kept)], first[kept]
    groups = Groups.of(groups.index[kept] if groups.given else None, len(kept))
    alike = _are_alike(first, groups, level, permutations)
    rng = np.random.default_rng(seed)
    draw = _permuted if alike else _flipped
    labels = draw(first, groups, permutations, rng)
    index = torch.as_tensor(groups.index)
    apart = index[:, None] != index[None, :]
    images = space.features(points)
    dots = [images[0] @ image.mT for image in images]  # their exponentials are kernels
    top = float(dots[0].diagonal().mean())
    counts = np.maximum(_pair_sums(apart.double(), labels), 1) if alike else None
    statistics: list[Array] = []
    for scale in _scales(top - dots[0], apart, rng):
        kernel = sum(((dot - top) / scale).exp() for dot in dots)
        assert isinstance(kernel, Tensor)
        if counts is None:
            statistics.append(_squares(kernel, labels))
        else:
            within, other, between = _pair_sums(kernel * apart, labels) / counts
            statistics.append(within + other - 2 * between)
    table = np.stack(statistics)
    spread = table.std(axis=1, keepdims=True)
    largest = ((table - table.mean(axis=1, keepdims=True)) / np.maximum(spread, 1e-300)).max(axis=0)
    p = float((largest >= largest[0] - 1e-12).mean())
    return TestResult(p, float(largest[0]), permutations, len(points), alike)


def _are_alike(first: Array, groups: Groups, level: float, permutations: int) -> bool:
    """Return whether groups can change sides and leave everything else as it is.

    Check that a difference, however large, can be told from chance at this level.
    """
    sizes, other = (np.bincount(groups.index, side, groups.count) for side in (first, ~first))
    shared = (sizes > 0) & (other > 0)
    alone = (sizes + other)[~shared]
    alike = bool((sizes == other)[shared].all() and (alone == alone[:1]).all())
    highest, both = 1 - level + 1e-12, int(shared.sum())
    mine, two = (int((side > 0).sum()) - both for side in (sizes, other))
    common = each = 1 + math.ceil(-math.log2(highest))
    if alike:
        each = next(n for n in range(3, common + 3) if 2 / math.comb(2 * n, n) <= highest)
        # two rows that happen to be far from all others show no density of their own
        ways = math.comb(mine + two, mine) if min(mine, two) > 2 else 1
        enough = (1 + (mine == two)) / (ways << both) <= highest
    else:
        enough = both + min(mine, two) >= common
    if not enough:
        raise OrbiflowError(
            f"the data sets have {mine} and {two} {groups.what} of their own and {both} in common: too "
            f"few to tell a difference from chance at level {level:g}, which takes {each} of each data "
            f"set's own or {common} in common"
        )
    if highest * (1 + permutations) < 1:
        raise OrbiflowError(
            f"{permutations} permutations are too few for level {level:g}: ask for at least "
            f"{math.ceil(1 / highest) - 1}"
        )
    return alike


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
    lengths = distances[pairs[0], pairs[1]][apart[pairs[0], pairs[1]]]
    quantiles = torch.tensor(DISTANCE_QUANTILES, dtype=lengths.dtype)
    return listed(torch.quantile(lengths, quantiles).clamp_min(MIN_SCALE))


def _permuted(first: Array, groups: Groups, permutations: int, rng: np.random.Generator) -> Tensor:
    """Return labels (N, 1 + P), 1 for the first data set: first as observed, then permuted."""
    in_first = np.bincount(groups.index, first, groups.count) > 0
    other = np.bincount(groups.index, ~first, groups.count) > 0
    both, single = in_first & other, np.flatnonzero(in_first != other)
    table = np.empty((len(first), 1 + permutations))
    table[:, 0] = first
    for k in range(1, 1 + permutations):
        side = in_first.copy()
        side[single] = in_first[rng.permutation(single)]
        turned = both & (rng.random(groups.count) < 0.5)
        of_row = groups.index
        table[:, k] = np.where(both[of_row], first ^ turned[of_row], side[of_row])
    return torch.as_tensor(table)


def _flipped(first: Array, groups: Groups, permutations: int, rng: np.random.Generator) -> Tensor:
    """Return weights (N, 1 + P) of rows in the difference of both means: as observed, then flipped.

    Each group's term is taken about the mean of all rows, so that it has mean 0 if the densities are
    equal, and its sign is drawn. A group with the share h of the rows draws that mean nearer, which
    shrinks its distance by sqrt(1 - h): this is undone, as in HC2 (MacKinnon and White, 1985).
    """
    sizes, rows = np.bincount(groups.index), len(first)
    signed: Array = np.where(first, 1.0, -first.sum() / (~first).sum()) / first.sum()
    lean = groups.sums(signed) / sizes
    away = lean / np.sqrt(1 - sizes / rows)
    signs = rng.choice([-1.0, 1.0], size=(groups.count, permutations))
    drawn: Array = (signed + (away - lean)[groups.index])[:, None] * signs[groups.index]
    moved = drawn - (away * sizes) @ signs / rows
    return torch.as_tensor(np.concatenate([signed[:, None], moved], axis=1))


def _squares(kernel: Tensor, weights: Tensor) -> Array:
    """Return the squared lengths (1 + P,) of sums of features with weights (N, 1 + P)."""
    blocks = torch.split(weights, BLOCK_LABELS, dim=1)
    return torch.cat([(block * (kernel @ block)).sum(dim=0) for block in blocks]).numpy()


def _pair_sums(kernel: Tensor, labels: Tensor) -> Array:
    """Return sums (3, 1 + P) over pairs within the first, within the second, and between."""
    rows = kernel.sum(dim=1)
    parts = [
        torch.stack([(block * (kernel @ block)).sum(dim=0), rows @ block])
        for block in torch.split(labels, BLOCK_LABELS, dim=1)
    ]
    within, touching = torch.cat(parts, dim=1).numpy()
    between = touching - within
    return np.stack([within, float(rows.sum()) - touching - between, between])
