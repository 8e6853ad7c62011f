"""Trends: means and intervals of one column where another one is known."""

import numpy as np
import pytest
from scipy import stats

from density.test_mixed import data_of
from orbiflow.density import DensityEstimator
from refusals import refused


@pytest.fixture(scope="module", name="fit")
def fit_fixture() -> DensityEstimator:
    columns = "phi=angle:degrees,length=positive,temperature=linear"
    return DensityEstimator(columns=columns, components="mixture,chains").fit(data_of(800))


def test_a_length_follows_its_angle(fit: DensityEstimator) -> None:
    at = np.linspace(-60, 100, 9)
    found = fit.trend(1, 0, at)
    true = 1.5 + 0.02 * np.cos(np.radians(at))
    assert np.abs(found.mean - true).max() < 0.004
    half = stats.norm.ppf([0.75, 0.95]) * 0.01
    assert np.abs(found.high - found.mean[:, None] - half).max() < 0.006
    assert np.abs(found.mean[:, None] - found.low - half).max() < 0.006
    alone = fit.marginal(0).score_samples(at[:, None])
    assert found.log_density is not None
    assert np.allclose(found.log_density, alone, atol=0.02)


def test_it_is_what_conditional_densities_say(fit: DensityEstimator) -> None:
    found = fit.trend(0, 2, [286.0, 294.0], levels=(0.5,))
    for k, value in enumerate((286.0, 294.0)):
        own = fit.conditional({2: value}).marginal(0)
        apart = (found.mean[k] - own.mean()[0] + 180) % 360 - 180
        assert abs(apart) < 1.0
        low, high = ((np.array([found.low[k, 0], found.high[k, 0]]) + 180) % 360 - 180).tolist()
        below = own.cdf([[low], [high]])
        assert (below[1] - below[0]) % 1 == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize(
    ("of", "along", "at", "levels", "words"),
    [
        (0, 0, [1.0], (0.5,), "twice"), (0, 1, [], (0.5,), "1 1000"),
        (0, 1, [1.5], (1.0,), "masses 0 1"), (0, 7, [1.5], (0.5,), "column 7"),
    ],
)  # fmt: skip
def test_trends_that_there_are_not(fit, of, along, at, levels, words) -> None:
    with refused(*words.split()):
        fit.trend(of, along, at, levels=levels)
