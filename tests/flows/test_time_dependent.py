"""Flows of V(x, t): order of convergence, inverse, log-determinant, segments, symmetry."""

from __future__ import annotations

import math

import pytest
import torch
from hypothesis import given, settings
from torch import Tensor, nn

from orbiflow.fields import FourierField, symmetrize, time_dependent
from orbiflow.flows import METHODS, Flow
from orbiflow.symmetry import CrystallographicGroup, wallpaper_group
from strategies import (
    gentle_field,
    largest,
    map_equivariance_error,
    random_tensor,
    seeds,
    wallpaper_groups,
)


class Swinging(nn.Module):
    """A symmetric field whose strength swings with time."""

    time_dependent = True

    def __init__(self, field: FourierField) -> None:
        super().__init__()
        self.field = field

    def forward(self, points: Tensor, time: Tensor) -> Tensor:
        return self.field(points) * (1 + (5 * time).sin())


def swinging(group: CrystallographicGroup, seed: int = 0) -> Swinging:
    return Swinging(gentle_field(group, 2, seed))


@pytest.mark.parametrize("inverse", [False, True])
@pytest.mark.parametrize("name", METHODS)
def test_convergence_has_the_order_of_the_method(name, inverse):
    # stages evaluated at the wrong times would leave order one at most
    flow = Flow(swinging(wallpaper_group("pgg")), steps=16, method=name, warn=False)
    points = random_tensor(0, 50, 2)
    first, second = (flow.with_steps(n).error_estimate(points, inverse=inverse) for n in (16, 32))
    assert math.log2(first / second) == pytest.approx(METHODS[name].order, abs=0.35)


def test_a_field_of_time_alone_is_integrated():
    field = time_dependent(lambda p, t: torch.ones_like(p) * 4 * t**3)
    points = random_tensor(0, 4, 2)
    flow = Flow(field, steps=1)  # rk4 has the weights of Simpson's rule: exact for cubics
    torch.testing.assert_close(flow(points), points + 1, rtol=0, atol=1e-14)
    torch.testing.assert_close(flow.inverse(points), points - 1, rtol=0, atol=1e-14)
    longer = Flow(field, steps=1, duration=2.0)
    torch.testing.assert_close(longer(points), points + 16, rtol=0, atol=1e-13)


def test_a_swinging_field_goes_as_far_as_its_mean():
    # the direction does not depend on time: the flow is the stationary one for the time's integral
    group, points = wallpaper_group("p4"), random_tensor(0, 20, 2)
    field = gentle_field(group, 2, 0)
    span = 1 + (1 - math.cos(5)) / 5
    with torch.no_grad():
        found = Flow(Swinging(field), steps=64)(points)
        expected = Flow(field, steps=64, duration=span)(points)
    torch.testing.assert_close(found, expected, rtol=0, atol=1e-8)


@settings(max_examples=4)  # each is differentiated through a thousand evaluations of fields
@given(wallpaper_groups(), seeds)
def test_there_and_back_with_determinants_and_symmetry(group, seed):
    flow = Flow([swinging(group, seed), gentle_field(group, 2, seed + 1)], steps=24, method="rk5")
    points = random_tensor(seed, 5, 2)
    with torch.no_grad():
        moved, there = flow.forward_and_log_det(points)
        back, home = flow.inverse_and_log_det(moved)
        torch.testing.assert_close(moved, flow(points), rtol=0, atol=1e-13)
        assert map_equivariance_error(flow, group, points) < 1e-11
    torch.testing.assert_close(back, points, rtol=0, atol=1e-7)
    torch.testing.assert_close(there, -home, rtol=0, atol=1e-7)
    jacobian = torch.autograd.functional.jacobian(lambda p: flow(p).sum(dim=0), points)
    assert isinstance(jacobian, Tensor)
    torch.testing.assert_close(
        there, torch.linalg.slogdet(jacobian.movedim(0, 1)).logabsdet, rtol=0, atol=1e-7
    )


def test_every_segment_has_a_clock_of_its_own():
    first, second = (swinging(wallpaper_group("p3"), seed) for seed in (0, 1))
    points = random_tensor(0, 5, 2)
    both = Flow([first, second], steps=6)
    assert torch.equal(both(points), Flow(second, steps=6)(Flow(first, steps=6)(points)))
    paths = both.trajectories(points)
    assert paths.shape == (13, 5, 2)
    assert torch.equal(paths[-1], both(points))


def test_a_time_dependent_field_can_be_symmetrized():
    group = wallpaper_group("p6")
    field = symmetrize(time_dependent(lambda p, t: torch.tanh(p) * (1 + t)), group)
    flow = Flow(field, steps=8)
    assert map_equivariance_error(flow, group, random_tensor(0, 8, 2)) < 1e-12
    assert largest(flow(random_tensor(0, 8, 2)) - random_tensor(0, 8, 2)) > 1e-3


def test_parameters_are_trained_through_time():
    field = swinging(wallpaper_group("p4"))
    _, log_det = Flow(field, steps=4).forward_and_log_det(random_tensor(0, 5, 2))
    log_det.square().sum().backward()
    gradient = field.field.parameters_.grad
    assert gradient is not None
    assert largest(gradient) > 0
