"""Comparisons of models by their log densities at held-out rows."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike

from orbiflow.arrays import Array
from orbiflow.density.comparing.resampling import Groups, resampled_sums
from orbiflow.density.comparing.settings import ComparisonSettings
from orbiflow.density.data import alongside
from orbiflow.density.estimator import DensityEstimator
from orbiflow.density.models import Density
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import Answer
from orbiflow.settings import as_array, as_instance, is_a

BLOCK_ROWS = 65_536
"""Rows scored between two looks at whether to stop."""


@dataclass(frozen=True)
class ModelScore:
    """The mean log density of a model at held-out rows, in nats, and its standard error."""

    name: str
    mean: float
    error: float


@dataclass(frozen=True)
class Difference:
    """The log density of `first` less that of `second`, row by row, in nats.

    - `mean`, `error`: The mean over rows, and its standard error from paired rows.
    - `low`, `high`: The interval that holds all differences of the comparison at once.
    - `p`: The p-value of a mean of 0, adjusted for all differences.
    - `share`: The share of the rows to which `first` gives the greater density; equal ones count half.
    - `better`: The name of the better model, None if the rows cannot tell.
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
        verdict = "the rows cannot tell" if self.better is None else f"{self.better} is better"
        return (
            f"{self.first} - {self.second}: {self.mean:+z.4f} ± {self.error:.4f} nats a row, "
            f"{self.low:+z.4f} to {self.high:+z.4f} (p {self.p:.2g}): {verdict}"
        )


@dataclass(frozen=True)
class ModelComparison(Answer):
    """Several models at the same held-out rows.

    - `scores`: Their scores, best first. `differences`: Those of all pairs, the better mean first.
    - `rows`, `groups`: How many there are; `groups` is None if rows are independent.
    - `level`, `resamples`, `seed`: The settings of the intervals.
    - `best`: The model that is better than all others, None if the rows cannot tell.
    - `notes`: What the user should know, in words.
    """

    kind = "models"

    scores: tuple[ModelScore, ...]
    differences: tuple[Difference, ...]
    rows: int
    groups: int | None
    level: float
    resamples: int
    seed: int
    best: str | None
    notes: tuple[str, ...] = ()

    @property
    def verdict(self) -> str:
        """Which model is best, in words."""
        if self.best is not None:
            return f"{self.best} is better than {_listed([s.name for s in self.scores[1:]])}"
        top = self.scores[0].name
        open_ = [d.second for d in self.differences if d.first == top and d.better is None]
        return f"the rows cannot tell {_listed([top, *open_])} apart"

    def table(self) -> list[dict[str, Any]]:
        """Return a row for each difference."""
        return [asdict(difference) for difference in self.differences]

    def words(self) -> list[str]:
        """Return the result and its notes in lines of text."""
        unit = "rows" if self.groups is None else f"rows in {self.groups} groups"
        return [
            f"mean log density at {self.rows} {unit}, in nats:",
            *(f"  {s.name}: {s.mean:.4f} ± {s.error:.4f}" for s in self.scores),
            f"differences, with intervals that hold all at once at {self.level:.1%}:",
            *(f"  {difference}" for difference in self.differences),
            self.verdict,
            *self.notes,
        ]


