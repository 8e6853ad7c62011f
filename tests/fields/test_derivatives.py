"""Jacobian and divergence of fields that have no closed form."""

import pytest
import torch
from hypothesis import given

from orbiflow.fields import divergence, jacobian
from orbiflow.symmetry import wallpaper_group
from strategies import central_difference, random_field, random_tensor, seeds


def curl_and_stretch(p):
    x, y = p[..., 0], p[..., 1]
    return torch.stack([x.sin() * y, (x * y).cos() + x], dim=-1)


@given(seeds)
def test_the_jacobian_agrees_with_finite_differences(seed):
    points = random_tensor(seed, 2, 3, 2)
    slopes = central_difference(curl_and_stretch, points)
    torch.testing.assert_close(jacobian(curl_and_stretch, points), slopes, rtol=0, atol=1e-9)


@given(seeds)
def test_the_divergence_is_the_trace(seed):
    points = random_tensor(seed, 5, 2)
    x, y = points.unbind(-1)
    torch.testing.assert_close(
        divergence(curl_and_stretch, points), x.cos() * y - x * (x * y).sin(), rtol=0, atol=1e-12
    )


def test_a_closed_form_is_used_where_there_is_one():
    field = random_field(wallpaper_group("p4"), 3, 0)
    points = random_tensor(0, 5, 2)
    assert torch.equal(divergence(field, points), field.divergence(points))
    assert torch.equal(jacobian(field, points), field.jacobian(points))


def test_a_constant_field_has_no_divergence_trainable_or_not():
    assert not divergence(torch.ones_like, random_tensor(0, 5, 2)).any()
    drift = torch.ones(2, dtype=torch.float64, requires_grad=True)
    found = divergence(lambda p: drift.expand_as(p), random_tensor(0, 5, 2))
    assert found.tolist() == [0.0] * 5


def test_the_divergence_can_be_differentiated_in_tensors_that_a_function_closes_over():
    scale = torch.tensor(2.0, dtype=torch.float64, requires_grad=True)
    points = random_tensor(0, 5, 2)
    total = divergence(lambda p: scale**2 * p.sin(), points).sum()
    (slope,) = torch.autograd.grad(total, scale)
    assert float(slope) == pytest.approx(float(4 * points.cos().sum()), rel=1e-13)


def test_the_divergence_can_be_differentiated_in_the_points():
    points = random_tensor(0, 5, 2).requires_grad_()
    (slope,) = torch.autograd.grad(divergence(torch.sin, points).sum(), points)
    torch.testing.assert_close(slope, -points.detach().sin())


def test_nothing_is_tracked_where_nothing_can_be_trained():
    points = random_tensor(0, 5, 2)
    assert not divergence(torch.sin, points).requires_grad
    with torch.no_grad():
        tracked = points.clone().requires_grad_()
        assert not divergence(torch.sin, tracked).requires_grad
    assert points.requires_grad is False
