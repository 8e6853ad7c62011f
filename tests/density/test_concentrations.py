"""Constants, moments and concentrations of von Mises-Fisher densities, against mpmath."""

import math
from typing import Any

import mpmath
import numpy as np
import pytest
import torch
from hypothesis import example, given, settings
from hypothesis import strategies as st

from orbiflow.density import DensityEstimator
from orbiflow.density.fitting import concentration, goodness, parametric
from orbiflow.density.models import concentration_for, kernel_peaks, log_fisher_bingham, moments
from orbiflow.density.spaces import Hypersphere
from refusals import refused

WIDTHS = st.integers(2, 65)
KAPPAS = st.floats(-12, 8).map(lambda power: 10.0**power)


def number(value: float) -> torch.Tensor:
    return torch.tensor(value, dtype=torch.float64)


def log_bessel(order: Any, kappa: float) -> Any:
    """Return log I(kappa) - kappa by its power series or, far out, Hankel's."""
    order, k = mpmath.mpf(order), mpmath.mpf(kappa)
    term = total = mpmath.mpf(1)
    j = 1
    if k > max(100, 3 * order**2):
        while abs(term) > 1e-38:
            term *= ((2 * j - 1) ** 2 - 4 * order**2) / (8 * k * j)
            total += term
            j += 1
        return mpmath.log(total) - mpmath.log(2 * mpmath.pi * k) / 2
    while term > total * 1e-40:
        term *= k * k / 4 / (j * (order + j))
        total += term
        j += 1
    return order * mpmath.log(k / 2) - mpmath.loggamma(order + 1) + mpmath.log(total) - k


def exact(kappa: float, width: int) -> tuple[float, float, float, float]:
    """Return the log mass, the mean cosine, 1 less it, and its variance."""
    with mpmath.workdps(60):
        order = mpmath.mpf(width) / 2 - 1
        log, after = (log_bessel(order + more, kappa) for more in (0, 1))
        mass = log - order * mpmath.log(kappa) + (order + 1) * mpmath.log(2 * mpmath.pi)
        mean = mpmath.exp(after - log)
        variance = 1 - mean**2 - (width - 1) * mean / kappa
        return float(mass), float(mean), float(1 - mean), float(variance)


@given(WIDTHS, KAPPAS)
@example(48, 1e-12)
@example(65, 1e-9)
@example(256, 1e-12)
@example(257, 3.0)
@example(1025, 700.0)
@example(4, 1e16)
@settings(max_examples=25, deadline=None)
def test_moments_have_all_their_digits(width: int, kappa: float) -> None:
    mass, mean, below, variance = exact(kappa, width)
    at = number(kappa).requires_grad_()
    found = moments(at, width)
    (slope,) = torch.autograd.grad(found.log_mass, at)
    assert float(found.log_mass.detach()) == pytest.approx(mass, rel=1e-13, abs=1e-12)
    assert float(found.mean.detach()) == pytest.approx(mean, rel=1e-12)
    assert float(found.below.detach()) == pytest.approx(below, rel=1e-12)
    assert float(slope) == pytest.approx(-below, rel=1e-11)
    assert float(found.across.detach()) == pytest.approx(mean / kappa, rel=1e-12)
    assert float(found.along.detach()) == pytest.approx(variance, rel=1e-7)


@given(WIDTHS, KAPPAS)
@example(48, 1e-12)
@settings(max_examples=40, deadline=None)
def test_concentrations_come_back_from_their_means(width: int, kappa: float) -> None:
    _, mean, below, _ = exact(kappa, width)
    assert float(concentration_for(number(mean), number(below), width)) == pytest.approx(kappa)
    alone = concentration(mean, width, below)
    if mean > 1e-12:
        assert alone == pytest.approx(kappa)
    if 1e-3 < mean < 0.9:
        assert concentration(mean, width) == pytest.approx(kappa, rel=1e-4)
    peaks = kernel_peaks(Hypersphere(width - 1), number(kappa)[None, None])
    assert float(peaks) == pytest.approx(-exact(kappa, width)[0], rel=1e-13, abs=1e-12)


@given(st.integers(3, 65), st.integers(1, 64), st.floats(0, math.log(1e6)))
@example(65, 1, math.log(56.23))
@example(65, 64, math.log(562.3))
@settings(max_examples=80, deadline=None)
def test_constants_of_repeated_eigenvalues_are_kummers_function(width, repeats, log: float) -> None:
    """Many low eigenvalues lift the integrand on a contour about the highest alone."""
    size, repeats = math.exp(log), 1 + repeats % (width - 1)
    values = torch.zeros(width, dtype=torch.float64)
    values[:repeats] = size
    with mpmath.workdps(30):
        half = mpmath.mpf(width) / 2
        log_area = mpmath.log(2) + half * mpmath.log(mpmath.pi) - mpmath.loggamma(half)
        kummer = mpmath.log(mpmath.hyp1f1(mpmath.mpf(repeats) / 2, half, size))
    found = float(log_fisher_bingham(values, torch.zeros_like(values)))
    assert found == pytest.approx(float(log_area + kummer), rel=2e-15, abs=1e-12)


def test_rows_of_many_coordinates_have_a_von_mises_fisher_density(monkeypatch) -> None:
    width = 60
    monkeypatch.setattr(parametric, "DRAWS", 500)
    monkeypatch.setattr(goodness, "RESAMPLES", 19)
    rng = np.random.default_rng(width)
    rows = np.eye(width)[0] + 0.02 * rng.normal(size=(90, width))
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    fit = DensityEstimator("hypersphere", components="von-mises-fisher").fit(rows)
    found = fit.parameters()["concentration"]
    length = float(np.linalg.norm(rows.mean(axis=0)))
    assert exact(found.value, width)[1] == pytest.approx(length, rel=1e-9)
    assert found.low is not None
    assert found.high is not None
    assert found.low < 1 / 0.02**2 < found.high
    assert found.low < found.value < found.high


def test_too_many_coordinates_are_refused_as_such() -> None:
    rows = np.eye(100)[:80]
    with refused("65", "100"):
        DensityEstimator("hypersphere").fit(rows)
