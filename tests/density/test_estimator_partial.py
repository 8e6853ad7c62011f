"""Marginal and conditional estimators, in the data's unit and by its columns."""

import numpy as np
import pytest

from orbiflow.density import DensityEstimator
from refusals import refused


class Frame:
    """As a data frame is seen: an array with names of columns."""

    def __init__(self, values: np.ndarray, columns: list[str]) -> None:
        self.values, self.columns = values, columns

    def __array__(self, dtype: object = None, copy: object = None) -> np.ndarray:
        return self.values


@pytest.fixture(scope="module")
def fitted() -> DensityEstimator:
    rng = np.random.default_rng(0)
    first = rng.vonmises(0.5, 3.0, 150)
    angles = np.degrees(np.stack([first, first + rng.vonmises(0, 9.0, 150)], axis=1))
    return DensityEstimator("torus", unit="degrees", components="kernels,chains").fit(
        Frame(angles, ["phi", "psi"])
    )


def test_conditional_times_marginal_is_joint_per_degree(fitted: DensityEstimator) -> None:
    phi = np.linspace(-170, 170, 9)
    slice_ = fitted.conditional(psi=-45)
    joint = fitted.score_samples(np.stack([phi, np.full(9, -45.0)], axis=1))
    at = fitted.marginal("psi").score_samples([[-45.0]])
    assert slice_.score_samples(phi[:, None]) + at == pytest.approx(joint, abs=1e-3)
    assert list(slice_.feature_names_in_) == ["phi"]
    assert slice_.conditional is not None
    line = np.arange(-180, 180, 0.5)[:, None]
    assert np.exp(slice_.score_samples(line)).sum() * 0.5 == pytest.approx(1, abs=1e-6)
    assert slice_.sample(5, random_state=0).shape == (5, 1)


def test_columns_by_name_number_or_case(fitted: DensityEstimator) -> None:
    same = [fitted.marginal(column).score_samples([[10.0]])[0] for column in ("psi", "PSI", 1)]
    assert len(set(same)) == 1
    turned = fitted.marginal("psi", "phi")
    assert turned.score_samples([[20.0, 10.0]]) == pytest.approx(
        fitted.score_samples([[10.0, 20.0]]), abs=1e-4
    )


def test_mistakes_are_named(fitted: DensityEstimator) -> None:
    with refused("chi"):
        fitted.marginal("chi")
    with refused("twice"):
        fitted.conditional({1: 3.0}, psi=2.0)
    with refused("number"):
        fitted.conditional(psi="left")  # type: ignore[arg-type]
    with refused("fitted"):
        DensityEstimator("torus").marginal("phi")
    sphere = DensityEstimator("sphere", components="kernels").fit(
        np.random.default_rng(0).uniform(-60, 60, (40, 2))
    )
    with refused("sphere"):
        sphere.conditional(lat=3.0)
