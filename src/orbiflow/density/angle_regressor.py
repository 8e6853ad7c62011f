"""The density estimator of angles where covariates are known, as a regression: `fit(X, y)`."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arrays import Array
from orbiflow.density.data import alongside, as_data, as_numbers
from orbiflow.density.estimator import DensityEstimator
from orbiflow.density.fitting import Progress
from orbiflow.density.given_covariates import columns_given
from orbiflow.density.spaces import Torus
from orbiflow.errors import OrbiflowError


class AngleRegressor(DensityEstimator):
    """Regression of angles on covariates, in scikit-learn's order: `fit(X, y)`, `predict(X)`.

    A `DensityEstimator` whose `X` are covariates and whose `y` are angles; `at`, `sample` and
    `trend_along` are those of the density. Parameters are the same.

    >>> rng = np.random.default_rng(0)
    >>> x = rng.uniform(-1, 1, (60, 1))
    >>> angles = rng.vonmises(2 * x[:, 0], 20.0)
    >>> fit = AngleRegressor(unit="radians", components="kernels", effort="fast").fit(x, angles)
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
        how: dict[str, Any] = {"given": X, "groups": groups, "progress": progress}
        super().fit(_table(angles.values), None, sample_weight, **how)
        self._period()
        self.n_features_in_ = len(self.conditional_density_.covariates.columns)
        return self

    def predict(self, X: Any) -> Array:
        """The mean directions (N,) or (N, d) where the covariates are X (N, c), within half a turn."""
        density = self.conditional_density_
        rows = len(next(iter(columns_given(X, density.covariates.names).values())))
        turns = density.mean_directions(self._x(X, rows)).numpy()
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
        radians_of, predicted = angles * radians, _table(self.predict(X)) * radians
        mean = np.angle((weights[:, None] * np.exp(1j * radians_of)).sum(axis=0))
        left, all_of_it = (
            float((weights[:, None] * (1 - np.cos(radians_of - at))).sum())
            for at in (predicted, mean)
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