def compare_scores(
    scores: Mapping[str, ArrayLike],
    settings: ComparisonSettings | None = None,
    *,
    groups: ArrayLike | None = None,
    weights: ArrayLike | None = None,
) -> ModelComparison:
    """Compare log densities of several models at the same held-out rows.

    Intervals come from the symmetric bootstrap-t, of the largest of all pairs' |t|, so that all hold
    at once (Efron and Tibshirani, An introduction to the bootstrap, 1993, ch. 12; Romano and Wolf,
    Stepwise multiple testing, 2005). Whole groups are resampled, and the standard error is that of
    a ratio of sums over groups, or of weighted rows.

    Args:
        scores: The scores (N,) of each model by its name, in nats and with respect to one measure.
        settings: Resamples, level and seed of the intervals.
        groups: A label for each row; rows of one group are not independent. Default: all rows are
            independent.
        weights: Weights (N,) of the rows in every mean, above 0; only ratios count. Default: all
            equal.

    Raises:
        OrbiflowError: If there are fewer than two models, or fewer than five rows or groups, scores
            have different lengths or are not finite, or weights cannot be used.

    >>> rng = np.random.default_rng(0)
    >>> base = rng.normal(size=500)
    >>> comparison = compare_scores({"a": base, "b": base - 0.2 + 0.5 * rng.normal(size=500)})
    >>> comparison.best, comparison.differences[0].error < 0.03
    ('a', True)
    """
    settings = settings or ComparisonSettings()
    scores, groups, weights = alongside(scores=scores, groups=groups, weights=weights)
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
    largest = _largest_t(rows - mean, members, counts, settings)
    reach = float(np.quantile(largest, settings.level, method="higher"))
    differences: list[Difference] = []
    for k, (i, j) in enumerate(pairs):
        low, high = mean[k] - reach * error[k], mean[k] + reach * error[k]
        t = _ratio(abs(mean[k]), error[k])
        p = float((1 + (largest >= t).sum()) / (1 + settings.bootstrap)) if t else 1.0
        share = float(np.average((rows[:, k] > 0) + (rows[:, k] == 0) / 2, weights=counts))
        figures = map(float, (mean[k], error[k], low, high, p, share))
        better = names[i] if low > 0 else None
        differences.append(Difference(names[i], names[j], *figures, better=better))
    beaten = {d.second for d in differences if d.first == names[0] and d.better is not None}
    same = [
        f"{d.first} and {d.second} are equal at every row"
        for d in differences
        if d.mean == d.error == 0
    ]
    best = names[0] if len(beaten) == len(names) - 1 else None
    scored = zip(names, means.tolist(), errors.tolist(), strict=True)
    return ModelComparison(
        tuple(ModelScore(*score) for score in scored),
        tuple(differences),
        len(table),
        members.count if members.given else None,
        *(settings.level, settings.bootstrap, settings.seed),
        best,
        (*members.notes(), *same),
    )


def _table(scores: Mapping[str, ArrayLike]) -> Array:
    """Return the scores (N, M), checked."""
    if not is_a(scores, Mapping) or len(scores) < 2:
        raise OrbiflowError("a comparison needs the scores of two models or more, by their names")
    columns = [as_array(v, f"scores of {name}", ("N",)) for name, v in scores.items()]
    lengths = {name: len(column) for name, column in zip(scores, columns, strict=True)}
    if len(set(lengths.values())) > 1:
        raise OrbiflowError(f"models must be scored at the same rows, got {lengths}")
    return np.stack(columns, axis=1)


def _row_weights(weights: ArrayLike | None, rows: int) -> Array:
    """Return weights (N,) of mean 1."""
    if weights is None:
        return np.ones(rows)
    values = as_array(weights, "weights", ("N",))
    if len(values) != rows or not (values > 0).all():
        raise OrbiflowError(f"weights must be {rows} numbers above 0, one a row")
    return values / values.mean()


def _means(table: Array, groups: Groups, weights: Array) -> tuple[Array, Array]:
    """Return weighted means (k,) over rows of a table (N, k), and their standard errors over groups."""
    mean = weights @ table / len(table)
    residuals = groups.sums(weights[:, None] * (table - mean))
    spread = (residuals**2).sum(axis=0) * groups.count / (groups.count - 1)
    error = np.sqrt(spread) / len(table)
    # equal differences have none but what rounding leaves
    return mean, np.where(error > 1e-14 * (1 + abs(mean)), error, 0.0)


def _largest_t(
    centered: Array, groups: Groups, weights: Array, settings: ComparisonSettings
) -> Array:
    """Return for each resample (B,) the largest |t| of the columns of `centered` (N, k)."""
    rng = np.random.default_rng(settings.seed)
    sums = groups.sums(weights[:, None] * centered)
    sizes = groups.sums(weights[:, None])
    parts = (sizes, sizes**2, sums, sums**2, sums * sizes)
    drawn = resampled_sums(np.concatenate(parts, axis=1), settings.bootstrap, rng)
    n, n2, rest = drawn[:, :1], drawn[:, 1:2], drawn[:, 2:]
    s, s2, sn = np.split(rest, 3, axis=1)
    mean = s / n
    spread = s2 - 2 * mean * sn + mean**2 * n2
    # a resample that misses the only rows with a difference has no spread: it gets one group's
    spread = np.maximum(spread, (sums**2).mean(axis=0))
    error = np.sqrt(spread * groups.count / (groups.count - 1)) / n
    return _ratio(abs(mean), error).max(axis=1)


