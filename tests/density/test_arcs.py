"""Quantiles, medians and intervals on a circle, wherever the data are and however they are written."""

from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy import stats

from orbiflow.density import DensityEstimator
from orbiflow.density.inference import shortest_intervals
from orbiflow.density.models import AdaptiveKernels, Density, Mixture, UniformDensity
from orbiflow.density.spaces import Space, Torus
from refusals import refused


def kernels(space: Space, means: Any, kappas: Any, weights: Any) -> Density:
    """Return von Mises kernels on a circle, with means in turns."""
    tables = (torch.tensor(one, dtype=torch.float64) for one in (means, kappas, weights))
    centers, kappa, shares = tables
    return AdaptiveKernels(space, centers[:, None] % 1, kappa[:, None], shares)


@given(st.floats(0, 360), st.floats(-1, 6), st.floats(0.02, 0.98), st.booleans())
@example(180.0, 2.0, 0.9, False)
@example(0.0, 2.0, 0.9, True)
@settings(max_examples=4, deadline=None)
def test_figures_of_a_circle_turn_with_it(mean, power, mass, from_zero) -> None:
    """Those of a von Mises density are scipy's about its mean, written as the data are."""
    kappa, first = 10.0**power, 0.0 if from_zero else -180.0
    space = Torus(1, unit="degrees", from_zero=[0] if from_zero else [])
    fitted = DensityEstimator.fitted(kernels(space, [mean / 360], [kappa], [1.0]))
    half = float(np.degrees(stats.vonmises.ppf((1 + mass) / 2, kappa)))
    tolerance = 1e-4 * half + 1e-9
    ((low, high),) = fitted.interval(mass)
    assert high - low == pytest.approx(2 * half, abs=tolerance)
    assert first <= low < first + 360
    assert ((low + high) / 2 - mean + 180) % 360 - 180 == pytest.approx(0, abs=tolerance)
    shares = np.array([(1 - mass) / 2, 0.5, (1 + mass) / 2])
    found = fitted.quantile(shares)
    assert ((found >= first) & (found < first + 360)).all()
    away = (found - mean + 180) % 360 - 180
    assert away == pytest.approx([-half, 0, half], abs=tolerance)
    assert fitted.cdf(found[:, None] + 360) == pytest.approx(shares, abs=1e-6)


def test_two_peaks_have_two_arcs_that_are_the_shortest_together() -> None:
    space = Torus(1, unit="degrees", from_zero=[0])
    density = kernels(space, [355 / 360, 0.5], [50.0, 200.0], [0.5, 0.5])
    (first, second) = shortest_intervals(density, 0.9)
    assert first[0] < 180 < first[1] < second[0] < 355 < 360 < second[1]
    grid = (np.arange(200_000) + 0.5) / 200_000
    shares = density.log_prob(torch.tensor(grid)[:, None]).exp().numpy() / 200_000
    least = np.searchsorted(np.cumsum(np.sort(shares)[::-1]), 0.9) / 200_000 * 360
    assert np.diff([first, second]).sum() == pytest.approx(least, abs=0.01)
    ends = np.array([*first, *second]) / 360
    heights = density.log_prob(torch.tensor(ends % 1)[:, None]).numpy()
    assert np.ptp(heights) < 1e-6


def test_a_real_column_has_the_shortest_interval_of_its_values() -> None:
    space = Torus([(10.0, 2.0)])
    density = UniformDensity(space)  # Student's t with four degrees of freedom
    for mass in (0.001, 0.5, 0.9, 0.999, 0.99999):
        ((low, high),) = shortest_intervals(density, mass)
        half = 2 * stats.t(4).ppf((1 + mass) / 2)
        assert (low, high) == pytest.approx((10 - half, 10 + half), rel=1e-3)


def test_a_uniform_circle_has_an_arc_and_no_mean_to_be_cut_by() -> None:
    even = UniformDensity(Torus(1, unit="degrees"))
    ((low, high),) = shortest_intervals(even, 0.9)
    assert high - low == pytest.approx(324)
    fitted = DensityEstimator.fitted(even)
    assert fitted.cdf([[-90.0], [0.0], [90.0]]) == pytest.approx([0.25, 0.5, 0.75], abs=1e-6)
    opposite = kernels(Torus(1, unit="degrees"), [0.0, 0.5], [20.0, 20.0], [0.5, 0.5])
    mixed = Mixture([opposite, even], torch.tensor([0.5, 0.5]))
    assert len(shortest_intervals(mixed, 0.5)) == 2


def test_intervals_are_of_a_mass_and_of_one_column() -> None:
    one = kernels(Torus(1), [0.5], [1e6], [1.0])
    for mass in (0.001, 0.999999):
        assert len(shortest_intervals(one, mass)) == 1
    for mass in (0.0, 1.0, 90.0):
        with refused("mass"):
            shortest_intervals(UniformDensity(Torus(1)), mass)
    with refused("marginal"):
        shortest_intervals(UniformDensity(Torus(2)), 0.5)


@pytest.mark.parametrize("shift", [0.0, 260.0])
def test_data_come_back_as_they_were_given(shift: float) -> None:
    """Samples and trends, of a pair of which one column is from 0."""
    rng = np.random.default_rng(1)
    signed = rng.normal(0, 25, (150, 1))
    around = (signed + shift + rng.normal(0, 5, (150, 1))) % 360
    around[:2] = [[1.0], [359.0]]
    data = np.concatenate([around, signed], axis=1)
    fitted = DensityEstimator(unit="degrees", components="kernels").fit(data)
    for rows in (fitted.sample(300, 0), fitted.marginal(0, 1).sample(300, 0)):
        assert ((rows[:, 0] >= 0) & (rows[:, 0] < 360)).all()
        assert (np.abs(rows[:, 1]) <= 180).all()
        assert (rows[:, 1] < 0).any()
    assert (fitted.conditional({1: 0.0}).sample(300, 0) >= 0).all()
    again = DensityEstimator(fitted.space_, components="kernels").fit(data)
    assert again.space_ == Torus(2, unit="degrees")
    assert again.kl_divergence(fitted).value == pytest.approx(0, abs=1e-9)
    mean = fitted.trend(0, 1, [-20.0, 0.0, 20.0]).mean
    assert ((mean >= 0) & (mean < 360)).all()


def test_samples_may_have_a_row_of_covariates_each() -> None:
    rng = np.random.default_rng(0)
    lengths, words = rng.uniform(0, 2, 120), rng.choice(["a", "b"], 120)
    angles = rng.vonmises(lengths + 2 * (words == "b"), 60.0)[:, None]
    fitted = DensityEstimator(unit="radians", components="kernels", effort="fast")
    fitted.fit(angles, given={"length": lengths, "word": words})
    wanted = np.repeat([0.2, 1.0, 1.8], 40)
    given = {"length": wanted, "word": "b"}
    apart = np.angle(np.exp(1j * (fitted.sample(120, 0, given=given)[:, 0] - wanted - 2)))
    assert np.abs(np.median(apart.reshape(3, 40), axis=1)).max() < 0.25
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame({"word": "b", "length": wanted})
    assert np.array_equal(fitted.sample(120, 0, given=frame), fitted.sample(120, 0, given=given))
    assert fitted.sample(4, 0, given=frame[:1]).shape == (4, 1)
    for count in (1, 119):
        with refused("120"):
            fitted.sample(count, 0, given=given)
