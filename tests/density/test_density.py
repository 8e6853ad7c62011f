"""Densities of flows: their mass, samples and entropy, in blocks and on any number of cores."""

from collections.abc import Callable

import numpy as np
import pytest
import scipy.stats
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

import orbiflow.density as od
from density.blends import bump
from orbiflow.density.models import midpoints
from orbiflow.fields import FourierField
from orbiflow.flows import Flow
from refusals import refused

SPACES = (od.Torus(2), od.Sphere(), od.KleinBottle(), od.ProjectivePlane())
every = pytest.mark.parametrize("space", SPACES, ids=lambda s: s.name)
seeds = st.integers(0, 2**32 - 1)


def make(
    space,
    seed: int = 0,
    *,
    base: Callable[[od.Space], od.Density] = od.UniformDensity,
    segments: int = 2,
    strength: float = 0.1,
):
    fields = []
    for k in range(segments):
        field = FourierField(space.group, 3, smoothness=1.0)
        generator = torch.Generator().manual_seed(seed + k)
        noise = torch.randn(field.size, generator=generator, dtype=torch.float64)
        field.parameters_.data.copy_(strength * noise / noise.norm())  # of rms `strength` at most
        fields.append(field)
    return od.FlowDensity(space, Flow(fields, steps=4, warn=False), base(space))


def square(seed: int, count: int = 40, dim: int = 2) -> torch.Tensor:
    return torch.tensor(np.random.default_rng(seed).random((count, dim)))


@torch.no_grad()
def on_a_plain_grid(density: od.Density, side: int = 64) -> float:
    # of what `make` gives by itself, 160 points a side change it by less than 1e-6
    return float(density.log_prob(midpoints(density.space, side)).exp().mean())


@every
@settings(max_examples=1)
@given(seed=seeds, base=st.sampled_from([od.UniformDensity, bump]))
def test_it_integrates_to_one(space, seed: int, base) -> None:
    density = make(space, seed, base=base)
    assert on_a_plain_grid(density) == pytest.approx(1.0, abs=1e-3)
    assert density.mass(32) == pytest.approx(1.0, abs=1e-3)


@every
@settings(max_examples=1)
@given(seed=seeds)
def test_the_mass_tells_what_the_integrator_lost(space, seed: int) -> None:
    density = make(space, seed, strength=0.2).with_steps(1)
    plain = on_a_plain_grid(density, 96)
    assert density.mass(64) == pytest.approx(plain, abs=1e-4 + 0.1 * abs(plain - 1))


@every
def test_samples_follow_the_density(space) -> None:
    density = make(space, 7, base=bump, strength=0.12)
    count, cells = 6_000, 6
    points = density.sample((count,), torch.Generator().manual_seed(1))
    assert bool(((points >= 0) & (points <= 1)).all())
    edges = torch.linspace(0, 1, cells + 1).double()
    observed = torch.histogramdd(points, [edges, edges]).hist.flatten().numpy()
    with torch.no_grad():
        values = density.log_prob(midpoints(space, 10 * cells)).exp()
    expected = values.reshape(cells, 10, cells, 10).mean(dim=(1, 3)).flatten().numpy()
    expected *= count / expected.sum()
    assert scipy.stats.chisquare(observed, expected).pvalue > 1e-4
    assert expected.max() > 1.5 * expected.min()  # a test that an even density would fail


def test_gradients_reach_the_parameters() -> None:
    density = make(od.Sphere(), 3)
    parameters = list(density.flow.parameters())
    loss = -density.log_prob(square(0)).mean() + density.rsample((20,)).square().mean()
    assert all(float(g.norm()) > 0 for g in torch.autograd.grad(loss, parameters))


@pytest.mark.parametrize(("space", "measure"), list(zip(SPACES, od.MEASURES, strict=False)))
def test_entropy_is_the_mean_of_minus_log_prob(space, measure: str) -> None:
    density, named = make(space, 1), {"measure": measure}
    found = density.entropy(200, generator=torch.Generator().manual_seed(5), **named)
    with torch.no_grad():
        drawn = density.sample((200,), torch.Generator().manual_seed(5))
        assert float(found) == pytest.approx(-float(density.log_prob(drawn, **named).mean()))
        grid = midpoints(space, 64)
        square, same = density.log_prob(grid), density.log_prob(grid, **named)
    exact = -float((square.exp() * same).mean())
    many = density.entropy(3_000, generator=torch.Generator().manual_seed(6), **named)
    assert float(many) == pytest.approx(exact, abs=0.05)


def test_large_batches_are_the_same_in_blocks(monkeypatch) -> None:
    density, points = make(od.KleinBottle()), square(0, 60).reshape(3, 20, 2)
    with torch.no_grad():
        whole = density.log_prob(points)
        monkeypatch.setattr("orbiflow.density.models.flow.BLOCK_POINTS", 7)
        assert torch.allclose(density.log_prob(points), whole)
        draws = [density.sample((4, 5), torch.Generator().manual_seed(3)) for _ in range(2)]
    assert torch.equal(*draws)
    assert draws[0].shape == (4, 5, 2)


@pytest.mark.parametrize("count", [1, 3])
def test_many_points_are_the_same_on_any_number_of_cores(count: int, monkeypatch) -> None:
    density, points = make(od.KleinBottle()), square(0, 60).reshape(3, 20, 2)
    with torch.no_grad():
        whole = density.log_prob(points, measure="natural")
        monkeypatch.setattr("orbiflow.density.models.density.BLOCK_POINTS", 7)
        monkeypatch.setattr("orbiflow.runtime.side_by_side.cores", lambda: count)
        found = density.log_prob(points, measure="natural")
    torch.testing.assert_close(found, whole, rtol=0, atol=1e-12)
    assert not found.requires_grad
    assert found.shape == (3, 20)


def test_what_is_refused() -> None:
    with refused("points", "5", "3"):
        make(od.Torus(2)).log_prob(torch.zeros(5, 3))
    with refused("resolution", "21"):
        od.FlowDensity(od.Torus(6), Flow(lambda x: 0 * x)).mass()
