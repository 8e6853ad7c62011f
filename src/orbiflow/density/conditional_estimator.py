"""The density estimator by other orders of arguments: `fit(X, given)`, and `fit(X, y)` of angles."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arrays import Array
from orbiflow.density.data import TableRows, alongside, as_data, as_numbers
from orbiflow.density.estimator import DensityEstimator, RandomState
from orbiflow.density.fitting import Progress
from orbiflow.density.given_covariates import columns_given
from orbiflow.density.spaces import Torus
from orbiflow.errors import OrbiflowError


class ConditionalEstimator(DensityEstimator):
    """Exact, normalised density p(X | given), by the order of arguments: `fit(X, given)`.

    It is a `DensityEstimator`, whose `fit`, `score_samples`, `score` and `sample` take `given` by name.
    Covariates are real numbers, cyclic ones such as hours of the day, and words, alone and together.
    Held-out rows choose among conditional kernels, a neural mixture, the conditional of a joint density
    and the density of all rows, which is what is left where covariates say nothing. That density is
    there as well: what is asked without `given` is asked of it.

    >>> rng = np.random.default_rng(0)
    >>> length = rng.uniform(0, 2, 200)
    >>> angles = rng.vonmises(length, 8.0)[:, None]
    >>> fit = ConditionalEstimator(unit="radians", components="kernels").fit(angles, {"length": length})
    >>> bool(abs(fit.at(length=1.5).mean()[0] - 1.5) < 0.2)
    True
    """

    def fit(  # pyright: ignore[reportIncompatibleMethodOverride]
        self,
        X: ArrayLike | TableRows,
        given: Any,
        sample_weight: ArrayLike | None = None,
        *,
        groups: ArrayLike | None = None,
        progress: Progress | None = None,
    ) -> Self:
        """Fit to data (N, k) and what is known of each row, as `DensityEstimator.fit`."""
        return super().fit(X, None, sample_weight, given=given, groups=groups, progress=progress)

    def score_samples(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, X: ArrayLike, given: Any = None, *, measure: str = "natural"
    ) -> Array:
        """Log densities (N,) in nats at data (N, k), as `DensityEstimator.score_samples`."""
        return super().score_samples(X, given=given, measure=measure)

    def score(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, X: ArrayLike, given: Any = None, sample_weight: ArrayLike | None = None
    ) -> float:
        """Mean log density of data (N, k), weighted, in natural measure; as `score_samples`."""
        return super().score(X, None, sample_weight, given=given)

    def sample(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, n_samples: int = 1, given: Any = None, random_state: RandomState = None
    ) -> Any:
        """New data (n_samples, k), as `DensityEstimator.sample`."""
        return super().sample(n_samples, random_state, given=given)


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


def _table(angles: Array) -> Array:
    """Return angles (N,) or (N, d) as a table."""
    return angles[:, None] if angles.ndim == 1 else angles
