"""Fields under `torch.func`: vmap, grad, jacrev, jacfwd, hessian, against closed forms and numbers."""

from collections.abc import Callable

import pytest
import torch
from hypothesis import given, settings
from torch import Tensor, nn
from torch.func import functional_call, jacfwd, jacrev, vmap

from orbiflow.fields import SplineField, divergence, jacobian, symmetrize
from orbiflow.symmetry import CrystallographicGroup, identification_group, wallpaper_group
from refusals import refused
from strategies import central_difference, neural_field, random_field, random_tensor, seeds

# of torch itself, the first time that forward mode is used
pytestmark = pytest.mark.filterwarnings(
    "ignore:`torch.jit.script` is deprecated:DeprecationWarning"
)

Field = Callable[[Tensor], Tensor]
few = settings(max_examples=7)


def spline(group: CrystallographicGroup, seed: int) -> SplineField:
    field = SplineField(group, 2)
    with torch.no_grad():
        field.parameters_.copy_(0.3 * random_tensor(seed, field.size))
    return field


def network(group: CrystallographicGroup, seed: int) -> nn.Module:
    field = neural_field(group, hidden=(8, 8), seed=seed % 1000)
    with torch.no_grad():
        for i, parameter in enumerate(field.parameters()):
            parameter.add_(0.1 * random_tensor(seed + i, *parameter.shape))
    return field


def mixed(group: CrystallographicGroup, seed: int) -> nn.Module:
    """A plain function, made periodic by blending, of which no closed form is known."""
    weights = random_tensor(seed, group.dim, group.dim, size=1.0)
    return symmetrize(lambda p: torch.tanh(p @ weights.to(p)) + p.prod(-1, keepdim=True), group)


PLANE: dict[str, Callable[[int], Field]] = {
    "fourier": lambda seed: random_field(wallpaper_group("p6"), 3, seed),
    "spline": lambda seed: spline(identification_group("projective-plane"), seed),
    "network": lambda seed: network(wallpaper_group("p3"), seed),
    "function": lambda seed: mixed(wallpaper_group("pg"), seed),
}
every_kind = pytest.mark.parametrize("kind", PLANE)


@every_kind
@few
@given(seeds)
def test_jacobians_are_those_of_finite_differences(kind, seed):
    field, points = PLANE[kind](seed), random_tensor(seed, 4, 2)
    with torch.no_grad():
        numerical = central_difference(field, points, 1e-5)
    for transform in (jacrev, jacfwd):
        found = vmap(transform(field))(points).detach()
        torch.testing.assert_close(found, numerical, rtol=1e-4, atol=1e-4)
        torch.testing.assert_close(found, jacobian(field, points).detach(), rtol=1e-9, atol=1e-9)


@every_kind
@few
@given(seeds)
def test_values_and_divergence_are_mapped(kind, seed):
    field, points = PLANE[kind](seed), random_tensor(seed, 2, 3, 2)
    torch.testing.assert_close(vmap(vmap(field))(points), field(points), rtol=1e-12, atol=1e-12)
    mapped = vmap(lambda p: divergence(field, p))(points)
    torch.testing.assert_close(mapped, divergence(field, points), rtol=1e-10, atol=1e-10)


def test_many_fields_at_once_by_their_parameters():
    field = random_field(wallpaper_group("p4"), 2, 6)
    several = random_tensor(7, 5, field.size)
    points = random_tensor(8, 5, 3, 2)

    def values(parameters: Tensor, p: Tensor) -> Tensor:
        return functional_call(field, {"parameters_": parameters}, (p,))

    stack = random_field(wallpaper_group("p4"), 2, 6, batch=5)
    with torch.no_grad():
        stack.parameters_.copy_(several)
    torch.testing.assert_close(vmap(values)(several, points), stack(points).detach())
    shared = vmap(values, in_dims=(0, None))(several, points[0])
    torch.testing.assert_close(shared, stack(points[0].expand(5, 3, 2)).detach())
    jacobians = vmap(jacrev(values), in_dims=(0, 0))(several, points)
    numerical = central_difference(lambda p: values(p, points[2]), several[2], 1e-3)
    torch.testing.assert_close(jacobians[2], numerical, rtol=1e-8, atol=1e-8)


def test_a_stack_of_fields_keeps_its_axis():
    stack = random_field(wallpaper_group("p3"), 2, 9, batch=3)
    points = random_tensor(10, 4, 3, 2)  # four points for each of three fields
    mapped = vmap(lambda p: stack(p[:, None])[:, 0])(points)
    torch.testing.assert_close(mapped, stack(points.transpose(0, 1)).transpose(0, 1))


def test_points_of_another_type_are_refused_as_ever():
    field = random_field(wallpaper_group("p4"), 2, 13)
    with refused("points", "float64"):
        vmap(jacrev(field))(random_tensor(1, 3, 2, dtype=torch.float32))


@every_kind
def test_ordinary_gradients_may_be_batched(kind):
    field, points = PLANE[kind](15), random_tensor(15, 3, 2).requires_grad_()
    values = field(points).sum(dim=0)

    def pulled(unit: Tensor) -> Tensor:
        return torch.autograd.grad(values, points, unit, retain_graph=True)[0]

    rows = vmap(pulled)(torch.eye(2, dtype=torch.float64))
    exact = jacobian(field, points.detach()).detach()
    torch.testing.assert_close(rows.transpose(0, 1), exact, rtol=1e-9, atol=1e-9)


def test_the_work_of_forces_is_mapped():
    field = random_field(wallpaper_group("p4"), 2, 16)
    points, forces = random_tensor(16, 3, 5, 2), random_tensor(17, 3, 5, 2)
    expected = torch.stack([field.adjoint(p, f) for p, f in zip(points, forces, strict=True)])
    torch.testing.assert_close(vmap(field.adjoint)(points, forces), expected)


@pytest.mark.parametrize("kind", ["fourier", "spline"])
def test_the_older_batches_of_gradients_are_refused_with_what_to_do(kind):
    field = PLANE[kind](14)
    with refused("torch.func.jacrev"):
        torch.autograd.functional.jacobian(field, random_tensor(1, 3, 2), vectorize=True)
