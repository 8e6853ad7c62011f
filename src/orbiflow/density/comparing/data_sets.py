"""Comparisons of two data sets: whether they come from one density, and how far apart they are."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple, TypeVar

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize_scalar
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.comparing.resampling import Groups, TestResult, mmd_test, resampled_sums
from orbiflow.density.comparing.settings import ComparisonSettings, DataComparisonSettings
from orbiflow.density.data import TableRows, alongside, cells_of, group_numbers
from orbiflow.density.fitting import DensitySettings, Progress, fit_automatic
from orbiflow.density.spaces import DataColumns, Space
from orbiflow.errors import DataWarning, OrbiflowError, SettingError, literal
from orbiflow.runtime import Answer
from orbiflow.settings import is_a

T = TypeVar("T")

UNWEIGHTED = (
    "{columns} declares a weight, and tests of data sets count all rows alike: declare it as ignore, "
    "or as count if it says how often a row was seen"
)
"""Why weights are refused, which would count for nothing."""


@dataclass(frozen=True)
class ResampledFigure:
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

    accuracy: ResampledFigure
    jensen_shannon: ResampledFigure
    first_to_second: ResampledFigure
    second_to_first: ResampledFigure


@dataclass(frozen=True)
class DataComparison(Answer):
    """Two data sets on one space.

    - `names`, `rows`: Names and numbers of rows of both.
    - `groups`: Number of groups of both together, None if rows are independent.
    - `test`: The test whether they come from one density. `level`: Its level.
    - `divergence`: How far apart they are, None if nobody asked or they have too few rows.
    - `resamples`, `seed`: The settings of the intervals.
    - `notes`: What the user should know, in words.
    """

    kind = "data"

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
        first, second = self.names
        if self.differ:
            return f"{first} and {second} come from different densities (p {self.test.p:.2g})"
        return f"the data cannot tell the densities of {first} and {second} apart (p {self.test.p:.2g})"

    def table(self) -> list[dict[str, Any]]:
        """Return a row for p and for each measure of how far apart they are."""
        p = {"value": self.test.p, "error": None, "low": None, "high": None}
        figures = {"p": p} | (asdict(self.divergence) if self.divergence else {})
        return [{"figure": name, **figure} for name, figure in figures.items()]

    def words(self) -> list[str]:
        """Return the result and its notes in lines of text."""
        lines = [self.verdict]
        if (apart := self.divergence) is not None:
            lines += [
                f"shown one row, an observer names its data set in {apart.accuracy.value:.1%} of cases "
                f"({apart.accuracy.low:.1%} to {apart.accuracy.high:.1%}; 50% is chance)",
                f"Jensen-Shannon divergence at least {apart.jensen_shannon} nats of 0.6931",
                f"Kullback-Leibler divergence, estimated: {self.names[0]} from {self.names[1]} "
                f"{apart.first_to_second}, the other way {apart.second_to_first} nats",
            ]
        return [*lines, *self.notes]


def compare_samples(
    samples: Mapping[str, ArrayLike | TableRows],
    space: str | Space = "torus",
    settings: DataComparisonSettings | None = None,
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
    settings = settings or DataComparisonSettings()
    if not is_a(samples, Mapping) or len(samples) != 2:
        raise OrbiflowError("give two data sets by their names, such as {'before': a, 'after': b}")
    both = Samples.of(samples, DataColumns(space, unit, columns, settings.seed), groups)
    points, first = torch.cat(both.points), both.labels == 0
    members = Groups.of(both.groups, len(points))
    members.require()
    notes = members.notes()
    progress(0.0, "permuting")
    test = mmd_test(
        both.space, points, first, members,
        permutations=settings.permutations, level=settings.level, seed=settings.seed,
    )  # fmt: skip
    if not test.exact:
        notes.append("p is approximate, as groups have different numbers of rows in the data sets")
    if test.rows < len(points):
        notes.append(f"the test looks at {test.rows} of {len(points)} rows, drawn at random")
    divergence = None
    if settings.divergence:
        try:
            rest: Progress = lambda share, what: progress(0.3 + 0.7 * share, what)  # noqa: E731
            divergence = cross_fitted(both.space, points, first, members, settings, rest)
        except OrbiflowError as error:
            notes.append(f"how far apart they are was not estimated: {error}")
    return DataComparison(
        (both.names[0], both.names[1]),
        (len(both.points[0]), len(both.points[1])),
        members.count if members.given else None,
        test,
        divergence,
        settings.level,
        settings.bootstrap,
        settings.seed,
        tuple(notes),
    )


class Samples(NamedTuple):
    """Data sets on one space.

    - `names`: The names of the data sets, `columns`: those of their columns.
    - `points`: The chart points (n, d) of each.
    - `groups`: What each row (N,) of all of them belongs to, None if rows are independent.
    """

    space: Space
    names: list[str]
    columns: tuple[str, ...]
    points: list[Tensor]
    groups: NDArray[np.str_] | None

    @property
    def labels(self) -> NDArray[np.int64]:
        """The number (N,), from 0, of each row's data set."""
        return np.repeat(np.arange(len(self.points)), [len(each) for each in self.points])

    @classmethod
    def of(
        cls,
        samples: Mapping[str, ArrayLike | TableRows],
        columns: DataColumns,
        groups: Mapping[str, ArrayLike] | None,
    ) -> Samples:
        """Return data sets by their names, which must have the same columns, in any order.

        The groups are those given, or those of a column that is declared as such. Raises
        `OrbiflowError` for one data set alone, other columns, and weights.
        """
        if not is_a(samples, Mapping) or len(samples) < 2:
            raise OrbiflowError(
                "give two data sets or more by their names, such as {'before': a, 'after': b}"
            )

        def read(table: Any) -> TableRows:
            return table if isinstance(table, TableRows) else columns.read(table, stacklevel=7)

        tables = {name: _named(name, read, table) for name, table in samples.items()}
        labels = _labels(groups, samples, tables)
        first_name, first = next(iter(tables.items()))
        if first.weights is not None:
            raise SettingError(UNWEIGHTED)
        for name, table in tables.items():
            tables[name] = _arranged(table, first, (first_name, name))
        values = np.concatenate([table.values for table in tables.values()])
        numbers = np.zeros(len(values), dtype=np.int64)
        every = replace(first, numbers=numbers, values=values, weights=None, labels=None, given={})
        try:
            space = columns.of(every)
        except OrbiflowError:
            # the number of a row in all tables together would lead nowhere
            for name, table in tables.items():
                _named(name, columns.of, table)
            raise
        points = [_named(name, space.to_chart, table.values) for name, table in tables.items()]
        called = first.columns if first.source.is_named else space.columns
        return cls(space, list(tables), called, points, labels)