def _ratio(size: Any, error: Any) -> Any:
    """Return |t|, which without a spread is 0 or, if there is a difference, infinite."""
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.asarray(size) / np.asarray(error)
    return np.where(np.asarray(size) <= 1e-14, 0.0, t)


def _listed(names: list[str]) -> str:
    """Return names in words.

    >>> _listed(["a", "b", "c"])
    'a, b and c'
    """
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def compare_models(
    models: Mapping[str, Density | DensityEstimator],
    data: ArrayLike,
    settings: ComparisonSettings | None = None,
    *,
    groups: ArrayLike | None = None,
) -> ModelComparison:
    """Compare several densities at held-out data.

    Args:
        models: The models by their names, all of one space and unit.
        data: Rows (N, k) that none of them was fitted to, in the space's own units. Estimators find the
            columns of a data frame by the names of their fits.
        settings: Resamples, level and seed of the intervals.
        groups: A label for each row, as for `compare_scores`.

    Raises:
        OrbiflowError: If models or data are not of one space and unit, or as `compare_scores`.
    """
    if not is_a(models, Mapping) or len(models) < 2:
        raise OrbiflowError("give two models or more, by their names")
    densities = {name: density_of(model, name) for name, model in models.items()}
    require_one_space({name: density.space for name, density in densities.items()})
    data, groups = alongside(data=data, groups=groups)
    scores: dict[str, Array] = {}
    for name, density in densities.items():
        model = models[name]
        is_estimator = isinstance(model, DensityEstimator)  # which finds its columns by name
        points = model.points_of(data) if is_estimator else density.space.to_chart(data)
        scores[name] = _scores_at(density, points)
    return compare_scores(scores, settings, groups=groups)


def density_of(model: Density | DensityEstimator, name: str = "the model") -> Density:
    """Return the density of a fitted estimator, or a density as it is."""
    if isinstance(model, DensityEstimator):
        density = getattr(model, "density_", None)
        if density is None:
            raise OrbiflowError(f"{name} is not fitted yet: call fit(data) first")
        return density
    return as_instance(model, Density, name, "or a fitted DensityEstimator")


def require_one_space(spaces: Mapping[str, Space]) -> None:
    """Check that log densities on all spaces are with respect to one measure."""
    (first, wanted), *others = spaces.items()
    for name, other in others:
        areas = [space.volume if space.is_round else 0.0 for space in (wanted, other)]
        if (wanted.name, wanted.dim, areas[0]) != (other.name, other.dim, areas[1]):
            titles = [
                f"torus of {space.dim} angles" if space.is_torus else space.name
                for space in (wanted, other)
            ]
            raise OrbiflowError(
                f"{first} is on the {titles[0]}, {name} on the {titles[1]}: their densities have no "
                "common measure; compare models of one space"
            )
        if wanted.unit != other.unit:
            raise OrbiflowError(
                f"{first} has angles in {wanted.unit}, {name} in {other.unit}: their densities are in "
                "different units; fit both with one unit"
            )


def scores_of(
    density: Density, data: ArrayLike, told: Callable[[float], None] = lambda _: None
) -> Array:
    """Return log densities (N,) at data (N, k) in natural measure; `told` gets the share done."""
    return _scores_at(density, density.space.to_chart(data), told)


def _scores_at(
    density: Density, points: torch.Tensor, told: Callable[[float], None] = lambda _: None
) -> Array:
    """Return log densities (N,) at chart points (N, d) in natural measure."""
    parts: list[np.ndarray] = []
    with torch.no_grad():
        for start in range(0, len(points), BLOCK_ROWS):
            told(start / len(points))
            parts.append(
                density.log_prob(points[start : start + BLOCK_ROWS], measure="natural").numpy()
            )
    return np.concatenate(parts) if parts else np.zeros(0)
