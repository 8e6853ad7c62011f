"""Two data sets: do they come from one density, and how far apart are they?"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, TypeVar

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

from orbiflow.arguments import (
    is_a,
    number,
    numbers,
    whole,
)
from orbiflow.density.arguments import silent
from orbiflow.density.comparing.divergence import Divergence, cross_fitted
from orbiflow.density.comparing.paired import (
    LEVEL,
    MOST_RESAMPLES,
    RESAMPLES,
)
from orbiflow.density.comparing.resampling import Groups
from orbiflow.density.comparing.two_samples import (
    MOST_ROWS,
    PERMUTATIONS,
    TestResult,
    chosen_rows,
    mmd_test,
)
from orbiflow.density.fitting import Progress
from orbiflow.density.spaces import Space, space_class
from orbiflow.errors import OrbiflowError

MOST_PERMUTATIONS = 100_000

T = TypeVar("T")


@dataclass(frozen=True)
class DataComparison:
    """Two data sets on one space.

    - `names`, `rows`: of both. `groups`: of both together, None if rows are independent.
    - `test`: whether they come from one density. `differ`: what it says at this `level`.
    - `divergence`: how far apart they are; None if they have too few rows.
    - `resamples`, `seed`: of the intervals.
    - `notes`: what the user should know, in words.
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
        """What came of it, in words."""
        one, other = self.names
        if self.differ:
            return f"{one} and {other} come from different densities (p {self.test.p:.2g})"
        return (
            f"the data cannot tell the densities of {one} and {other} apart (p {self.test.p:.2g})"
        )

    def words(self) -> list[str]:
        """All of it, a line each."""
        found, names = self.divergence, self.names
        lines = [self.verdict]
        if found is not None:
            lines += [
                f"told one row, an observer names its data set in {found.accuracy.value:.1%} of cases "
                f"({found.accuracy.low:.1%} to {found.accuracy.high:.1%}; 50% is chance)",
                f"Jensen-Shannon divergence at least {found.jensen_shannon} nats of 0.6931",
                f"Kullback-Leibler divergence, estimated: {names[0]} from {names[1]} "
                f"{found.first_to_second}, the other way {found.second_to_first} nats",
            ]
        return lines

    def to_json(self) -> dict[str, Any]:
        """An object for `json.dumps`."""
        return {"kind": "data", **asdict(self), "differ": self.differ, "verdict": self.verdict}


def compare_samples(
    samples: Mapping[str, ArrayLike],
    space: str | Space = "torus",
    *,
    unit: str = "radians",
    groups: Mapping[str, ArrayLike] | None = None,
    permutations: int = PERMUTATIONS,
    resamples: int = RESAMPLES,
    level: float = LEVEL,
    seed: int = 0,
    progress: Progress = silent,
) -> DataComparison:
    """Test whether two data sets come from one density, and measure how far apart they are.

    The test is `mmd_test`, on `MOST_ROWS` rows at most; the divergences are `cross_fitted`.

    Args:
        samples: two data sets (N, k) by their names, in the space's own units.
        space, unit: as `DensityEstimator` takes them.
        groups: a label (N,) a row, by the same names; equal labels in both data sets are one group.
            Permuted, held out and resampled are whole groups.
        permutations: of the test; the least p is 1 / (permutations + 1).
        resamples, level: of the intervals. `level` is that of the test, too.
        seed: of all that is drawn.

    Raises:
        OrbiflowError: for other than two data sets, data that are not of the space, labels of another
            number, or fewer than five rows or groups.

    >>> rng = np.random.default_rng(0)
    >>> one, other = rng.vonmises(0, 2, (80, 2)), rng.vonmises(0.7, 2, (90, 2))
    >>> compare_samples({"a": one, "b": other}).differ
    True
    """
    names, tables = _two(samples)
    whole(permutations, "permutations", 19, MOST_PERMUTATIONS)
    whole(resamples, "resamples", 100, MOST_RESAMPLES)
    level = number(level, "level", 0.5, 0.999)
    own = space if isinstance(space, Space) else _space_of(space, names, tables, unit, seed)
    points = torch.cat(
        [_named(name, own.to_chart, table) for name, table in zip(names, tables, strict=True)]
    )
    first = np.arange(len(points)) < len(tables[0])
    members = Groups.of(_labels(groups, names, tables), len(points))
    members.require()
    notes = members.notes()
    _require_movable(members, first)
    kept = chosen_rows(first, members, MOST_ROWS, seed)
    if len(kept) < len(points):
        notes.append(f"the test looks at {len(kept)} of {len(points)} rows, drawn at random")
    progress(0.0, "permuting")
    test = mmd_test(
        own,
        points[torch.as_tensor(kept)],
        first[kept],
        Groups.of(members.index[kept] if members.given else None, len(kept)),
        permutations=permutations,
        seed=seed,
    )
    divergence = None
    try:
        divergence = cross_fitted(
            own, points, first, members, resamples=resamples, level=level, seed=seed,
            progress=lambda share, what: progress(0.3 + 0.7 * share, what),
        )  # fmt: skip
    except OrbiflowError as error:
        notes.append(f"how far apart they are was not estimated: {error}")
    return DataComparison(
        (names[0], names[1]),
        (len(tables[0]), len(tables[1])),
        members.count if members.given else None,
        test,
        divergence,
        level,
        resamples,
        seed,
        tuple(notes),
    )


def _two(samples: Mapping[str, ArrayLike]) -> tuple[list[str], list[np.ndarray]]:
    if not is_a(samples, Mapping) or len(samples) != 2:
        raise OrbiflowError("give two data sets by their names, such as {'before': a, 'after': b}")
    tables = [numbers(table, f"data set {name}", ("N", "k")) for name, table in samples.items()]
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
    """That suits both data sets."""
    kind = space_class(space)
    try:
        return kind.for_data(np.concatenate(tables), unit=unit, seed=seed)
    except OrbiflowError:
        # a row by its number in both would be looked for in vain
        for name, table in zip(names, tables, strict=True):
            _named(name, lambda own: kind.for_data(own, unit=unit, seed=seed), table)
        raise


def _named(name: str, call: Callable[[np.ndarray], T], table: np.ndarray) -> T:
    """What is called with a data set, whose errors say which one it is."""
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
    """
    Raises:
        OrbiflowError: if too few groups can change sides to tell a difference from chance.
    """
    own = np.bincount(groups.index, first, groups.count) > 0
    other = np.bincount(groups.index, ~first, groups.count) > 0
    both, one, two = (own & other).sum(), (own & ~other).sum(), (other & ~own).sum()
    if both < 5 and (one < 3 or two < 3):
        raise OrbiflowError(
            f"the data sets have {one} and {two} {groups.what} of their own and {both} in common: too "
            "few to tell a difference from chance"
        )