def _arranged(table: TableRows, first: TableRows, names: tuple[str, str]) -> TableRows:
    """Return rows with their columns in the order of those of the first data set."""

    def refusal(columns: str, others: str) -> SettingError:
        words = literal(f"{names[0]} has {columns}, and {names[1]} {others}: ")
        return SettingError(words + "specify with {columns} which to compare")

    if list(map(str, table.roles)) != list(map(str, first.roles)):
        raise refusal(first.declaration, table.declaration)
    if not (table.source.is_named and first.source.is_named) or table.columns == first.columns:
        return table
    if sorted(table.columns) == sorted(first.columns):
        order = [table.columns.index(column) for column in first.columns]
        return replace(table, values=table.values[:, order], columns=first.columns)
    if not first.own:  # columns of a torus are what their names say
        raise refusal(", ".join(first.columns), ", ".join(table.columns))
    return table


def _named(name: str, call: Callable[[Any], T], table: Any) -> T:
    """Call a function with a data set, and let its errors say which one it was."""
    try:
        return call(table)
    except SettingError as error:
        raise SettingError(literal(f"{name}: ") + error.template) from error
    except OrbiflowError as error:
        raise OrbiflowError(f"{name}: {error}") from error


def _labels(
    groups: Mapping[str, ArrayLike] | None,
    samples: Mapping[str, Any],
    tables: Mapping[str, TableRows],
) -> NDArray[np.str_] | None:
    """Return the labels (N,) of the rows of several data sets, one after the other."""
    labels = {name: table.labels for name, table in tables.items() if table.labels is not None}
    if labels and groups is not None:
        raise OrbiflowError("a column is declared as group, and groups are given: leave one out")
    if groups is None:
        return np.concatenate(list(labels.values())) if labels else None
    if not is_a(groups, Mapping) or set(groups) != set(samples):
        raise OrbiflowError(f"groups must have labels for {' and '.join(samples)}, by these names")
    parts: list[NDArray[np.str_]] = []
    for name, sample in samples.items():
        _, beside = alongside(**{name: sample, "groups": groups[name]})
        cells = np.asarray(cells_of(beside))
        group_numbers(cells, len(tables[name].values), f"groups of {name}")  # which checks them
        parts.append(cells.astype(str))
    return np.concatenate(parts)


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
    odds = np.where(first, ratio, -ratio)
    counts: tuple[float, float] = first.sum(), (~first).sum()
    weights = np.where(first, 1 / counts[0], 1 / counts[1])
    tempered = np.empty(len(odds))
    for number in (0, 1):
        tempered[half == number] = odds[half == number] * _trust(odds, weights * (half != number))
    shares = np.stack(
        [
            np.ones(len(odds)),
            (odds > 0) + (odds == 0) / 2,
            math.log(2) - np.logaddexp(0.0, -tempered),
            odds,
        ],
        axis=1,
    )
    table = np.concatenate(
        [groups.sums(shares * first[:, None]), groups.sums(shares * ~first[:, None])], axis=1
    )
    drawn = resampled_sums(table, settings.bootstrap, np.random.default_rng(seed))
    drawn = drawn[(drawn[:, 0] > 0) & (drawn[:, 4] > 0)]
    figures, spread = _figures(table.sum(axis=0)[None])[0], _figures(drawn)
    ends = np.quantile(spread, [(1 - level) / 2, (1 + level) / 2], axis=0)
    rows = np.stack([figures, spread.std(axis=0), *ends], axis=1).tolist()
    return Divergence(*(ResampledFigure(*row) for row in rows))


def _figures(sums: Array) -> Array:
    """Return accuracy, Jensen-Shannon divergence and both divergences (B, 4) from sums (B, 8)."""
    first, other = sums[:, 1:4] / sums[:, :1], sums[:, 5:] / sums[:, 4:5]
    even = (first[:, :2] + other[:, :2]) / 2
    return np.concatenate([even, first[:, 2:], other[:, 2:]], axis=1)


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


def _trust(odds: Array, weights: Array) -> float:
    """Return the factor of log odds with which they score best: few rows make them too bold."""

    def loss(trust: float) -> float:
        return float((weights * np.logaddexp(0.0, -trust * odds)).sum())

    best: Any = minimize_scalar(loss, bounds=(0.0, 2.0), method="bounded")
    return float(best.x)
