"""Adaptive kernels: what they refuse, fits by EM with many images, and their sums."""

import math
from functools import partial

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.density import AdaptiveKernels, Mixture, UniformDensity, make_space
from orbiflow.density.fitting import Rows, kernels
from orbiflow.density.fitting.orbits import MOST_SINGLE, Orbits
from orbiflow.density.models import log_sum_exp, shares_of
from orbiflow.density.spaces import RotationSpace, Space
from refusals import refused


def test_kernels_of_wrong_shape_are_refused() -> None:
    space = make_space("sphere")
    one = torch.ones(4, dtype=torch.float64) / 4
    with refused("fit"):
        AdaptiveKernels(space, torch.rand(4, 2), torch.ones(4, 2), one)
    with refused("positive", "widths"):
        AdaptiveKernels(space, torch.rand(4, 2), -torch.ones(4, 1), one)
    with refused("positive", "2"):
        Mixture([UniformDensity(space), UniformDensity(space)], torch.ones(2))


def rows_of(space: Space, count: int, *, weighted: bool, seed: int = 0) -> Rows:
    generator = torch.Generator().manual_seed(seed)
    points = space.uniform(count, generator)
    weights = torch.rand(count, generator=generator, dtype=torch.float64) + 0.5
    return Rows(points, weights if weighted else None)


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize(("crystal", "specimen"), [("m-3m", "222"), ("6/mmm", None)])
@pytest.mark.parametrize("kappa", [0.01, 30.0, 900.0, 1e5])
def test_a_step_is_that_of_all_images(
    crystal: str, specimen: str | None, weighted: bool, kappa: float
) -> None:
    space = make_space("rotation-space", symmetry=crystal, specimen=specimen)
    assert isinstance(space, RotationSpace)
    rows = rows_of(space, 400, weighted=weighted)
    mean = space.features(rows.points[:5], slice(1))[0]
    sharp = torch.full((5, 1), kappa, dtype=torch.float64) * torch.linspace(0.5, 1.0, 5)[:, None]
    weights = torch.tensor([0.1, 0.2, 0.3, 0.15, 0.25], dtype=torch.float64)
    _, _, away, step = kernels._by_images(space, rows, 5)
    orbits = Orbits(space, rows.points, rows.weights)
    assert torch.allclose(orbits.away(7), away(7), atol=1e-12)
    found, true = orbits.expectation(mean, sharp, weights), step(mean, sharp, weights)
    for own, other in zip(found[:3], true[:3], strict=True):
        assert torch.allclose(own, other, rtol=2e-3, atol=2e-3)
    assert found[3] == pytest.approx(true[3], rel=1e-4)
    if kappa >= 2 * MOST_SINGLE:
        assert found[3] == pytest.approx(true[3], rel=1e-9)


def test_mixtures_are_as_good_as_with_all_images(monkeypatch: pytest.MonkeyPatch) -> None:
    space = make_space("rotation-space", symmetry="432", specimen="222")
    truth = kernels.even_kernels(
        space, space.uniform(3, torch.Generator().manual_seed(4)), 60.0, torch.full((3,), 1 / 3)
    )
    draw = partial(truth.sample, generator=torch.Generator().manual_seed(5))
    rows, fresh = Rows(draw(1_500)), draw(1_000)
    monkeypatch.setattr(kernels, "FIRST_ROWS", 300)
    scores = []
    for many in (8, 10**9):
        monkeypatch.setattr(kernels, "MANY_IMAGES", many)
        fit = kernels.fit_mixture(space, rows, 4, generator=torch.Generator().manual_seed(6))
        scores.append(float(fit.log_prob(fresh).mean()))
    assert scores[0] == pytest.approx(scores[1], abs=0.02)
    assert scores[0] == pytest.approx(float(truth.log_prob(fresh).mean()), abs=0.05)


seeds_of_sums = st.integers(0, 2**31 - 1)
sizes = st.floats(0.0, 6.0)


def table(seed: int, size: float, dtype: torch.dtype = torch.float64) -> torch.Tensor:
    """Logarithms (7, 30) of either sign, up to 10^size."""
    generator = torch.Generator().manual_seed(seed)
    return 10**size * torch.randn(7, 30, generator=generator, dtype=dtype)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@given(seed=seeds_of_sums, size=sizes)
def test_they_are_those_of_torch(dtype: torch.dtype, seed: int, size: float) -> None:
    given_ = table(seed, size, dtype)
    kept = given_.clone()
    torch.testing.assert_close(log_sum_exp(given_), given_.logsumexp(dim=-1))
    torch.testing.assert_close(shares_of(given_), given_.softmax(dim=-1), rtol=1e-5, atol=1e-30)
    assert torch.equal(given_, kept)


@given(seed=seeds_of_sums, size=st.floats(0.0, 1.5))
def test_gradients_are_shares(seed: int, size: float) -> None:
    given_ = table(seed, size).requires_grad_()
    (gradient,) = torch.autograd.grad(log_sum_exp(given_).sum(), given_)
    assert torch.allclose(gradient, given_.softmax(dim=-1), atol=1e-30)


def test_terms_that_are_nothing() -> None:
    empty = -math.inf
    assert log_sum_exp(torch.tensor([empty, 1.0, empty])).item() == pytest.approx(1.0)
    nothing = log_sum_exp(torch.tensor([empty, empty]))
    assert math.isfinite(nothing)
    assert nothing < -1e38
    assert math.isnan(log_sum_exp(torch.tensor([0.0, math.nan])))
