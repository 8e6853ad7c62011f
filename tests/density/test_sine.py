"""The bivariate von Mises density with sines: constant, marginals, fits."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from density.blends import even_grid, numbers
from orbiflow.density import DensityEstimator, VonMisesSine, conditional, fit_parametric, make_space
from refusals import refused

SHAPES = st.tuples(st.floats(0.05, 40), st.floats(0.05, 40), st.floats(-30, 30))


@given(SHAPES)
@settings(max_examples=20, deadline=None)
def test_the_integral_is_one_and_marginals_are_integrals(shape: tuple[float, ...]) -> None:
    density = VonMisesSine(make_space("torus"), numbers(0.1, 0.7), numbers(*shape))
    heights = density.log_prob(even_grid(120, 2)).exp().reshape(120, 120)
    assert float(heights.mean()) == pytest.approx(1, abs=1e-9)
    line = even_grid(120, 1)
    for axis in (0, 1):
        own = density.log_marginal(line, [axis]).exp()
        assert torch.allclose(own, heights.mean(dim=1 - axis), atol=1e-8)


@given(st.integers(0, 10**6))
@settings(max_examples=2, deadline=None)
def test_parameters_are_found_again(seed: int) -> None:
    rng, space = np.random.default_rng(seed), make_space("torus", unit="degrees")
    shape = [*rng.uniform(1, 20, 2).tolist(), 0.0]
    shape[2] = float(rng.uniform(-0.9, 0.9) * math.sqrt(shape[0] * shape[1]))
    density = VonMisesSine(space, torch.tensor(rng.uniform(size=2)), numbers(*shape))
    points = density.sample((1500,), torch.Generator().manual_seed(seed))
    found = fit_parametric(space, points, "von-mises-sine", columns=["phi", "psi"])[1].parametric
    assert found is not None
    truth = [*space.from_chart(density.means[None])[0].tolist(), *shape]
    names = ("mean_phi", "mean_psi", "concentration_phi", "concentration_psi", "dependence")
    assert tuple(one.name for one in found.parameters) == names
    for one, exact in zip(found.parameters, truth, strict=True):
        assert one.error is not None
        off = one.value - exact
        off -= 360 * round(off / 360) if one.unit else 0
        assert abs(off) < 5.5 * one.error


def test_what_is_given() -> None:
    density = VonMisesSine(make_space("torus"), numbers(0.2, 0.9), numbers(3, 5, 6))  # of two modes
    line = even_grid(200, 1)
    both = torch.cat([line, torch.full_like(line, 0.3)], dim=1)
    logs = density.log_prob(both) - density.log_marginal(both[:1, 1:], [1])
    known = conditional(density, {1: 0.3})
    assert torch.allclose(known.log_prob(line), logs, atol=1e-9)


def test_beside_independent_angles_and_refusals() -> None:
    rng = np.random.default_rng(0)
    one = rng.vonmises(0, 4, 400)
    pair = np.stack([one, one + rng.vonmises(1, 6, 400)], axis=1)
    fits = {
        name: DensityEstimator("torus", components=name).fit(pair).report_.parametric
        for name in ("von-mises", "von-mises-sine")
    }
    alone, together = fits.values()
    assert alone is not None
    assert together is not None
    assert together.aic < alone.aic - 50
    assert together["dependence"].low is not None
    assert together["dependence"].low > 0
    with refused("von-mises"):
        fit_parametric(make_space("torus", axes=3), torch.rand(20, 3), "von-mises-sine")
    with refused("torus", "angles"):
        VonMisesSine(make_space("sphere"), numbers(0, 0), numbers(1, 1, 0))
    with refused("three", "parameters"):
        VonMisesSine(make_space("torus"), numbers(0, 0), numbers(1, 1))
