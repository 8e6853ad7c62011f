"""Adaptive kernels, alone and beside a flow: invariant, normalised, sampled as they score."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from density.blends import kernels_of
from orbiflow.density import (
    AdaptiveKernels,
    FlowDensity,
    FlowSettings,
    Mixture,
    UniformDensity,
    blend_kernels,
    density_to_bytes,
    fit_density,
    make_space,
    midpoints,
    read_density,
)
from orbiflow.density.fitting.kernels import FLOOR, proportions
from orbiflow.errors import OrbiflowError
from orbiflow.fields import SplineField
from orbiflow.flows import Flow

SPACES = ("torus", "sphere", "klein-bottle", "projective-plane")
names, seeds = st.sampled_from(SPACES), st.integers(0, 2**31)


def kernels(name: str, seed: int, low: float = 2.0, high: float = 60.0) -> AdaptiveKernels:
    """Five random kernels."""
    space = make_space(name)
    torch.manual_seed(seed)
    width = 1 if space.is_round else 2
    return AdaptiveKernels(
        space,
        torch.rand(5, 2, dtype=torch.float64),
        low + (high - low) * torch.rand(5, width, dtype=torch.float64),
        torch.softmax(torch.randn(5, dtype=torch.float64), dim=0),
    )


def clustered(name: str, count: int = 600) -> torch.Tensor:
    """Points in tight clusters, canonical."""
    torch.manual_seed(3)
    space = make_space(name)
    centers = torch.rand(40, 2, dtype=torch.float64)
    noise = 0.003 * torch.randn(count, 2, dtype=torch.float64)
    return space.project(centers[torch.randint(40, (count,))] + noise)


@given(names, seeds)
@settings(max_examples=20, deadline=None)
def test_kernels_integrate_to_one_and_are_invariant(name: str, seed: int) -> None:
    found = kernels(name, seed)
    grid = midpoints(found.space, 200)
    assert float(found.log_prob(grid).exp().mean()) == pytest.approx(1, abs=2e-3)
    points = 4 * torch.rand(50, 2, dtype=torch.float64) - 2
    for element in found.space.group.cosets:
        if found.space.is_round:
            images, points = found.space.project(element(points)), found.space.project(points)
        else:
            images = element(points)
        assert torch.allclose(found.log_prob(images), found.log_prob(points), atol=1e-8)


@pytest.mark.parametrize("name", SPACES)
def test_samples_follow_the_density(name: str) -> None:
    found = kernels(name, 5)
    count, cells = 20_000, 8
    drawn = found.sample(count, torch.Generator().manual_seed(0))
    counts = torch.bincount(
        ((drawn * cells).floor().long() @ torch.tensor([cells, 1])), minlength=64
    )
    grid = midpoints(found.space, 160)
    mass = found.log_prob(grid).exp().reshape(cells, 20, cells, 20).mean(dim=(1, 3)).reshape(-1)
    expected = count * mass / mass.sum()
    live = expected > 5
    chi = float(((counts - expected) ** 2 / expected)[live].sum())
    assert chi < int(live.sum()) + 5 * math.sqrt(2 * int(live.sum()))


@pytest.mark.parametrize("name", SPACES)
def test_a_mixture_beats_both_parts_on_clusters(name: str, tmp_path) -> None:
    space, points = make_space(name), clustered(name)
    train, held, test = points[:400], points[400:500], points[500:]
    flow = FlowDensity(space, Flow([SplineField(space.group, 2)], steps=1))
    mixed = blend_kernels(flow, train, held)
    scores = [
        float(part.log_prob(test).mean().detach()) for part in (mixed, flow, kernels_of(mixed))
    ]
    assert scores[0] > scores[1] + 1
    assert scores[0] > scores[2] - 0.05
    assert mixed.mass() == pytest.approx(1, abs=1e-3)
    assert mixed.weight_of_kind["uniform"] >= 0.99 * FLOOR
    again = mixed.sample((300,), torch.Generator().manual_seed(1))
    assert torch.equal(again, mixed.sample((300,), torch.Generator().manual_seed(1)))
    path = tmp_path / "mixed.safetensors"
    path.write_bytes(density_to_bytes(mixed))
    back, _ = read_density(path)
    assert isinstance(back, Mixture)
    with torch.no_grad():
        assert torch.equal(back.log_prob(test), mixed.log_prob(test))


def test_a_fit_with_kernels_says_its_shares() -> None:
    settings_ = FlowSettings(max_frequency=2, segments=2, iterations=5, kernels=True)
    density, report = fit_density(make_space("torus"), clustered("torus"), settings_)
    assert isinstance(density, Mixture)
    assert report.weights is not None
    assert report.weights == density.weight_of_kind
    assert sum(report.weights.values()) == pytest.approx(1)
    assert any("mixture" in note for note in report.notes)


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_proportions_are_the_best(seed: int) -> None:
    torch.manual_seed(seed)
    parts = torch.randn(3, 200, dtype=torch.float64)
    shares, score = proportions(parts, iterations=400)
    for _ in range(20):
        other = torch.distributions.Dirichlet(torch.ones(3, dtype=torch.float64)).sample()
        assert score > float((parts + other.log()[:, None]).logsumexp(dim=0).mean()) - 1e-3
    assert float(shares.sum()) == pytest.approx(1)


def test_kernels_of_wrong_shape_are_refused() -> None:
    space = make_space("sphere")
    one = torch.ones(4, dtype=torch.float64) / 4
    with pytest.raises(OrbiflowError, match="do not fit"):
        AdaptiveKernels(space, torch.rand(4, 2), torch.ones(4, 2), one)
    with pytest.raises(OrbiflowError, match="positive widths"):
        AdaptiveKernels(space, torch.rand(4, 2), -torch.ones(4, 1), one)
    with pytest.raises(OrbiflowError, match="weights must be 2 positive numbers"):
        Mixture([kernels("sphere", 0), UniformDensity(space)], torch.ones(2))
