"""Which of several models gives held-out rows the greater density, and whether the rows can tell."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike

from orbiflow.arguments import (
    is_a,
    number,
    numbers,
    whole,
)
from orbiflow.arrays import Array
from orbiflow.density.arguments import check_kind
from orbiflow.density.comparing.resampling import Groups, resampled_sums
from orbiflow.density.estimator import DensityEstimator
from orbiflow.density.models import SymmetricDensity
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError

RESAMPLES, LEVEL = 2000, 0.95
MOST_RESAMPLES = 1_000_000


@dataclass(frozen=True)
class ModelScore:
    """The mean log density of a model at held-out rows, in nats, and its standard error."""

    name: str
    mean: float
    error: float


@dataclass(frozen=True)
class Difference:
    """Log density of `first` less that of `second`, row by row, in nats.

    - `mean`, `error`: the mean over rows and its standard error, paired.
    - `low`, `high`: interval that holds all differences of the comparison at once.
    - `p`: of a mean of 0, adjusted for all differences.
    - `share`: of the rows, to which `first` gives the greater density; half of equal ones.
    - `better`: name of the better model; None if the rows cannot tell.
    """

    first: str
    second: str
    mean: float
    error: float
    low: float
    high: float
    p: float
    share: float
    better: str | None

    def __str__(self) -> str:
        told = "the rows cannot tell" if self.better is None else f"{self.better} is better"
        return (
            f"{self.first} - {self.second}: {self.mean:+.4f} ± {self.error:.4f} nats a row, "
            f"{self.low:+.4f} to {self.high:+.4f} (p {self.p:.2g}): {told}"
        )


@dataclass(frozen=True)
class ModelComparison:
    """Models at the same held-out rows.

    - `scores`: best first. `differences`: of all pairs, the better one by its mean first.
    - `rows`, `groups`: how many; `groups` is None if rows are independent.
    - `level`, `resamples`, `seed`: of the intervals.
    - `best`: the model that is better than all others; None if the rows cannot tell.
    - `notes`: what the user should know, in words.
    """

    scores: tuple[ModelScore, ...]
    differences: tuple[Difference, ...]
    rows: int
    groups: int | None
    level: float
    resamples: int
    seed: int
    best: str | None
    notes: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """An object for `json.dumps`."""
        return {"kind": "models", **asdict(self), "verdict": self.verdict}

    @property
    def verdict(self) -> str:
        """Which is best, in words."""
        if self.best is not None:
            return f"{self.best} is better than {_listed([s.name for s in self.scores[1:]])}"
        top = self.scores[0].name
        open_ = [d.second for d in self.differences if d.first == top and d.better is None]
        return f"the rows cannot tell {_listed([top, *open_])} apart"

    def words(self) -> list[str]:
        """What came of it, in lines."""
        unit = "rows" if self.groups is None else f"rows in {self.groups} groups"
        return [
            f"mean log density at {self.rows} {unit}, in nats:",
            *(f"  {s.name}: {s.mean:.4f} ± {s.error:.4f}" for s in self.scores),
            f"differences, with intervals that hold all at once at {self.level:.1%}:",
            *(f"  {difference}" for difference in self.differences),
            self.verdict,
        ]


def compare_scores(
    scores: Mapping[str, ArrayLike],
    *,
    groups: ArrayLike | None = None,
    weights: ArrayLike | None = None,
    resamples: int = RESAMPLES,
    level: float = LEVEL,
    seed: int = 0,
) -> ModelComparison:
    """Compare log densities of several models at the same held-out rows.

    Intervals are by the symmetric bootstrap-t, of the largest of all pairs' |t|, so that all hold at
    once (Efron and Tibshirani, An introduction to the bootstrap, 1993, ch. 12; Romano and Wolf,
    Stepwise multiple testing, 2005). Whole groups are resampled, and the standard error is that of
    a ratio of sums over groups, or of weighted rows.

    Args:
        scores: (N,) a model, in nats and with respect to one measure.
        groups: a label (N,) a row; rows of one group are not independent. None: all are.
        weights: of the rows (N,) in every mean, above 0; only ratios count. None: all the same.
        resamples: of the bootstrap, 100 or more.
        level: of the intervals.
        seed: of the resamples.

    Raises:
        OrbiflowError: for fewer than two models, scores of different lengths or not finite, weights
            that are none, or fewer than five rows or groups.

    >>> rng = np.random.default_rng(0)
    >>> base = rng.normal(size=500)
    >>> found = compare_scores({"a": base, "b": base - 0.2 + 0.5 * rng.normal(size=500)})
    >>> found.best, found.differences[0].error < 0.03
    ('a', True)
    """
    resamples = whole(resamples, "resamples", 100, MOST_RESAMPLES)
    level = number(level, "level", 0.5, 0.999)
    table = _table(scores)
    members = Groups.of(groups, len(table))
    members.require()
    counts = _row_weights(weights, len(table))
    means, errors = _means(table, members, counts)
    order = np.argsort(-means, kind="stable")
    names = [list(scores)[int(k)] for k in order]
    table, means, errors = table[:, order], means[order], errors[order]
    pairs = list(itertools.combinations(range(len(names)), 2))
    rows = np.stack([table[:, i] - table[:, j] for i, j in pairs], axis=1)
    mean, error = _means(rows, members, counts)
    largest = _largest_t(rows - mean, members, counts, resamples, seed)
    reach = float(np.quantile(largest, level, method="higher"))
    found: list[Difference] = []
    for k, (i, j) in enumerate(pairs):
        low, high = mean[k] - reach * error[k], mean[k] + reach * error[k]
        t = _ratio(abs(mean[k]), error[k])
        found.append(
            Difference(
                names[i],
                names[j],
                float(mean[k]),
                float(error[k]),
                float(low),
                float(high),
                float((1 + (largest >= t).sum()) / (1 + resamples)) if t else 1.0,
                float(np.average((rows[:, k] > 0) + (rows[:, k] == 0) / 2, weights=counts)),
                names[i] if low > 0 else None,
            )
        )
    beaten = {d.second for d in found if d.first == names[0] and d.better is not None}
    same = [f"{d.first} and {d.second} are equal at every row" for d in found if _equal(d)]
    return ModelComparison(
        tuple(ModelScore(*s) for s in zip(names, means.tolist(), errors.tolist(), strict=True)),
        tuple(found),
        len(table),
        members.count if members.given else None,
        level,
        resamples,
        seed,
        names[0] if len(beaten) == len(names) - 1 else None,
        (*members.notes(), *same),
    )


def _table(scores: Mapping[str, ArrayLike]) -> Array:
    """Scores (N, M), checked."""
    if not is_a(scores, Mapping) or len(scores) < 2:
        raise OrbiflowError("a comparison needs the scores of two models or more, by their names")
    columns = [numbers(v, f"scores of {name}", ("N",)) for name, v in scores.items()]
    lengths = {name: len(column) for name, column in zip(scores, columns, strict=True)}
    if len(set(lengths.values())) > 1:
        raise OrbiflowError(f"models must be scored at the same rows, got {lengths}")
    return np.stack(columns, axis=1)


def _row_weights(weights: ArrayLike | None, rows: int) -> Array:
    """(N,) of mean 1."""
    if weights is None:
        return np.ones(rows)
    found = numbers(weights, "weights", ("N",))
    if len(found) != rows or not (found > 0).all():
        raise OrbiflowError(f"weights must be {rows} numbers above 0, one a row")
    return found / found.mean()


def _means(table: Array, groups: Groups, weights: Array) -> tuple[Array, Array]:
    """Weighted means (k,) over rows of a table (N, k), and their standard errors over groups."""
    mean = weights @ table / len(table)
    residuals = groups.sums(weights[:, None] * (table - mean))
    spread = (residuals**2).sum(axis=0) * groups.count / (groups.count - 1)
    error = np.sqrt(spread) / len(table)
    # what rounding leaves of equal differences is none
    return mean, np.where(error > 1e-14 * (1 + abs(mean)), error, 0.0)


def _largest_t(centered: Array, groups: Groups, weights: Array, resamples: int, seed: int) -> Array:
    """(B,): of each resample the largest |t| of the columns of `centered` (N, k)."""
    sums = groups.sums(weights[:, None] * centered)
    sizes = groups.sums(weights[:, None])
    parts = (sizes, sizes**2, sums, sums**2, sums * sizes)
    drawn = resampled_sums(np.concatenate(parts, axis=1), resamples, np.random.default_rng(seed))
    n, n2, rest = drawn[:, :1], drawn[:, 1:2], drawn[:, 2:]
    s, s2, sn = np.split(rest, 3, axis=1)
    mean = s / n
    spread = s2 - 2 * mean * sn + mean**2 * n2
    # a resample that misses the only rows with a difference has no spread: it gets one group's
    spread = np.maximum(spread, (sums**2).mean(axis=0))
    error = np.sqrt(spread * groups.count / (groups.count - 1)) / n
    return _ratio(abs(mean), error).max(axis=1)


def _ratio(size: Any, error: Any) -> Any:
    """|t|: without a spread, 0 if there is no difference and infinite if there is."""
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.asarray(size) / np.asarray(error)
    return np.where(np.asarray(size) <= 1e-14, 0.0, t)


def _equal(difference: Difference) -> bool:
    return difference.mean == 0 and difference.error == 0


def _listed(names: list[str]) -> str:
    """
    >>> _listed(["a", "b", "c"])
    'a, b and c'
    """
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


BLOCK = 65_536
"""Rows scored between two looks at whether to stop."""


def compare_models(
    models: Mapping[str, SymmetricDensity | DensityEstimator],
    data: ArrayLike,
    *,
    groups: ArrayLike | None = None,
    resamples: int = RESAMPLES,
    level: float = LEVEL,
    seed: int = 0,
) -> ModelComparison:
    """Which of several densities suits held-out data (N, k) best; see `compare_scores`.

    Args:
        models: by their names, all of one space and unit.
        data: rows that none of them was fitted to, in the space's own units.

    Raises:
        OrbiflowError: for models of different spaces or units, or data that are not of the space; and
            as `compare_scores`.
    """
    if not is_a(models, Mapping) or len(models) < 2:
        raise OrbiflowError("give two models or more, by their names")
    densities = {name: density_of(model, name) for name, model in models.items()}
    require_one_space({name: density.space for name, density in densities.items()})
    scores = {name: scores_of(density, data) for name, density in densities.items()}
    return compare_scores(scores, groups=groups, resamples=resamples, level=level, seed=seed)


def density_of(
    model: SymmetricDensity | DensityEstimator, name: str = "the model"
) -> SymmetricDensity:
    """The density of a fitted estimator, or itself.

    Raises:
        OrbiflowError: for another thing, or an estimator that is not fitted.
    """
    if isinstance(model, DensityEstimator):
        density = getattr(model, "density_", None)
        if density is None:
            raise OrbiflowError(f"{name} is not fitted yet: call fit first")
        return density
    return check_kind(model, SymmetricDensity, name, "or a fitted DensityEstimator")


def require_one_space(spaces: Mapping[str, Space]) -> None:
    """
    Raises:
        OrbiflowError: unless log densities on all of them are with respect to one measure.
    """
    (first, one), *others = spaces.items()
    for name, other in others:
        if (one.name, one.dim) != (other.name, other.dim):
            raise OrbiflowError(
                f"{first} is on the {_said(one)}, {name} on the {_said(other)}: their densities "
                "have no common measure; compare models of one space"
            )
        if one.unit != other.unit:
            raise OrbiflowError(
                f"{first} has angles in {one.unit}, {name} in {other.unit}: their densities are per "
                "other units; fit both with one --unit"
            )


def scores_of(
    density: SymmetricDensity, data: ArrayLike, told: Callable[[float], None] = lambda _: None
) -> Array:
    """Log densities (N,) at data (N, k), in natural measure; `told` the share of rows done."""
    points = density.space.to_chart(data)
    found: list[Sequence[float] | np.ndarray] = []
    with torch.no_grad():
        for start in range(0, len(points), BLOCK):
            told(start / len(points))
            found.append(density.log_prob(points[start : start + BLOCK], measure="natural").numpy())
    return np.concatenate(found) if found else np.zeros(0)


def _said(space: Space) -> str:
    return f"torus of {space.dim} angles" if space.is_torus else space.name
