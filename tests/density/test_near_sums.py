"""Sums of kernels by tiles against sums of all: values, gradients, on every space, at every width."""

import math

import numpy as np
import pytest
import torch
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from orbiflow.density.models import sums as near_sums
from orbiflow.density.models.sums import Terms, near_log_sum

SHAPES = {"one angle": (1, 2), "two angles": (2, 2), "three angles": (3, 2), "sphere": (1, 3)}
shapes, seeds = st.sampled_from(sorted(SHAPES)), st.integers(0, 2**31)


@pytest.fixture(autouse=True)
def eager(monkeypatch: pytest.MonkeyPatch) -> None:
    """All that is done for many points and terms is done for few."""
    few = {"FEWEST_PAIRS": 0, "FEW_POINTS": 16, "FEW_PAIRS": 0}
    for name, value in few.items():
        monkeypatch.setattr(near_sums, name, value)


def on_spheres(shape: str, places: torch.Tensor) -> torch.Tensor:
    """Features (m, N) of angles (F, N), or of vectors (3, N)."""
    if shape == "sphere":
        return places / places.norm(dim=0)
    return torch.cat([places.cos(), places.sin()])


def drawn(shape: str, seed: int, count: int, points: int) -> tuple[Terms, torch.Tensor]:
    """Clustered terms of widths from wide to narrow, and points near them and anywhere."""
    rng = np.random.default_rng(seed)
    factors, size = SHAPES[shape]
    rows = 3 if shape == "sphere" else factors
    middles = rng.normal(size=(rows, 12)) * (1 if shape == "sphere" else 3)
    spread = 10 ** rng.uniform(-3, 0, 12)

    def near(number: int) -> torch.Tensor:
        which = rng.integers(12, size=number)
        return torch.tensor(middles[:, which] + spread[which] * rng.normal(size=(rows, number)))

    top = rng.uniform(0, 6)
    terms = Terms(
        on_spheres(shape, near(count)),
        torch.tensor(10 ** rng.uniform(-1, top, (factors, count))),
        torch.tensor(rng.normal(0, 3, count)),
    )
    away = torch.tensor(rng.normal(size=(rows, points // 2)) * 3)
    assert size * factors == len(terms.centers)
    return terms, torch.cat(
        [on_spheres(shape, near(points - points // 2)), on_spheres(shape, away)], 1
    )


def by_all(terms: Terms, features: torch.Tensor) -> torch.Tensor:
    """The sum of all terms, without cancellation."""
    parts = []
    for block in features.split(64, dim=1):
        square = (block[:, :, None] - terms.centers[:, None]) ** 2
        square = square.reshape(-1, terms.factors, *square.shape[1:]).sum(dim=0)
        parts.append(
            (terms.peaks - (terms.kappa[:, None] / 2 * square).sum(dim=0)).logsumexp(dim=1)
        )
    return torch.cat(parts)


@given(shapes, seeds, st.booleans())
@example("two angles", 840533841, False)  # one narrow term in a tile of 14 points, 0.7 wide
@settings(
    max_examples=7, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_the_sum_is_that_of_all_terms(shape: str, seed: int, floored: bool) -> None:
    terms, features = drawn(shape, seed, 500, 900)
    floor = 0.0 if floored else -math.inf
    found = near_log_sum(terms, features, floor)
    expected = by_all(terms, features)
    beside = torch.tensor(floor, dtype=torch.float64)
    off = torch.logaddexp(found, beside) - torch.logaddexp(expected, beside)
    # rounding: an exponent of size E is known to E / 2^52; tiles of few points may stay as wide as the
    # spheres, where exponents are as large as the concentrations of the terms that count
    weighed = terms._replace(peaks=terms.peaks + terms.kappa.sum(dim=0).log())
    concentration = (by_all(weighed, features) - expected).exp()
    assert bool((off.abs() <= 4e-12 + 1e-15 * (expected.abs() + concentration)).all())


@pytest.mark.parametrize("shape", SHAPES)
def test_few_are_summed_at_once(shape: str, monkeypatch: pytest.MonkeyPatch) -> None:
    terms, features = drawn(shape, 5, 30, 40)
    tiled = near_log_sum(terms, features)
    monkeypatch.setattr(near_sums, "FEWEST_PAIRS", 30 * 40 + 1)
    torch.testing.assert_close(near_log_sum(terms, features), tiled, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("shape", ["one angle", "two angles", "sphere"])
@pytest.mark.parametrize("kappa", [1e-6, 0.5, 3.0, 30.0, 1000.0])
def test_smooth_terms_are_summed_to_rounding(shape: str, kappa: float) -> None:
    terms, _ = drawn(shape, 1, 600, 10)
    terms = terms._replace(
        kappa=torch.full_like(terms.kappa, kappa), peaks=torch.zeros(600).double()
    )
    rng = np.random.default_rng(2)
    rows = 3 if shape == "sphere" else terms.factors
    features = on_spheres(shape, torch.tensor(rng.normal(size=(rows, 2_500)) * 3))
    found = near_log_sum(terms, features)
    some = torch.randperm(2_500)[:400]
    expected = by_all(terms, features[:, some])
    assert bool(((found[some] - expected).abs() <= 4e-12 + 2e-15 * expected.abs()).all())


@given(shapes, seeds)
@settings(
    max_examples=5, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_the_gradient_is_that_of_all_terms(shape: str, seed: int) -> None:
    terms, features = drawn(shape, seed, 400, 600)
    features = features.clone().requires_grad_()
    (found,) = torch.autograd.grad(near_log_sum(terms, features).sum(), features)
    some = torch.randperm(600)[:200]
    chosen = features.detach()[:, some].requires_grad_()
    (expected,) = torch.autograd.grad(by_all(terms, chosen).sum(), chosen)
    # features stay on their spheres: what leads away from them does not matter
    across = tangent(found[:, some] - expected, chosen.detach(), terms.factors)
    size = tangent(expected, chosen.detach(), terms.factors).norm(dim=0)
    steep = terms.kappa.max().sqrt() + size
    assert bool((across.norm(dim=0) <= 1e-9 * steep).all())


def test_second_derivatives_are_there() -> None:
    terms, features = drawn("two angles", 3, 60, 8)
    terms = terms._replace(kappa=terms.kappa.clamp_max(100.0))
    angles = torch.atan2(features[2:], features[:2]).requires_grad_()

    def function(x: torch.Tensor) -> torch.Tensor:
        return near_log_sum(terms, torch.cat([x.cos(), x.sin()]))

    assert torch.autograd.gradgradcheck(function, (angles,), atol=1e-4)


def test_no_points_have_no_sums() -> None:
    terms, features = drawn("sphere", 0, 20, 10)
    assert near_log_sum(terms, features[:, :0]).shape == (0,)


def tangent(slope: torch.Tensor, features: torch.Tensor, factors: int) -> torch.Tensor:
    """Gradients (m, N) less what points away from the spheres."""
    parts, at = (x.reshape(-1, factors, x.shape[1]) for x in (slope, features))
    return (parts - (parts * at).sum(dim=0) * at).flatten(0, 1)
