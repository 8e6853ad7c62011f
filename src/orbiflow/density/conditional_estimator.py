"""Densities where covariates are known, and the regression of angles, as scikit-learn has them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import ArrayLike

from orbiflow.arrays import Array
from orbiflow.density.data import (
    Asked,
    TableRows,
    alongside,
    as_data,
    as_numbers,
    asked_roles,
    cells_of,
    columns_of,
    frame_of,
    given_roles,
    is_declared,
)
from orbiflow.density.estimator import DensityEstimator, RandomState, seed_of
from orbiflow.density.fitting import (
    ConditionalReport,
    Progress,
    check_complete,
    fit_conditional,
    mean_of,
    weighed,
)
from orbiflow.density.inference import Trend, axes_named, trend_of
from orbiflow.density.models import ConditionalDensity
from orbiflow.density.spaces import Covariates, Torus, Values, check_measure
from orbiflow.errors import DataWarning, OrbiflowError
from orbiflow.settings import as_whole, described, is_a


class ConditionalEstimator(DensityEstimator):
    """Exact, normalised density p(X | given) of data where covariates are known: `fit(X, given)`.

    Covariates are real numbers, cyclic ones such as hours of the day, and words, alone and together.
    Rows held out choose among conditional kernels, a neural mixture, the conditional of a joint density
    and the density of all rows, which is what is left where covariates say nothing. That density is
    there as well: what is asked without `given` is asked of it.

    Args:
        space: As for `DensityEstimator`, like all others.
        columns: Roles of covariates, too, by their names: {"hour": "cycle:24", "level": "word"}.
            Text is words. Numbers have the role of their name; others are asked for in data frames,
            and real in arrays.

    After `fit`: what a `DensityEstimator` has, `conditional_density_` and `conditional_report_`, which
    says what the covariates gain and what is chosen.

    >>> rng = np.random.default_rng(0)
    >>> length = rng.uniform(0, 2, 200)
    >>> angles = rng.vonmises(length, 8.0)[:, None]
    >>> fit = ConditionalEstimator(unit="radians", components="kernels").fit(angles, {"length": length})
    >>> bool(abs(fit.at(length=1.5).mean()[0] - 1.5) < 0.2)
    True
    """

    conditional_density_: ConditionalDensity
    conditional_report_: ConditionalReport

    def fit(  # pyright: ignore[reportIncompatibleMethodOverride]
        self,
        X: ArrayLike | TableRows,
        given: Any,
        sample_weight: ArrayLike | None = None,
        *,
        groups: ArrayLike | None = None,
        progress: Progress | None = None,
    ) -> Self:
        """Fit to data (N, k) and what is known of each row.

        Args:
            X: The data, as for `DensityEstimator.fit`.
            given: Columns of the frame X with their roles, {"hour": "cycle:24", "site": "word"}, or
                columns of their own: a data frame, a mapping {"name": values}, or an array (N, c),
                whose columns are called x1, x2 and so on.
            sample_weight: How much each row counts (N,).
            groups: A label (N,) a row: rows of one are held out together.
            progress: Hears the share of the work done.

        Raises:
            OrbiflowError: For data as `DensityEstimator.fit`; for missing values among the covariates,
                one that has one value alone, another number of rows, and fewer than 30 rows.
        """
        declared = asked_roles(given) if is_declared(given) else None
        beside = {} if declared is not None else {"given": given}
        _, sample_weight, groups, *aligned = alongside(
            X=X, sample_weight=sample_weight, groups=groups, **beside
        )
        check_complete(self.missing)
        if declared is None:
            cells = columns_given(aligned[0])
            read = self.read_rows(X, apart=list(cells))
        else:
            names = [str(name) for name in declared]
            read = self.read_rows(X, others=names, apart=names)
            cells = dict(read.given)
        sample_weight, groups = read.beside(sample_weight, groups)
        are_asked = declared is not None or is_frame(given)
        covariates = self._covariates(cells, declared or {}, are_asked)
        pooled = self._fit(read, sample_weight, groups, progress)
        points = self._chart(read.values)
        self.conditional_density_, self.conditional_report_ = fit_conditional(
            pooled,
            points,
            _features(covariates, cells, len(points)),
            covariates,
            self.settings(),
            weights=sample_weight,
            groups=groups,
            progress=progress,
        )
        return self

    def score_samples(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, X: ArrayLike, given: Any = None, *, measure: str = "natural"
    ) -> Array:
        """Log densities (N,) in nats at data (N, k), each where its covariates are as `given`.

        Without `given`, of the density of all rows.

        Raises:
            OrbiflowError: As `DensityEstimator.score_samples`, and for covariates that lack a column or
                a value, or have a word that the fit has not seen.
        """
        if given is None:
            return super().score_samples(X, measure=measure)
        if not is_declared(given):
            _, given = alongside(X=X, given=given)
        own = self._conditional()
        check_measure(measure, own.space)
        points = self.points_of(X)
        given = X if is_declared(given) else given
        return own.log_prob(points, self._x(given, len(points)), measure=measure).numpy()

    def score(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, X: ArrayLike, given: Any = None, sample_weight: ArrayLike | None = None
    ) -> float:
        """Mean log density of data (N, k), weighted, in natural measure; as `score_samples`."""
        others = {} if given is None or is_declared(given) else {"given": given}
        _, sample_weight, *aligned = alongside(X=X, sample_weight=sample_weight, **others)
        given = aligned[0] if aligned else given
        scores = torch.as_tensor(self.score_samples(X, given))
        rows = weighed(scores[:, None], sample_weight)
        return mean_of(rows.points[:, 0], rows.weights)

    def sample(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, n_samples: int = 1, given: Any = None, random_state: RandomState = None
    ) -> Any:
        """New data (n_samples, k), where the covariates are as `given`.

        Args:
            n_samples: How many.
            given: One value for each name, or as many rows as samples, of which each has one: a data
                frame, columns by name, or an array. A single value among columns is that of all rows.
            random_state: As for `DensityEstimator.sample`.

        Raises:
            OrbiflowError: As `score_samples`, and for another number of rows.
        """
        if given is None:
            return super().sample(n_samples, random_state)
        own, count = self._conditional(), as_whole(n_samples, "n_samples", 1)
        cells = _rows_given(given, own.covariates.names, count)
        x = self._x(cells, len(next(iter(cells.values()))))
        generator = torch.Generator().manual_seed(seed_of(random_state))
        points = torch.empty((count, own.space.chart_dim), dtype=torch.float64)
        _, first, number = np.unique(x.numpy(), axis=0, return_index=True, return_inverse=True)
        places = np.broadcast_to(number.ravel(), count)
        for k, row in enumerate(first.tolist()):
            those = np.flatnonzero(places == k)
            points[those] = own.at(x[row]).sample((len(those),), generator).double()
        rows = own.space.from_chart(points)
        return frame_of(rows, self._column_names(), getattr(self, "output_", "default"))

    def at(self, given: Mapping[str, Any] | None = None, /, **values: Any) -> DensityEstimator:
        """The density where covariates have some values: a `DensityEstimator` that is fitted.

        All covariates are named: `at(temperature=295, residue="GLY")`.
        """
        own = self._conditional()
        cells = {name: np.array([value]) for name, value in ({**(given or {}), **values}).items()}
        if unknown := [name for name in cells if name not in own.covariates.names]:
            known = ", ".join(own.covariates.names)
            raise OrbiflowError(f"no covariate {unknown[0]!r}; there are {known}")
        density = own.at(self._x(cells, 1)[0])
        return DensityEstimator.fitted(density, columns=self._column_names())

    def trend_along(
        self,
        along: str,
        at: ArrayLike,
        of: str | int = 0,
        *,
        given: Mapping[str, Any] | None = None,
        levels: Sequence[float] = (0.5, 0.9),
    ) -> Trend:
        """How a column goes with a covariate: its mean and intervals at values (n,) of `along`.

        The other covariates are as `given`. The intervals hold the shares `levels` of new data.
        """
        (axis,) = axes_named([of], self._column_names())
        values = np.asarray(at)
        densities = (self.at({**(given or {}), along: one}).density_ for one in values)
        return trend_of(densities, axis, values, levels=levels)

    def _covariates(
        self, cells: Mapping[str, Values], declared: Asked, are_asked: bool
    ) -> Covariates:
        """Return what covariates of a fit are; warn of what is doubtful."""
        asked = {
            **asked_roles(self.columns),
            **{k: r for k, r in declared.items() if r is not None},
        }
        roles = given_roles(list(cells), cells, asked, self.unit, are_asked=are_asked)
        found = Covariates.of(cells, roles)
        for doubt in found.fit_doubts(cells):
            warnings.warn(doubt, DataWarning, stacklevel=3)
        return found

    def _x(self, given: Any, rows: int) -> torch.Tensor:
        covariates = self._conditional().covariates
        cells = columns_given(given, covariates.names)
        x = _features(covariates, cells, rows)
        for doubt in covariates.doubts(cells):
            warnings.warn(doubt, DataWarning, stacklevel=3)
        return x

    def _conditional(self) -> ConditionalDensity:
        if not hasattr(self, "conditional_density_"):
            raise OrbiflowError("this estimator is not fitted yet: call fit first")
        return self.conditional_density_


class AngleRegressor(ConditionalEstimator):
    """Regression of angles on covariates, in scikit-learn's order: `fit(X, y)`, `predict(X)`.

    A `ConditionalEstimator` whose `X` are covariates and whose `y` are angles; `at`, `sample` and
    `trend_along` are those of the density. Parameters are the same.

    >>> rng = np.random.default_rng(0)
    >>> x = rng.uniform(-1, 1, (200, 1))
    >>> angles = rng.vonmises(2 * x[:, 0], 20.0)
    >>> fit = AngleRegressor(unit="radians", components="kernels").fit(x, angles)
    >>> bool(abs(fit.predict([[0.5]])[0] - 1.0) < 0.1)
    True
    """

    def fit(  # pyright: ignore[reportIncompatibleMethodOverride]
        self,
        X: Any,
        y: ArrayLike,
        sample_weight: ArrayLike | None = None,
        *,
        groups: ArrayLike | None = None,
        progress: Progress | None = None,
    ) -> Self:
        """Fit to covariates (N, c) and angles (N,) or (N, d) on a torus."""
        _, y, sample_weight, groups = alongside(
            X=X, y=y, sample_weight=sample_weight, groups=groups
        )
        angles = as_data(y, "y")
        self.is_flat_ = np.ndim(y) == 1
        super().fit(_table(angles.values), X, sample_weight, groups=groups, progress=progress)
        self._period()
        self.n_features_in_ = len(self.conditional_density_.covariates.columns)
        return self

    def predict(self, X: Any) -> Array:
        """The mean directions (N,) or (N, d) where the covariates are X (N, c), within half a turn."""
        own = self._conditional()
        rows = len(next(iter(columns_given(X, own.covariates.names).values())))
        turns = own.mean_directions(self._x(X, rows)).numpy()
        angles = turns * self._period()
        return angles[:, 0] if self.is_flat_ else angles

    def score(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, X: Any, y: ArrayLike, sample_weight: ArrayLike | None = None
    ) -> float:
        """1 less the mean of 1 - cos(angle - prediction), in that about the angles' mean direction.

        As the R^2 of a regression of numbers: 1 is perfect, 0 no better than the mean direction.
        """
        _, y, sample_weight = alongside(X=X, y=y, sample_weight=sample_weight)
        angles = _table(as_data(y, "y").values)
        weights = (
            np.ones(len(angles)) if sample_weight is None else as_numbers(sample_weight, "weights")
        )
        radians = 2 * np.pi / self._period()
        own, found = angles * radians, _table(self.predict(X)) * radians
        mean = np.angle((weights[:, None] * np.exp(1j * own)).sum(axis=0))
        left, all_of_it = (
            float((weights[:, None] * (1 - np.cos(own - at))).sum()) for at in (found, mean)
        )
        return 1 - left / all_of_it if all_of_it else 0.0

    def _period(self) -> float:
        if not (isinstance(self.space_, Torus) and self.space_.is_of_angles):
            raise OrbiflowError("a regression of angles is for a torus without real columns")
        return self.space_.period

    def __sklearn_tags__(self) -> Any:
        # asked for by scikit-learn alone, which is therefore there
        from sklearn.utils import RegressorTags, Tags, TargetTags  # pyright: ignore[reportMissingImports, reportMissingTypeStubs]

        return Tags(
            estimator_type="regressor",
            target_tags=TargetTags(required=True, multi_output=True),
            transformer_tags=None,
            regressor_tags=RegressorTags(),
            classifier_tags=None,
        )


def is_frame(given: Any) -> bool:
    """Return whether covariates are a data frame, and no arrays with or without names."""
    is_mapping = is_a(given, Mapping) and not hasattr(given, "dims")
    return not is_mapping and columns_of(given, "given") is not None


def columns_given(given: Any, names: Sequence[str] | None = None) -> dict[str, Values]:
    """Return covariates as columns of cells (N,) by name.

    Args:
        given: A data frame, a mapping, or an array (N, c).
        names: Those that are wanted; an array's columns are in this order. Default: all there are.

    Raises `OrbiflowError` for a column that is not there and for columns of several lengths.
    """
    (given,) = alongside(given=given)
    is_mapping = is_a(given, Mapping) and not hasattr(given, "dims")
    pairs = list(given.items()) if is_mapping else columns_of(given, "given")
    if pairs is None:
        table = np.asarray(given)
        if table.ndim != 2:
            raise OrbiflowError(
                f"given: expected columns or an array (N, c), got {described(given)}"
            )
        called = names or [f"x{k}" for k in range(1, table.shape[1] + 1)]
        if len(called) != table.shape[1]:
            raise OrbiflowError(
                f"given: expected {', '.join(called)}, got {table.shape[1]} columns"
            )
        pairs = list(zip(called, table.T, strict=True))
    found = {str(name): np.asarray(cells_of(cells)) for name, cells in pairs}
    if names is not None:
        if lacking := [name for name in names if name not in found]:
            raise OrbiflowError(f"given: there is no {', '.join(lacking)} among {', '.join(found)}")
        found = {name: found[name] for name in names}
    shapes = {cells.shape for cells in found.values()}
    if len(shapes) > 1 or any(len(shape) != 1 for shape in shapes):
        raise OrbiflowError(f"given: the columns must be of one length, got {sorted(shapes)}")
    return found


def _rows_given(given: Any, names: Sequence[str], count: int) -> dict[str, Values]:
    """Return covariates as columns of one cell or of `count`; a single value becomes a column."""
    if is_a(given, Mapping):
        rows = [np.atleast_1d(np.asarray(cells)) for cells in given.values()]
        most = max(map(len, rows), default=0)
        rows = [np.repeat(cells, most) if len(cells) == 1 else cells for cells in rows]
        given = dict(zip(given, rows, strict=True))
    cells = columns_given(given, names)
    found = len(next(iter(cells.values())))
    if found not in (1, count):
        raise OrbiflowError(
            f"given has {found} rows, and n_samples is {count}: give one row, or one for each sample"
        )
    return cells


def _features(covariates: Covariates, cells: Mapping[str, Values], rows: int) -> torch.Tensor:
    x = covariates.features(cells)
    if len(x) != rows:
        raise OrbiflowError(f"given: expected {rows} rows, as the data have, got {len(x)}")
    return x


def _table(angles: Array) -> Array:
    """Return angles (N,) or (N, d) as a table."""
    return angles[:, None] if angles.ndim == 1 else angles
