"""Comparisons of two data sets: whether they come from one density, and how far apart they are."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, TypeVar

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize_scalar
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.comparing.resampling import Groups, TestResult, mmd_test, resampled_sums
from orbiflow.density.comparing.settings import ComparisonSettings
from orbiflow.density.data import TableRows, alongside, cells_of, group_numbers
from orbiflow.density.fitting import DensitySettings, Progress, fit_automatic
from orbiflow.density.spaces import DataColumns, Space
from orbiflow.errors import DataWarning, OrbiflowError, SettingError, literal
from orbiflow.settings import is_a

T = TypeVar("T")

UNWEIGHTED = (
    "{columns} declares a weight, and tests of data sets count all rows alike: declare it as ignore, "
    "or as count if it says how often a row was seen"
)
"""Why weights are refused, which would count for nothing."""


@dataclass(frozen=True)
class Estimate:
    """A value, its standard error and the bootstrap interval."""

    value: float
    error: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:z.4f} ± {self.error:z.4f} ({self.low:z.4f} to {self.high:z.4f})"


@dataclass(frozen=True)
class Divergence:
    """How far apart two densities are, judged by held-out rows.

    - `accuracy`: How often an observer who is shown one row, of either data set with even chances,
      names its data set; 0.5 is chance.
    - `jensen_shannon`: The divergence in nats, from 0 (the same) to log 2 (never the same place). It is
      a lower bound on average, whatever the fits are, so that it may fall below 0.
    - `first_to_second`, `second_to_first`: Estimates of the Kullback-Leibler divergences in nats.
    """

    accuracy: Estimate
    jensen_shannon: Estimate
    first_to_second: Estimate
    second_to_first: Estimate


@dataclass(frozen=True)
class DataComparison:
    """Two data sets on one space.

    - `names`, `rows`: Names and numbers of rows of both.
    - `groups`: Number of groups of both together, None if rows are independent.
    - `test`: The test whether they come from one density. `level`: Its level.
    - `divergence`: How far apart they are, None if they have too few rows.
    - `resamples`, `seed`: The settings of the intervals.
    - `notes`: What the user should know, in words.
    """

    names: tuple[str, str]
    rows: tuple[int, int]
    groups: int | None
    test: TestResult
    divergence: Divergence | None
    level: float
    resamples: int
    seed: int
    notes: tuple[str, ...] = ()

    @property
    def differ(self) -> bool:
        """Whether the densities differ, as far as the data can tell."""
        return self.test.p <= 1 - self.level

    @property
    def verdict(self) -> str:
        """The result in words."""
        one, other = self.names
        if self.differ:
            return f"{one} and {other} come from different densities (p {self.test.p:.2g})"
        return (
            f"the data cannot tell the densities of {one} and {other} apart (p {self.test.p:.2g})"
        )

    def words(self) -> list[str]:
        """Return the result in lines of text."""
        found, names = self.divergence, self.names
        lines = [self.verdict]
        if found is not None:
            lines += [
                f"shown one row, an observer names its data set in {found.accuracy.value:.1%} of cases "
                f"({found.accuracy.low:.1%} to {found.accuracy.high:.1%}; 50% is chance)",
                f"Jensen-Shannon divergence at least {found.jensen_shannon} nats of 0.6931",
                f"Kullback-Leibler divergence, estimated: {names[0]} from {names[1]} "
                f"{found.first_to_second}, the other way {found.second_to_first} nats",
            ]
        return lines

    def to_json(self) -> dict[str, Any]:
        """Return an object for `json.dumps`."""
        return {"kind": "data", **asdict(self), "differ": self.differ, "verdict": self.verdict}


def compare_samples(
    samples: Mapping[str, ArrayLike],
    space: str | Space = "torus",
    settings: ComparisonSettings | None = None,
    *,
    columns: Any = None,
    unit: str | None = None,
    groups: Mapping[str, ArrayLike] | None = None,
    progress: Progress = lambda _share, _what: None,
) -> DataComparison:
    """Test whether two data sets come from one density, and measure how far apart they are.

    The test is `mmd_test`, the divergences, if settings ask for them, are `cross_fitted`.

    Args:
        samples: Two data sets (N, k) by their names, in the space's own units.
        space: The space, as `DensityEstimator` takes it.
        settings: Permutations of the test, level, resamples and seed.
        columns: What the columns are, as `DensityEstimator` takes it.
        unit: Unit of angles that name none.
        groups: A label for each row, by the same names; equal labels in both data sets are one group.
            Whole groups are permuted, held out and resampled.
        progress: A function that is called with the share of the work done, and what is being done.

    Raises:
        OrbiflowError: If there are not two data sets, data are not on the space, there is another
            number of labels than rows, or there are fewer than five rows or groups.

    >>> rng = np.random.default_rng(0)
    >>> one, other = rng.vonmises(0, 2, (80, 2)), rng.vonmises(0.7, 2, (90, 2))
    >>> compare_samples({"a": one, "b": other}).differ
    True
    """
    settings = settings or ComparisonSettings()
    seed = settings.seed
    if not is_a(samples, Mapping) or len(samples) != 2:
        raise OrbiflowError("give two data sets by their names, such as {'before': a, 'after': b}")
    known = DataColumns(space, unit, columns, seed)
    own, names, _, both, groups = sample_points(samples, known, groups)
    sizes, points = (len(both[0]), len(both[1])), torch.cat(both)
    first = np.arange(len(points)) < sizes[0]
    members = Groups.of(None if groups is None else labels_of(groups, samples, sizes), len(points))
    members.require()
    notes = members.notes()
    progress(0.0, "permuting")
    drawn: dict[str, Any] = {"permutations": settings.permutations, "level": settings.level}
    test = mmd_test(own, points, first, members, **drawn, seed=seed)
    if not test.exact:
        notes.append("p is approximate, as groups have different numbers of rows in the data sets")
    if test.rows < len(points):
        notes.append(f"the test looks at {test.rows} of {len(points)} rows, drawn at random")
    divergence = None
    if settings.divergence:
        try:
            told: Progress = lambda share, what: progress(0.3 + 0.7 * share, what)  # noqa: E731
            divergence = cross_fitted(own, points, first, members, settings, told)
        except OrbiflowError as error:
            notes.append(f"how far apart they are was not estimated: {error}")
    groups_in_all = members.count if members.given else None
    found = (sizes, groups_in_all, test, divergence, settings.level, settings.bootstrap, seed)
    return DataComparison((names[0], names[1]), *found, tuple(notes))


def sample_points(
    samples: Mapping[str, ArrayLike], columns: DataColumns, groups: Mapping[str, ArrayLike] | None
) -> tuple[Space, list[str], tuple[str, ...], list[Tensor], Mapping[str, ArrayLike] | None]:
    """Return the space of data sets, their names, those of their columns, chart points and groups.

    The groups are those given, or those of a column that is declared as such. Raises `OrbiflowError` if
    there are not two data sets or more by their names, with the same columns, and for weights.
    """
    if not is_a(samples, Mapping) or len(samples) < 2:
        raise OrbiflowError(
            "give two data sets or more by their names, such as {'before': a, 'after': b}"
        )
    names = list(samples)

    def read(table: Any) -> TableRows:
        return columns.read(table, stacklevel=7)

    found = [_named(own, read, table) for own, table in samples.items()]
    first = found[0]
    if first.weights is not None:
        raise SettingError(UNWEIGHTED)
    if first.labels is not None:
        if groups is not None:
            raise OrbiflowError(
                "a column is declared as group, and groups are given: leave one out"
            )
        pairs = zip(names, found, strict=True)
        groups = {name: rows.labels for name, rows in pairs if rows.labels is not None}
    for k, other in enumerate(found):
        if other.values.shape[1] != first.values.shape[1]:
            widths = " and ".join(str(rows.values.shape[1]) for rows in found)
            raise OrbiflowError(f"the data sets have {widths} columns: give all in one form")
        if list(map(str, other.roles)) != list(map(str, first.roles)):
            raise OrbiflowError(
                f"{names[0]} has {first.declaration}, and {names[k]} {other.declaration}: declare the "
                "same columns"
            )
        same = sorted(first.columns) == sorted(other.columns) and other.source.is_named
        if same and first.columns != other.columns:
            order = [other.columns.index(column) for column in first.columns]
            found[k] = replace(other, values=other.values[:, order], columns=first.columns)
    values = np.concatenate([rows.values for rows in found])
    every = replace(first, numbers=np.zeros(len(values), dtype=np.int64), values=values)
    try:
        known = columns.of(every)
    except OrbiflowError:
        # the number of a row in both tables together would lead nowhere
        for name, rows in zip(names, found, strict=True):
            _named(name, columns.of, rows)
        raise
    points = [
        _named(own, known.to_chart, rows.values) for own, rows in zip(names, found, strict=True)
    ]
    called = first.columns if first.source.is_named else known.columns
    return known, names, called, points, groups


def _named(name: str, call: Callable[[Any], T], table: Any) -> T:
    """Call a function with a data set, and let its errors say which one it was."""
    try:
        return call(table)
    except SettingError as error:
        raise SettingError(literal(f"{name}: ") + error.template) from error
    except OrbiflowError as error:
        raise OrbiflowError(f"{name}: {error}") from error


def labels_of(
    groups: Mapping[str, ArrayLike], samples: Mapping[str, ArrayLike], sizes: Sequence[int]
) -> NDArray[np.str_]:
    """Return the labels (N,) of the rows of several data sets, one after the other."""
    if not is_a(groups, Mapping) or set(groups) != set(samples):
        raise OrbiflowError(f"groups must have labels for {' and '.join(samples)}, by these names")
    found: list[NDArray[np.str_]] = []
    for (name, sample), rows in zip(samples.items(), sizes, strict=True):
        _, labels = alongside(**{name: sample, "groups": groups[name]})
        own = np.asarray(cells_of(labels))
        group_numbers(own, rows, f"groups of {name}")  # which checks them
        found.append(own.astype(str))
    return np.concatenate(found)


def cross_fitted(
    space: Space,
    points: Tensor,
    first: Array,
    groups: Groups,
    settings: ComparisonSettings,
    progress: Progress,
) -> Divergence:
    """Fit a density to half of each data set, score the other halves, and swap the halves.

    With p and q fitted to the first and second, the log of the odds p / (p + q) at held-out rows has
    the mean of a lower bound on the Jensen-Shannon divergence (as of any classifier: Goodfellow and
    others, Generative adversarial nets, 2014, section 4). The log odds of either half are multiplied by
    what suits the other half best. Whole groups are held out, and resampled.

    `points` are chart points (N, d) of both data sets; `first` says which (N,) are of the first one.
    """
    seed, level = settings.seed, settings.level
    half = np.random.default_rng(seed).permutation(groups.count)[groups.index] % 2
    ratio = _held_out_ratio(space, points, first, half, seed, progress)
    own = np.where(first, ratio, -ratio)
    counts: tuple[float, float] = first.sum(), (~first).sum()
    weights = np.where(first, 1 / counts[0], 1 / counts[1])
    tempered = np.empty(len(own))
    for number in (0, 1):
        tempered[half == number] = own[half == number] * _trust(own, weights * (half != number))
    shares = np.stack(
        [
            np.ones(len(own)),
            (own > 0) + (own == 0) / 2,
            math.log(2) - np.logaddexp(0.0, -tempered),
            own,
        ],
        axis=1,
    )
    table = np.concatenate(
        [groups.sums(shares * first[:, None]), groups.sums(shares * ~first[:, None])], axis=1
    )
    drawn = resampled_sums(table, settings.bootstrap, np.random.default_rng(seed))
    drawn = drawn[(drawn[:, 0] > 0) & (drawn[:, 4] > 0)]
    found, spread = _figures(table.sum(axis=0)[None])[0], _figures(drawn)
    ends = np.quantile(spread, [(1 - level) / 2, (1 + level) / 2], axis=0)
    figures = np.stack([found, spread.std(axis=0), *ends], axis=1).tolist()
    return Divergence(*(Estimate(*row) for row in figures))


def _figures(sums: Array) -> Array:
    """Return accuracy, Jensen-Shannon divergence and both divergences (B, 4) from sums (B, 8)."""
    one, other = sums[:, 1:4] / sums[:, :1], sums[:, 5:] / sums[:, 4:5]
    even = (one[:, :2] + other[:, :2]) / 2
    return np.concatenate([even, one[:, 2:], other[:, 2:]], axis=1)


def _held_out_ratio(
    space: Space, points: Tensor, first: Array, half: Array, seed: int, progress: Progress
) -> Array:
    """Return log p - log q (N,) at each row, of fits to the other half."""
    ratio = np.empty(len(points))
    for number in (0, 1):
        held = half == number
        scores: list[Tensor] = []
        for which, rows in enumerate((first, ~first)):
            progress((2 * number + which) / 4, "fitting halves")
            train = points[torch.as_tensor(rows & ~held)]
            try:
                # kernels are fitted in a second or so
                settings = DensitySettings(components=("kernels",), seed=seed)
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", DataWarning)  # of halves that nobody asked for
                    density, _ = fit_automatic(space, train, settings)
            except OrbiflowError as error:
                raise OrbiflowError(f"half of a data set is too small to fit: {error}") from error
            with torch.no_grad():
                scores.append(density.log_prob(points[torch.as_tensor(held)]))
        ratio[held] = (scores[0] - scores[1]).numpy()
    return ratio


def _trust(own: Array, weights: Array) -> float:
    """Return the factor of log odds with which they score best: few rows make them too bold."""

    def loss(trust: float) -> float:
        return float((weights * np.logaddexp(0.0, -trust * own)).sum())

    found: Any = minimize_scalar(loss, bounds=(0.0, 2.0), method="bounded")
    return float(found.x)
