"""Gradients through flows and log-determinants, in parameters and points."""

import pytest
import torch

from orbiflow.flows import Flow
from orbiflow.symmetry import wallpaper_group
from strategies import gentle_field, random_tensor, several


@pytest.mark.parametrize("quantity", ["moved", "log_det"])
@pytest.mark.parametrize("segments", [1, 2])
def test_gradients_of_parameters_agree_with_finite_differences(quantity, segments):
    fields = several(wallpaper_group("pg"), 0, segments)
    flow = Flow(fields, steps=3)
    points = random_tensor(0, 6, 2)

    def loss():
        moved, log_det = flow.forward_and_log_det(points)
        return (moved.sin() if quantity == "moved" else log_det.square()).sum()

    parameters = fields[0].parameters_
    (gradient,) = torch.autograd.grad(loss(), parameters)
    step = 1e-5
    for i in range(0, parameters.numel(), 5):
        with torch.no_grad():
            parameters[i] += step
            above = loss().item()
            parameters[i] -= 2 * step
            below = loss().item()
            parameters[i] += step
        slope = (above - below) / (2 * step)
        assert gradient[i].item() == pytest.approx(slope, rel=1e-6, abs=1e-8)


def test_gradients_of_points_agree_with_the_jacobian_of_the_inverse():
    flow = Flow(gentle_field(wallpaper_group("p6"), 2, 0), steps=24, method="rk5")
    p = random_tensor(0, 2)
    q = flow(p).detach()
    there = torch.autograd.functional.jacobian(flow, p)  # pyright: ignore[reportArgumentType]
    back = torch.autograd.functional.jacobian(flow.inverse, q)
    assert isinstance(there, torch.Tensor)
    assert isinstance(back, torch.Tensor)
    torch.testing.assert_close(there @ back, torch.eye(2).double(), rtol=0, atol=1e-8)


def test_second_derivatives_pass_through_several_steps():
    # inside an integrator the points depend on the parameters from the second stage on
    field = gentle_field(wallpaper_group("p4"), 2, 0)
    flow = Flow(field, steps=3, method="midpoint")
    points = random_tensor(0, 4, 2)

    def loss(parameters):
        with torch.no_grad():
            field.parameters_.copy_(parameters)
        return flow(points).sin().sum()

    start = field.parameters_.detach().clone()
    (plain,) = torch.autograd.grad(loss(start), field.parameters_)
    (gradient,) = torch.autograd.grad(loss(start), field.parameters_, create_graph=True)
    torch.testing.assert_close(gradient.detach(), plain, rtol=1e-12, atol=1e-12)
    direction = random_tensor(1, field.size)
    (curvature,) = torch.autograd.grad(gradient @ direction, field.parameters_)
    step = 1e-5
    above, below = (
        torch.autograd.grad(loss(start + sign * step * direction), field.parameters_)[0]
        for sign in (1, -1)
    )
    torch.testing.assert_close(curvature, (above - below) / (2 * step), rtol=1e-5, atol=1e-7)
