"""Tests by name of two or more samples: equal means, concentrations, distributions."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

from orbiflow.arrays import Array
from orbiflow.density.comparing import statistics
from orbiflow.density.comparing.data_sets import Samples
from orbiflow.density.comparing.resampling import MAX_ROWS
from orbiflow.density.comparing.settings import NamedTestSettings
from orbiflow.density.comparing.statistics import Labels, TestStatistic
from orbiflow.density.data import TableRows
from orbiflow.density.fitting import highest_log_likelihood
from orbiflow.density.models import images_of
from orbiflow.density.spaces import DataColumns, Space
from orbiflow.errors import OrbiflowError, SettingError, literal
from orbiflow.runtime import Answer, Event, Table, p_in_words

MIN_SAMPLE = 5
"""Rows that each sample must have."""

MOST_UNLIKE = 1.5
"""Ratio of mean sizes of groups in two samples from which permutations of groups are in doubt."""

MIN_LARGE, MIN_MEDIAN = 25, 10
"""Rows of each sample from which tests for large samples, and that of medians, are good."""


@dataclass(frozen=True)
class NamedTest:
    """A test of several samples.

    - `name`: Its name. `column`: The column of angles that it is about; empty for all together.
    - `statistic`, `degrees`: The statistic and its degrees of freedom.
    - `p`: The probability of so large a statistic if there is no difference. `by`: What p is from.
    - `hypothesis`: What is the same if there is no difference. `assumes`: What else must hold.
    - `reference`: Where the test is from. `doubt`: Why p may be wrong here, if it may.
    """

    __test__ = False  # pytest would take it for a test

    name: str
    column: str
    statistic: float
    degrees: tuple[float, ...]
    p: float
    by: str
    hypothesis: str
    assumes: str
    reference: str
    doubt: str = ""


@dataclass(frozen=True)
class SampleTests(Answer):
    """Tests by name of several samples.

    - `names`, `rows`: The samples, and how many rows each has. `tests`: The results.
    - `permutations`, `seed`: Of p by permutation. `notes`: What the user should know.
    """

    names: tuple[str, ...]
    rows: tuple[int, ...]
    tests: tuple[NamedTest, ...]
    permutations: int
    seed: int
    notes: tuple[str, ...] = ()

    kind = "tests"

    def __getitem__(self, name: str) -> NamedTest:
        """Return the first test of a name, such as "watson-williams"."""
        for test in self.tests:
            if test.name == name:
                return test
        raise KeyError(f"{name}; there are {', '.join(test.name for test in self.tests)}")

    def table(self) -> list[dict[str, Any]]:
        """Return a row for each test."""
        rows = map(asdict, self.tests)
        return [{**row, "degrees": " ".join(f"{k:g}" for k in row["degrees"])} for row in rows]

    def words(self) -> list[str | Event]:
        """Return the tests, what they are about, and the notes."""
        samples = zip(self.names, self.rows, strict=True)
        listed = ", ".join(f"{name} ({rows} rows)" for name, rows in samples)
        lines: list[str | Event] = [self._shown(), f"samples: {listed}"]
        for test in {test.name: test for test in self.tests}.values():
            lines.append(f"{test.name}: {test.hypothesis}; {test.assumes} ({test.reference})")
        for test in self.tests:
            if test.doubt:
                where = f" of {test.column}" if test.column else ""
                lines.append(f"{test.name}{where}: p may be wrong, {test.doubt}")
        return [*lines, *self.notes]

    def _shown(self) -> Table:
        heads = ("test", "column", "statistic", "df", "p", "by")
        rows = tuple(
            (
                test.name,
                test.column or "all",
                f"{test.statistic:.5g}",
                ", ".join(f"{degrees:g}" for degrees in test.degrees) or "-",
                p_in_words(test.p),
                test.by,
            )
            for test in self.tests
        )
        return Table("Tests by name", heads, rows)


def _sure(_vectors: Array, _labels: Labels) -> str:
    return ""


@dataclass(frozen=True)
class _Kind:
    """A test: what it says is equal, what it assumes, its source, and where it can be made.

    - `test`: Its statistic and p by a distribution, of unit vectors (N, p) in samples (N,).
    - `statistic`: Its statistic alone, by a table (N, B) of samples, for p by permutations.
    - `slow`: Whether it takes too long to be made for each permutation of groups.
    - `only`: Where it can be made: on "circles", "means" (circles and spheres), "axes", or anywhere.
    - `two`: Whether it is of two samples alone.
    - `doubt`: Says of unit vectors and samples why p may be wrong; empty if it should be right.
    """

    hypothesis: str
    assumes: str
    reference: str
    only: str = ""
    test: Callable[[Array, Labels], TestStatistic] | None = None
    statistic: Callable[[Array, Labels], Array] | None = None
    two: bool = False
    slow: bool = False
    doubt: Callable[[Array, Labels], str] = _sure

    def result(
        self,
        name: str,
        column: str,
        vectors: Array,
        labels: Labels,
        groups: Labels | None,
        settings: NamedTestSettings,
    ) -> NamedTest:
        """Make the test; of rows in groups (N,) by permutations of these."""
        doubt = self.doubt(vectors, labels) if groups is None else _unlike(labels, groups)
        if groups is None and self.test is not None:
            result = self.test(vectors, labels)
        else:
            kept = _some_of_each(labels, settings.seed)
            result = statistics.permuted(
                *(self._of_each, vectors[kept], labels[kept], settings.permutations, settings.seed),
                None if groups is None else groups[kept],
            )
        assumes = self.assumes if groups is None else "assumes that groups are independent"
        words = (self.hypothesis, assumes, self.reference, doubt)
        return NamedTest(
            name, column, result.statistic, result.degrees, result.p, result.by, *words
        )

    def _of_each(self, vectors: Array, table: Labels) -> Array:
        """Return the statistic (B,) of each column of a table (N, B) of samples."""
        if self.statistic is not None:
            return self.statistic(vectors, table)
        assert self.test is not None
        return np.array([self.test(vectors, labels).statistic for labels in table.T])


def _some_of_each(labels: Labels, seed: int) -> Labels:
    """Return the numbers of some `MAX_ROWS` rows at random, of small samples more than their share."""
    if len(labels) <= MAX_ROWS:
        return np.arange(len(labels))
    rng, sizes = np.random.default_rng(seed), np.bincount(labels)
    fair = np.round(MAX_ROWS * sizes / len(labels)).astype(int)
    wanted = np.maximum(fair, np.minimum(sizes, MAX_ROWS // (2 * len(sizes))))
    kept = [
        rng.choice(np.flatnonzero(labels == k), count, replace=False)
        for k, count in enumerate(wanted)
    ]
    return np.sort(np.concatenate(kept))


def _ratio_of_likelihoods(vectors: Array, labels: Labels) -> TestStatistic:
    """Test of equal parameters of a Bingham density, by the ratio of likelihoods."""
    every, free = highest_log_likelihood("bingham", torch.tensor(vectors))
    samples = range(int(labels.max()) + 1)
    each = [
        highest_log_likelihood("bingham", torch.tensor(vectors[labels == k]))[0] for k in samples
    ]
    return statistics.chi_square(2 * (sum(each) - every), free * (len(each) - 1))


def _small(least: int) -> Callable[[Array, Labels], str]:
    def doubt(_vectors: Array, labels: Labels) -> str:
        few = int(np.bincount(labels).min())
        return f"as a sample has {few} rows, fewer than {least}" if few < least else ""

    return doubt


def _unlike(labels: Labels, groups: Labels) -> str:
    """Say if groups of some samples are larger: such must not change places (see `compare_samples`)."""
    sizes = [
        float(counts.sum() / np.count_nonzero(counts))
        for counts in (np.bincount(groups[labels == k]) for k in range(int(labels.max()) + 1))
    ]
    low, high = min(sizes), max(sizes)
    if high < MOST_UNLIKE * low:
        return ""
    return f"as groups have {low:.3g} rows in one sample and {high:.3g} in another on average"


def _scattered(vectors: Array, labels: Labels) -> str:
    width = vectors.shape[1]
    lengths = [
        float(np.linalg.norm(vectors[labels == k].mean(axis=0)))
        for k in range(int(labels.max()) + 1)
    ]
    kappa = statistics.concentration(min(lengths), width)
    return (
        f"as a sample's concentration is {kappa:.2g}, below 1"
        if kappa is not None and kappa < 1
        else ""
    )


KINDS = {
    "watson-williams": _Kind(
        "equal mean directions", "assumes von Mises-Fisher samples of one concentration, above 1",
        "Watson and Williams, 1956", "means", statistics.watson_williams, doubt=_scattered,
    ),
    "common-mean": _Kind(
        "equal mean directions",
        "assumes 25 rows or more in each sample, no model and no common concentration",
        "Watson, 1983; Fisher, 1993, chapter 5", "means", statistics.common_mean,
        doubt=_small(MIN_LARGE),
    ),
    "common-median": _Kind(
        "equal median directions", "assumes 10 rows or more in each sample and no model",
        "Fisher, 1993, chapter 5", "circles", statistics.common_median, doubt=_small(MIN_MEDIAN),
    ),
    "common-concentration": _Kind(
        "equal concentrations about the samples' own means",
        "assumes one mode and a mean direction in each sample", "Fisher, 1993, chapter 5", "means",
        statistics.common_concentration,
    ),
    "mardia-watson-wheeler": _Kind(
        "equal distributions", "assumes nothing; sees other means or spreads",
        "Mardia, 1972; Wheeler and Watson, 1964", "circles",
        statistic=statistics.mardia_watson_wheeler,
    ),
    "watson-u2": _Kind(
        "equal distributions", "assumes nothing", "Watson, 1962", "circles",
        statistic=statistics.watson_u2, two=True,
    ),
    "kuiper": _Kind(
        "equal distributions", "assumes nothing", "Kuiper, 1960", "circles",
        statistic=statistics.kuiper, two=True,
    ),
    "bingham": _Kind(
        "equal Bingham densities", "assumes Bingham samples of 25 rows or more", "Wilks, 1938", "axes",
        _ratio_of_likelihoods, slow=True, doubt=_small(MIN_LARGE),
    ),
    "energy": _Kind(
        "equal distributions, of all columns together", "assumes nothing",
        "Rizzo and Szekely, 2010", statistic=statistics.energy,
    ),
}  # fmt: skip
"""The tests by name, in the order in which they are shown."""


def named_tests(
    samples: Mapping[str, ArrayLike | TableRows],
    space: str | Space = "torus",
    settings: NamedTestSettings | None = None,
    *,
    columns: Any = None,
    unit: str | None = None,
    groups: Mapping[str, ArrayLike] | None = None,
) -> SampleTests:
    """Test by name whether two or more samples have equal means, concentrations or distributions.

    Angles are tested column by column, and all columns together by "energy". Which test to believe
    should be settled before they are looked at: each p is that of one test alone.

    Args:
        samples: Two or more data sets (N, k) by their names, in the space's own units.
        space: The space, as `DensityEstimator` takes it: a torus, a sphere of any dimension, axes or
            rotations.
        settings: The tests (default: all that there are on the space), permutations and seed.
        columns: What the columns are, as `DensityEstimator` takes it.
        unit: Unit of angles that name none.
        groups: A label for each row, by the same names. Rows of one group are not independent: every p
            is then from permutations of whole groups, each of which must be in one sample alone.

    Raises:
        OrbiflowError: If there is one data set alone, data are not on the space, a sample has fewer
            than five rows or groups, a group is in two samples, or the space has no such tests.

    >>> rng = np.random.default_rng(0)
    >>> found = named_tests({k: rng.vonmises(k == "c", 3, (40, 1)) for k in "abc"})
    >>> found["watson-williams"].p < 0.001
    True
    """
    settings = settings or NamedTestSettings()
    data = Samples.of(samples, DataColumns(space, unit, columns, settings.seed), groups)
    labels, sizes = data.labels, tuple(map(len, data.points))
    if min(sizes) < MIN_SAMPLE:
        few = data.names[sizes.index(min(sizes))]
        raise OrbiflowError(
            f"{few} has {min(sizes)} rows: each sample must have {MIN_SAMPLE} or more"
        )
    members = None if data.groups is None else _members(data.groups, data.names, labels)
    sides, every, there = _vectors(data.space, torch.cat(data.points), data.columns)
    tests: list[NamedTest] = []
    for name in _asked(settings, there, data.space, len(sizes), members is not None):
        for column, vectors in {"": every}.items() if name == "energy" else sides.items():
            tests.append(KINDS[name].result(name, column, vectors, labels, members, settings))
    notes = ["each p is that of one test alone: settle which one counts before you look"]
    if members is not None:
        notes.append(f"each p is from permutations of {int(members.max()) + 1} whole groups")
    if sum(sizes) > MAX_ROWS and any(test.by == "permutation" for test in tests):
        notes.append(
            f"tests by permutations look at some {MAX_ROWS} of {sum(sizes)} rows, drawn at random"
        )
    permutations, seed = settings.permutations, settings.seed
    return SampleTests(tuple(data.names), sizes, tuple(tests), permutations, seed, tuple(notes))


def _members(groups: NDArray[np.str_], names: Sequence[str], labels: Labels) -> Labels:
    """Return the group (N,) of each row, from 0; refuse those in several samples, and few."""
    words, members = np.unique(groups, return_inverse=True)
    pairs: Labels = np.unique(np.stack([members.reshape(-1), labels], axis=1), axis=0)
    count, each = np.bincount(pairs[:, 0]), np.bincount(pairs[:, 1])
    if count.max() > 1:
        twice = int(count.argmax())
        both = [names[int(sample)] for sample in pairs[pairs[:, 0] == twice, 1]]
        raise SettingError(
            literal(f"the group {words[twice]} has rows in {' and '.join(both)}: ")
            + "tests by name are of samples without common groups: compare two data sets instead"
        )
    few = int(each.min())
    if few < MIN_SAMPLE:
        raise OrbiflowError(
            f"{names[int(each.argmin())]} has {few} group{'s' * (few > 1)}: each sample must have "
            f"{MIN_SAMPLE} or more"
        )
    return members.reshape(-1)


def _vectors(
    space: Space, points: torch.Tensor, columns: tuple[str, ...]
) -> tuple[dict[str, Array], Array, str]:
    """Return the unit vectors (N, p) of each column, what distances are taken of, and what they are."""
    if space.is_of_angles:
        angles = 2 * math.pi * points.numpy()
        sides = {
            name: np.stack([np.cos(column), np.sin(column)], axis=1)
            for name, column in zip(columns, angles.T, strict=True)
        }
        return sides, np.concatenate(list(sides.values()), axis=1), "circles"
    try:
        images = images_of(space)
    except OrbiflowError:
        raise OrbiflowError(
            f"there are no tests by name on the {space.name}: compare two data sets instead"
        ) from None
    vectors = space.features(points)[0].numpy()
    if images == 1:
        return {"": vectors}, vectors, "means"
    # either end of an axis has the same products
    products = (vectors[:, :, None] * vectors[:, None, :]).reshape(len(vectors), -1)
    return {"": vectors}, products, "axes"


def _asked(
    settings: NamedTestSettings, there: str, space: Space, samples: int, grouped: bool
) -> list[str]:
    """Return the tests that can be made, of those asked for."""
    possible = {
        name: kind
        for name, kind in KINDS.items()
        if kind.only in ("", there) or (kind.only == "means" and there == "circles")
    }
    if settings.tests is None:
        some = {name: kind for name, kind in possible.items() if not (grouped and kind.slow)}
        return [name for name, kind in some.items() if samples == 2 or not kind.two]
    for name in settings.tests:
        if name not in possible:
            raise SettingError(
                f"{{tests}}: there is no {name} on the {space.name}, but {', '.join(possible)}"
            )
        if possible[name].slow and grouped:
            raise SettingError(f"{{tests}}: {name} is of independent rows: leave {{group}} out")
        if possible[name].two and samples > 2:
            raise SettingError(f"{{tests}}: {name} is of two samples, there are {samples}")
    return [name for name in possible if name in settings.tests]
