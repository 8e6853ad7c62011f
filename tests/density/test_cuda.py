"""The same densities on a CUDA device, where there is one: values, gradients, fields and flows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
import torch

from density.test_moving import SPACES, blend, near, others, spline_flow
from density.test_product_chains import random_chains
from density.test_products import BASES, random_kernels
from elsewhere import a_device
from orbiflow.density import Density, make_space
from orbiflow.fields import FourierField
from orbiflow.flows import Flow
from orbiflow.symmetry import group_by_name

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


@needs_cuda
def test_densities() -> None:
    for name in SPACES:
        density = blend(name, 1, sharp=1e3)
        Checked.of(density, near(density, 1)).is_same_on("cuda")
    for density in others(2):
        Checked.of(density, near(density, 2)).is_same_on("cuda")
    for name in BASES:
        mixture, points = random_kernels(name, 3)
        Checked.of(mixture, points).is_same_on("cuda")
        Checked.of(random_chains(name, 3), points).is_same_on("cuda")


@pytest.mark.parametrize("name", sorted(BASES))
def test_products_on_a_device_that_tests_make_up(name: str) -> None:
    mixture, points = random_kernels(name, 3)
    known = [Checked.of(own, points) for own in (mixture, random_chains(name, 3))]
    with a_device() as device:
        for own in known:
            own.is_same_on(device)


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
