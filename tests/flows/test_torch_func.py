"""Flows under `torch.func`, against finite differences, the log-determinant and each other."""

import warnings

import pytest
import torch
from torch import Tensor
from torch.func import functional_call, grad, hessian, jacfwd, jacrev, vmap

from orbiflow.errors import CoarseStepsWarning
from orbiflow.fields import SplineField, symmetrize
from orbiflow.flows import Flow
from orbiflow.symmetry import identification_group, wallpaper_group
from strategies import central_difference, gentle_field, neural_field, random_tensor, several

# of torch itself, the first time that forward mode is used
pytestmark = pytest.mark.filterwarnings(
    "ignore:`torch.jit.script` is deprecated:DeprecationWarning"
)


def spline_flow() -> Flow:
    fields = [SplineField(identification_group("klein-bottle"), 2) for _ in range(2)]
    with torch.no_grad():
        for i, field in enumerate(fields):
            field.parameters_.copy_(0.02 * random_tensor(i, field.size))
    return Flow(fields, steps=2)


def network_flow() -> Flow:
    field = neural_field(wallpaper_group("p2"), hidden=(8,), seed=1)
    with torch.no_grad():
        for i, parameter in enumerate(field.parameters()):
            parameter.add_(0.1 * random_tensor(i, *parameter.shape))
    return Flow(field, steps=2)


def function_flow() -> Flow:
    turning = symmetrize(lambda p: torch.sin(p.flip(-1)), wallpaper_group("p4"))
    return Flow(turning, steps=2)


FLOWS = {
    "fourier": lambda: Flow(several(wallpaper_group("p6"), 1), steps=2),
    "spline": spline_flow,
    "network": network_flow,
    "function": function_flow,
}
every_kind = pytest.mark.parametrize("kind", FLOWS)


@every_kind
def test_the_map_its_inverse_and_their_jacobians(kind):
    flow, points = FLOWS[kind](), random_tensor(2, 2, 2)
    for function in (flow, flow.inverse):
        torch.testing.assert_close(vmap(function)(points), function(points))
        with torch.no_grad():
            numerical = central_difference(function, points, 1e-5)
        for transform in (jacrev, jacfwd):
            found = vmap(transform(function))(points).detach()
            torch.testing.assert_close(found, numerical, rtol=1e-5, atol=1e-5)


@every_kind
def test_the_log_determinant_is_that_of_the_jacobian(kind):
    flow, points = FLOWS[kind]().with_steps(12), random_tensor(3, 2, 2)
    determinant = torch.linalg.slogdet(vmap(jacrev(flow))(points)).logabsdet
    mapped = vmap(flow.log_abs_det_jacobian)(points)
    torch.testing.assert_close(mapped, flow.log_abs_det_jacobian(points))
    torch.testing.assert_close(mapped, determinant, rtol=1e-4, atol=1e-4)


@every_kind
def test_the_log_determinant_has_a_gradient(kind):
    flow, points = FLOWS[kind](), random_tensor(4, 3, 2)

    def log_det(p: Tensor) -> Tensor:
        return flow.inverse_and_log_det(p)[1]

    with torch.no_grad():
        numerical = central_difference(lambda p: log_det(p)[..., None], points, 1e-5)[..., 0, :]
    backward = vmap(grad(log_det))(points).detach()
    forward = vmap(jacfwd(log_det))(points).detach()
    torch.testing.assert_close(backward, numerical, rtol=1e-4, atol=1e-4)
    torch.testing.assert_close(forward, backward, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("kind", ["fourier", "spline"])  # which have derivatives of their own
def test_hessians(kind):
    flow, point = FLOWS[kind](), random_tensor(5, 2)

    def total(p: Tensor) -> Tensor:
        return flow(p).square().sum()

    numerical = central_difference(lambda p: grad(total)(p).detach(), point, 1e-4)
    for found in (hessian(total)(point), jacrev(jacfwd(total))(point)):
        torch.testing.assert_close(found.detach(), numerical, rtol=1e-5, atol=1e-5)


def test_gradients_of_parameters_by_functional_call():
    flow, points = FLOWS["fourier"](), random_tensor(6, 4, 2)
    parameters = {name: p.detach() for name, p in flow.named_parameters()}

    def loss(values: dict[str, Tensor], p: Tensor) -> Tensor:
        return functional_call(flow, values, (p,)).square().sum()

    found = grad(loss)(parameters, points)
    each = vmap(grad(loss), in_dims=(None, 0))(parameters, points)
    flow(points).square().sum().backward()
    for name, parameter in flow.named_parameters():
        torch.testing.assert_close(found[name], parameter.grad)
        torch.testing.assert_close(each[name].sum(dim=0), parameter.grad)


def test_coarse_steps_are_looked_for_outside_of_transforms_only():
    flow = Flow(gentle_field(wallpaper_group("p4"), 3, 7, slope=60.0), steps=1, method="euler")
    points = random_tensor(7, 9, 2)
    with warnings.catch_warnings():
        warnings.simplefilter("error", CoarseStepsWarning)
        vmap(jacrev(flow))(points)
    with pytest.warns(CoarseStepsWarning):
        flow(points)
