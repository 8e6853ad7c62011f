"""Means, modes, masses, entropies and divergences of densities, against closed forms and draws."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, stats

from orbiflow.density import AdaptiveKernels, DensityEstimator, Torus, UniformDensity, make_space
from refusals import refused

ONE = torch.ones(1, dtype=torch.float64)


def von_mises(turns: float, kappa: float) -> AdaptiveKernels:
    """A von Mises distribution of one angle."""
    space = make_space("torus", axes=1)
    return AdaptiveKernels(space, turns * ONE[None], kappa * ONE[:, None], ONE)


@pytest.fixture(scope="module", name="pair")
def pair_fixture() -> DensityEstimator:
    rng = np.random.default_rng(0)
    data = np.concatenate([rng.vonmises([0.5, -2.0], 6, (90, 2)), rng.vonmises(2.5, 9, (60, 2))])
    return DensityEstimator("torus", components="kernels,mixture,chains").fit(data)


@settings(max_examples=4)
@given(st.floats(0, 1), st.floats(0.1, 5000), st.floats(-0.49, 0.49))
def test_masses_of_a_von_mises_distribution(turns: float, kappa: float, at: float) -> None:
    density = von_mises(turns, kappa)
    away = 2 * np.pi * ((at - turns + 0.5) % 1 - 0.5)  # the circle is cut opposite the mean
    true = stats.vonmises.cdf(away, kappa)
    found = density.cdf(at * ONE[None])
    assert float(found[0]) == pytest.approx(true, abs=1e-7)
    back = float(density.icdf(found)[0, 0])
    again = float(density.cdf(back * ONE[None])[0])
    assert (again - true + 0.5) % 1 - 0.5 == pytest.approx(0, abs=1e-7)  # both ends are one place
    apart = (float(density.mean[0]) - turns + 0.5) % 1 - 0.5
    assert abs(apart) < 1e-6
    apart = (float(density.mode[0]) - turns + 0.5) % 1 - 0.5
    assert abs(apart) < 1e-5


@settings(max_examples=4)
@given(st.floats(0.2, 300))
def test_entropies_and_divergences_lie_within_their_errors(kappa: float) -> None:
    one, other = von_mises(0.2, kappa), von_mises(0.3, 2.0)
    value, error = one.estimated_entropy(measure="natural")
    assert abs(value - stats.vonmises.entropy(kappa)) < 6 * error + 1e-9
    assert float(one.entropy()) == float(one.entropy())
    angles = np.linspace(-np.pi, np.pi, 20001)
    p, q = (
        stats.vonmises.logpdf(angles, k, loc=2 * np.pi * m) for k, m in ((kappa, 0.2), (2.0, 0.3))
    )
    true = integrate.trapezoid(np.exp(p) * (p - q), angles)
    value, error = one.divergence(other)
    assert abs(value - true) < 6 * error + 1e-9
    assert float(torch.distributions.kl_divergence(one, other)) == value


def test_of_data_means_and_modes_are_in_their_units(pair: DensityEstimator) -> None:
    drawn = pair.sample(3_000, random_state=0)
    directions = np.angle(np.exp(1j * drawn).mean(axis=0))
    assert np.abs(np.angle(np.exp(1j * (pair.mean() - directions)))).max() < 0.06
    top = pair.score_samples(pair.mode()[None])
    assert top[0] >= pair.score_samples(drawn).max() - 1e-9
    alone = pair.marginal(0)
    shares = np.sort(alone.cdf(drawn[:, :1]))
    assert np.abs(shares - (np.arange(3_000) + 0.5) / 3_000).max() < 0.03
    assert np.allclose(
        alone.cdf(alone.quantile([0.1, 0.5, 0.9])[:, None]), [0.1, 0.5, 0.9], atol=1e-6
    )
    assert pair.kl_divergence(pair) == (0.0, 0.0)
    assert pair.entropy().error < 0.01


def test_a_real_column_has_quantiles_and_a_mean() -> None:
    rng = np.random.default_rng(1)
    data = rng.normal(5, 2, (600, 1))
    fit = DensityEstimator(columns={0: "linear"}, components="kernels,mixture").fit(data)
    assert fit.mean()[0] == pytest.approx(data.mean(), abs=0.1)
    wanted = np.quantile(data, [0.05, 0.5, 0.95])
    assert fit.quantile([0.05, 0.5, 0.95]) == pytest.approx(wanted, abs=0.3)
    assert fit.entropy().value == pytest.approx(stats.norm(5, 2).entropy(), abs=0.08)
    other = DensityEstimator(columns={0: "linear"}, components="mixture").fit(data + 1.0)
    assert fit.kl_divergence(other).value == pytest.approx(1 / 8, abs=0.04)


def test_directions_have_a_mean_and_axes_have_none() -> None:
    rng = np.random.default_rng(2)
    data = np.column_stack([rng.normal(40, 8, 300), rng.normal(170, 12, 300)])
    fit = DensityEstimator("sphere", components="kernels").fit(data)
    assert np.abs(fit.mean() - data.mean(axis=0)).max() < 2
    assert np.abs(fit.mode() - data.mean(axis=0)).max() < 8
    for name in ("projective-plane", "klein-bottle"):
        with refused("mean"):
            _ = UniformDensity(make_space(name)).mean
    with refused("order"):
        fit.density_.cdf(torch.zeros(1, 2))
    with refused("marginal"):
        UniformDensity(make_space("torus")).cdf(torch.zeros(1, 2))
    with refused("compared"):
        fit.density_.divergence(UniformDensity(Torus([None, (0, 1)])))
    with refused("0", "1"):
        von_mises(0.1, 2.0).icdf(torch.tensor([1.5]))


def test_it_can_be_mapped_over_points(pair: DensityEstimator) -> None:
    points = torch.rand(7, 2, dtype=torch.float64)
    parts = [part for _, part in pair.density_.parts()]
    for density in (*parts, pair.density_):
        values = torch.func.vmap(density.log_prob)(points)
        assert torch.allclose(values, density.log_prob(points), atol=1e-12)
        slopes = torch.func.vmap(torch.func.grad(density.log_prob))(points)
        own = points.clone().requires_grad_()
        (wanted,) = torch.autograd.grad(density.log_prob(own).sum(), own)
        assert torch.allclose(slopes, wanted, atol=1e-9)


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_samples_may_be_frames(pair: DensityEstimator, library: str) -> None:
    module = pytest.importorskip(library)
    rows = pair.sample(5, random_state=0)
    frame = pair.set_output(transform=library).sample(5, random_state=0)
    assert isinstance(frame, module.DataFrame)
    assert list(frame.columns) == ["angle1", "angle2"]
    assert np.array_equal(np.asarray(frame), rows)
    assert pair.set_output(transform=None) is pair
    assert isinstance(pair.set_output(transform="default").sample(2), np.ndarray)
    with refused("transform"):
        pair.set_output(transform="excel")
