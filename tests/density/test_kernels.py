"""Adaptive kernels, alone and beside a flow: invariant, normalised, sampled as they score."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.density import AdaptiveKernels, Mixture, UniformDensity, make_space
from orbiflow.density.models import midpoints
from refusals import refused

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
@settings(max_examples=10, deadline=None)
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


def test_kernels_of_wrong_shape_are_refused() -> None:
    space = make_space("sphere")
    one = torch.ones(4, dtype=torch.float64) / 4
    with refused("fit"):
        AdaptiveKernels(space, torch.rand(4, 2), torch.ones(4, 2), one)
    with refused("positive", "widths"):
        AdaptiveKernels(space, torch.rand(4, 2), -torch.ones(4, 1), one)
    with refused("positive", "2"):
        Mixture([kernels("sphere", 0), UniformDensity(space)], torch.ones(2))
