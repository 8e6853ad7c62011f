"""Densities on another device, made up or CUDA, and in another precision."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from density.blends import blended, flow_of, stored
from density.blends import random_kernels as kernels_on
from density.test_every_density import DENSITIES
from elsewhere import DEVICE, a_device
from orbiflow.density import Density, Mixture, Space, UniformDensity, make_space
from orbiflow.fields import FourierField, SplineField
from orbiflow.flows import Flow
from orbiflow.symmetry import group_by_name
from refusals import refused

SPACES = ("torus", "klein-bottle", "sphere", "projective-plane")
SEEDS = st.integers(0, 2**31)


def spline_flow(space: Space, rng: np.random.Generator) -> Flow:
    fields = [SplineField(space.group, 4), FourierField(space.group, 2)]
    with torch.no_grad():
        for field in fields:
            shape = tuple(field.parameters_.shape)
            field.parameters_.copy_(torch.tensor(0.01 * rng.normal(size=shape)))
    return Flow(fields, steps=2, warn=False)


def blend(name: str, seed: int, *, sharp: float = 1e7) -> Mixture:
    """With kernels up to that concentration."""
    rng, space = np.random.default_rng(seed), make_space(name)
    kernels = kernels_on(rng, space, 7)
    power = torch.tensor(rng.uniform(0, math.log(sharp), kernels.concentrations.shape))
    kernels = kernels.with_concentrations(power.exp())
    shares = torch.tensor(rng.dirichlet(np.ones(3)))
    return blended(space, spline_flow(space, rng), UniformDensity(space), kernels, shares)


def near(density: Density, seed: int, count: int = 40) -> torch.Tensor:
    """Points where kernels are felt, and others."""
    generator = torch.Generator().manual_seed(seed)
    even = density.space.uniform(count, generator)
    return torch.cat([even, density.sample(count, generator)])


def test_files_and_figures_elsewhere(tmp_path: Path) -> None:
    density = blend("klein-bottle", 4, sharp=30.0)
    points = near(density, 4)
    with a_device() as device:
        moved = density.to(device)
        assert moved.mass(8) == pytest.approx(density.mass(8), abs=1e-12)
        generators = [torch.Generator().manual_seed(0) for _ in range(2)]
        entropies = [
            d.entropy(20, generator=g) for d, g in zip((moved, density), generators, strict=True)
        ]
        torch.testing.assert_close(entropies[0].cpu(), entropies[1])
        again = stored(moved, tmp_path)
    assert torch.equal(again.log_prob(points), density.log_prob(points))


@given(SEEDS, st.sampled_from(SPACES))
def test_single_precision(seed: int, name: str) -> None:
    density = blend(name, seed, sharp=1e3)
    points = near(density, seed)
    single = density.to(torch.float32)
    assert {p.dtype for p in flow_of(single).flow.parameters()} == {torch.float32}
    assert {p.dtype for p in flow_of(density).flow.parameters()} == {torch.float64}
    assert single.sample(3).dtype == torch.float32
    found = single.log_prob(points)
    assert found.dtype == torch.float64
    # at cone points the area's logarithm is infinite, and single precision is not near it
    clear = density.space.log_area(points).abs() < 5
    torch.testing.assert_close(found[clear], density.log_prob(points)[clear], rtol=0, atol=0.02)
    assert torch.equal(single.to(torch.float64, "cpu").sample(0), density.sample(0))


def test_what_cannot_be_moved_or_evaluated() -> None:
    density = blend("torus", 1)
    with refused("device", "dtype"):
        density.to("the moon")
    with refused("torch.int64"):
        density.to(torch.int64)
    with a_device() as device:
        moved, points = density.to(device), torch.rand(3, 2)
        with refused("points"):
            moved.log_prob(points)
        with refused("points", "density"):
            density.log_prob(points.to(device))
        numbers: Any = [[0.5, 0.5]]  # are nowhere
        assert moved.log_prob(numbers).device == DEVICE


def test_a_generator_elsewhere() -> None:
    class Other(torch.Generator):
        device = DEVICE

    with refused("CPU"):
        blend("torus", 1).sample(3, Other())


needs_cuda = pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")


class Checked(NamedTuple):
    """A density, points, and what it says there and draws on the CPU."""

    density: Density
    points: torch.Tensor
    values: torch.Tensor
    slopes: torch.Tensor
    drawn: torch.Tensor

    @classmethod
    def of(cls, density: Density, points: torch.Tensor) -> Checked:
        at = points.detach().requires_grad_()
        values = density.log_prob(at)
        (slopes,) = torch.autograd.grad(values.sum(), at)
        drawn = density.sample(9, torch.Generator().manual_seed(0))
        return cls(density, points.detach(), values.detach(), slopes, drawn)

    def is_same_on(self, device: str | torch.device) -> None:
        moved = self.density.to(device)
        there = self.points.to(device).requires_grad_()
        found = moved.log_prob(there)
        (slopes,) = torch.autograd.grad(found.sum(), there)
        assert found.device.type == slopes.device.type == torch.device(device).type
        torch.testing.assert_close(found.detach().cpu(), self.values, rtol=1e-8, atol=1e-8)
        torch.testing.assert_close(slopes.cpu(), self.slopes, rtol=1e-5, atol=1e-5)
        drawn = moved.sample(9, torch.Generator().manual_seed(0))
        torch.testing.assert_close(drawn.cpu(), self.drawn)


@pytest.mark.parametrize(
    "name",
    [
        "bottle", "axes", "chains of 4", "network", "orientations and times",
        "chains on pattern and times",
    ],
)  # fmt: skip
def test_elsewhere_all_is_the_same(name: str) -> None:
    """Not all of them: every operation passes through Python, which is slow."""
    density = DENSITIES[name](3)
    checked = Checked.of(density, near(density, 3))
    with a_device() as device:
        checked.is_same_on(device)
        back = density.to(device).to("cpu")
    assert torch.equal(back.log_prob(checked.points), checked.values)


@needs_cuda
@pytest.mark.parametrize("name", DENSITIES)
def test_on_cuda_all_is_the_same(name: str) -> None:
    density = DENSITIES[name](3)
    Checked.of(density, near(density, 3)).is_same_on("cuda")


@needs_cuda
@pytest.mark.parametrize("name", ["p4", "hantzsche-wendt"])
def test_fields_and_flows(name: str) -> None:
    group = group_by_name(name)
    field = FourierField(group, 2, divergence_free=True, dtype=torch.float64)
    with torch.no_grad():
        field.parameters_.normal_(0, 0.02, generator=torch.Generator().manual_seed(0))
    flow = Flow([field], steps=32)
    points = torch.rand(50, group.dim, dtype=torch.float64, generator=torch.Generator())
    expected = flow(points)
    found = flow.to("cuda")(points.cuda())
    torch.testing.assert_close(found.cpu(), expected, rtol=1e-10, atol=1e-10)
    torch.testing.assert_close(flow.inverse(found), points.cuda(), rtol=1e-6, atol=1e-6)


@needs_cuda
def test_a_flow_is_trained() -> None:
    space = make_space("klein-bottle")
    flow = spline_flow(space, np.random.default_rng(0)).to("cuda")
    points = space.uniform(64, torch.Generator().manual_seed(0)).cuda()
    moved, change = flow(points).detach(), list[float]()
    for _ in range(3):
        loss = (flow(points) - moved - 0.01).square().sum()
        change.append(float(loss.detach()))
        slopes = torch.autograd.grad(loss, [*flow.parameters()])
        for one, slope in zip(flow.parameters(), slopes, strict=True):
            one.data -= 1e-4 * slope
    assert change[2] < change[0]
