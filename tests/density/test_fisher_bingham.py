"""Fisher-Bingham and angular central Gaussian densities: their constants, and what they refuse."""

from typing import Any

import mpmath
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import vonmises_fisher

from density.blends import numbers
from orbiflow.density import AngularCentralGaussian, FisherBingham, make_space
from orbiflow.density.models import log_fisher_bingham
from refusals import refused

mpmath.mp.dps = 30
WIDTHS = st.sampled_from([2, 3, 4, 7, 20, 65])
CONCENTRATIONS = st.floats(-3, 5).map(lambda power: 10.0**power)


@given(WIDTHS, CONCENTRATIONS)
@settings(max_examples=40, deadline=None)
def test_constant_of_von_mises_fisher_is_a_bessel_function(width: int, kappa: float) -> None:
    vector = torch.zeros(width, dtype=torch.float64)
    vector[-1] = kappa
    order = mpmath.mpf(width) / 2 - 1
    exact = (order + 1) * mpmath.log(2 * mpmath.pi) - order * mpmath.log(kappa)
    exact += mpmath.log(mpmath.besseli(order, kappa))
    found = float(log_fisher_bingham(torch.zeros_like(vector), vector))
    assert abs(found - float(exact)) < 2e-13 + 1e-15 * kappa


@pytest.mark.parametrize(("kappa", "beta"), [(138, 84), (20, 30), (1e4, 6e3)])
def test_constant_of_two_modes(kappa: float, beta: float) -> None:
    """Where a component of a lies across the highest eigenvalue, another contour may be needed."""

    def density(z: Any) -> Any:
        return mpmath.exp(kappa * z) * mpmath.besseli(0, beta * (1 - z * z))

    top = kappa / (2 * beta)
    ends = sorted({-1.0, max(-1, top - 0.2), min(1.0, top), min(1.0, top + 0.2), 1.0})
    exact = float(mpmath.log(2 * mpmath.pi * mpmath.quad(density, ends)))
    shape = numbers(kappa, beta)

    def log(k: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
        none = torch.zeros_like(k)
        return log_fisher_bingham(torch.stack([none, b, -b]), torch.stack([k, none, none]))

    assert float(log(*shape)) == pytest.approx(exact, abs=1e-11)
    shape.requires_grad_()
    (slopes,) = torch.autograd.grad(log(*shape), shape)
    for k in range(2):
        step = 1e-4 * shape.detach() * torch.eye(2)[k]
        at = shape.detach()
        change = log(*(at + step)) - log(*(at - step))
        assert float(slopes[k]) == pytest.approx(float(change / (2 * step[k])), rel=1e-4)


@given(st.lists(st.floats(-1, 1), min_size=6, max_size=6), st.floats(-1, 2.3))
@settings(max_examples=40, deadline=None)
def test_constant_of_any_density_on_the_sphere(shares: list[float], power: float) -> None:
    own = np.array(shares) * 10**power
    z, weights = np.polynomial.legendre.leggauss(300)
    turns = 2 * np.pi * np.arange(300) / 300
    flat = np.sqrt(1 - z**2)[:, None]
    x = np.stack([flat * np.cos(turns), flat * np.sin(turns), z[:, None] + 0 * turns], axis=-1)
    logs = x**2 @ own[:3] + x @ own[3:]
    exact = logs.max() + np.log(2 * np.pi * weights @ np.exp(logs - logs.max()).mean(axis=1))
    found = log_fisher_bingham(torch.tensor(own[:3]), torch.tensor(own[3:]))
    assert float(found) == pytest.approx(exact, abs=1e-10)


@given(st.lists(st.floats(-50, 50), min_size=3, max_size=5), st.floats(-100, 100), st.floats(0, 20))
@settings(max_examples=30, deadline=None)
def test_constant_moves_with_its_eigenvalues(values: list[float], shift, length) -> None:
    own = numbers(*values)
    vector = torch.full_like(own, length)
    found = log_fisher_bingham(own, vector)
    assert float(log_fisher_bingham(own + shift, vector) - shift - found) == pytest.approx(
        0, abs=1e-11
    )
    # the gradient is the mean of the squares, whose sum is 1
    own.requires_grad_()
    (means,) = torch.autograd.grad(log_fisher_bingham(own, vector), own)
    assert float(means.sum()) == pytest.approx(1, abs=1e-10)
    assert bool((means > 0).all())


def test_directions_agree_with_scipy() -> None:
    space, mean = make_space("sphere"), numbers(0.6, 0, 0.8)
    density = FisherBingham(space, 7 * mean, torch.zeros(3, 3))
    other = vonmises_fisher(mean.numpy(), 7)
    points = other.rvs(50, random_state=3)
    found = density.log_prob(space.to_chart(points), measure="natural").numpy()
    assert np.abs(found - other.logpdf(points)).max() < 1e-9


def test_refusals() -> None:
    with refused("direction", "spaces"):
        FisherBingham(make_space("projective-plane"), numbers(0, 0, 1), torch.zeros(3, 3))
    with refused("symmetric"):
        FisherBingham(make_space("sphere"), torch.zeros(3), torch.eye(3).cumsum(0))
    with refused("3 by 3"):
        FisherBingham(make_space("sphere"), torch.zeros(4), torch.zeros(4, 4))
    with refused("positive", "definite"):
        AngularCentralGaussian(make_space("sphere"), -torch.eye(3))
    with refused("spaces"):
        FisherBingham(make_space("torus"), torch.zeros(3), torch.zeros(3, 3))
    with refused("spaces"):
        AngularCentralGaussian(make_space("rotation-space", symmetry="O"), torch.eye(4))
