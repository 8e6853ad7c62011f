"""Comparisons of two data sets: whether they come from one density, and how far apart they are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, TypeVar

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

from orbiflow.arguments import as_array, is_a
from orbiflow.density.arguments import silent
from orbiflow.density.comparing.divergence import Divergence, cross_fitted
from orbiflow.density.comparing.resampling import Groups
from orbiflow.density.comparing.settings import ComparisonSettings
from orbiflow.density.comparing.two_samples import MAX_ROWS, TestResult, chosen_rows, mmd_test
from orbiflow.density.fitting import Progress
from orbiflow.density.spaces import Space, space_class
from orbiflow.errors import OrbiflowError

T = TypeVar("T")


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
    unit: str = "radians",
    groups: Mapping[str, ArrayLike] | None = None,
    progress: Progress = silent,
) -> DataComparison:
    """Test whether two data sets come from one density, and measure how far apart they are.

    The test is `mmd_test`, on `MAX_ROWS` rows at most; the divergences are `cross_fitted`.

    Args:
        samples: Two data sets (N, k) by their names, in the space's own units.
        space: The space, as `DensityEstimator` takes it.
        settings: Permutations of the test, level, resamples and seed.
        unit: Unit of angles, as `DensityEstimator` takes it.
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
    names, tables = _two(samples)
    settings = settings or ComparisonSettings()
    seed = settings.seed
    own = space if isinstance(space, Space) else _space_of(space, names, tables, unit, seed)
    points = torch.cat(
        [_named(name, own.to_chart, table) for name, table in zip(names, tables, strict=True)]
    )
    first = np.arange(len(points)) < len(tables[0])
    members = Groups.of(_labels(groups, names, tables), len(points))
    members.require()
    notes = members.notes()
    _require_movable(members, first)
    kept = chosen_rows(first, members, MAX_ROWS, seed)
    if len(kept) < len(points):
        notes.append(f"the test looks at {len(kept)} of {len(points)} rows, drawn at random")
    progress(0.0, "permuting")
    test = mmd_test(
        own,
        points[torch.as_tensor(kept)],
        first[kept],
        Groups.of(members.index[kept] if members.given else None, len(kept)),
        permutations=settings.permutations,
        seed=seed,
    )
    divergence = None
    try:
        divergence = cross_fitted(
            own,
            points,
            first,
            members,
            settings,
            progress=lambda share, what: progress(0.3 + 0.7 * share, what),
        )
    except OrbiflowError as error:
        notes.append(f"how far apart they are was not estimated: {error}")
    return DataComparison(
        (names[0], names[1]),
        (len(tables[0]), len(tables[1])),
        members.count if members.given else None,
        test,
        divergence,
        settings.level,
        settings.bootstrap,
        seed,
        tuple(notes),
    )


def _two(samples: Mapping[str, ArrayLike]) -> tuple[list[str], list[np.ndarray]]:
    if not is_a(samples, Mapping) or len(samples) != 2:
        raise OrbiflowError("give two data sets by their names, such as {'before': a, 'after': b}")
    tables = [as_array(table, f"data set {name}", ("N", "k")) for name, table in samples.items()]
    widths = [table.shape[1] for table in tables]
    if widths[0] != widths[1]:
        raise OrbiflowError(
            f"the data sets have {widths[0]} and {widths[1]} columns: give both in one form"
        )
    if not all(len(table) for table in tables):
        raise OrbiflowError("a data set has no rows")
    return list(samples), tables


def _space_of(
    space: str, names: list[str], tables: list[np.ndarray], unit: str, seed: int
) -> Space:
    """Return the space that suits both data sets."""
    kind = space_class(space)
    try:
        return kind.for_data(np.concatenate(tables), unit=unit, seed=seed)
    except OrbiflowError:
        # the number of a row in both tables together would lead nowhere
        for name, table in zip(names, tables, strict=True):
            _named(name, lambda own: kind.for_data(own, unit=unit, seed=seed), table)
        raise


def _named(name: str, call: Callable[[np.ndarray], T], table: np.ndarray) -> T:
    """Call a function with a data set, and let its errors say which one it was."""
    try:
        return call(table)
    except OrbiflowError as error:
        raise OrbiflowError(f"{name}: {error}") from error


def _labels(
    groups: Mapping[str, ArrayLike] | None, names: list[str], tables: list[np.ndarray]
) -> np.ndarray | None:
    if groups is None:
        return None
    if not is_a(groups, Mapping) or set(groups) != set(names):
        raise OrbiflowError(
            f"groups must have labels for {names[0]} and {names[1]}, by these names"
        )
    found: list[NDArray[np.str_]] = []
    for name, table in zip(names, tables, strict=True):
        labels = np.asarray(groups[name])
        if labels.shape != (len(table),):
            raise OrbiflowError(
                f"groups of {name}: expected a label for each of {len(table)} rows, got shape "
                f"{labels.shape}"
            )
        found.append(labels.astype(str))
    return np.concatenate(found)


def _require_movable(groups: Groups, first: np.ndarray) -> None:
    """Check that enough groups can change sides to tell a difference from chance."""
    own = np.bincount(groups.index, first, groups.count) > 0
    other = np.bincount(groups.index, ~first, groups.count) > 0
    both, one, two = (own & other).sum(), (own & ~other).sum(), (other & ~own).sum()
    if both < 5 and (one < 3 or two < 3):
        raise OrbiflowError(
            f"the data sets have {one} and {two} {groups.what} of their own and {both} in common: too "
            "few to tell a difference from chance"
        )
