"""The same densities on a CUDA device, where there is one: values, gradients, fields and flows."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from density.test_moving import SPACES, blend, near, others, spline_flow
from density.test_product_chains import random_chains
from density.test_products import BASES, random_kernels
from orbiflow.density import Density, make_space
from orbiflow.fields import FourierField
from orbiflow.flows import Flow
from orbiflow.symmetry import group_by_name

needs_cuda = pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")


def check_moved(density: Density, points: torch.Tensor, device: str) -> None:
    """The density has the same values, gradients and samples on a device."""
    at = points.detach().requires_grad_()
    values = density.log_prob(at)
    (slopes,) = torch.autograd.grad(values.sum(), at)
    moved = density.to(device)
    there = points.detach().to(device).requires_grad_()
    found = moved.log_prob(there)
    (others,) = torch.autograd.grad(found.sum(), there)
    assert found.device.type == others.device.type == device
    torch.testing.assert_close(found.cpu(), values, rtol=1e-8, atol=1e-8)
    torch.testing.assert_close(others.cpu(), slopes, rtol=1e-5, atol=1e-5)
    one, two = (torch.Generator().manual_seed(0) for _ in range(2))
    torch.testing.assert_close(moved.sample(9, one).cpu(), density.sample(9, two))


def check_kinds(device: str) -> None:
    for name in SPACES:
        density = blend(name, 1, sharp=1e3)
        check_moved(density, near(density, 1), device)
    for density in others(2):
        check_moved(density, near(density, 2), device)
    for name in BASES:
        mixture, points = random_kernels(name, 3)
        check_moved(mixture, points, device)
        check_moved(random_chains(name, 3), points, device)


@needs_cuda
def test_densities() -> None:
    check_kinds("cuda")


def test_densities_that_are_moved_nowhere() -> None:
    check_kinds("cpu")


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
