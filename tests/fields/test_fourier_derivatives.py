"""Fourier fields: Jacobian, divergence, gradients, Lipschitz bound, batches."""

import pytest
import torch
from hypothesis import given, settings

from orbiflow.fields import FourierField, jacobian
from orbiflow.symmetry import CrystallographicGroup, wallpaper_group
from strategies import (
    random_field,
    random_tensor,
    seeds,
    small_fields,
    space_group,
    wallpaper_groups,
)


@settings(max_examples=10)
@given(small_fields, seeds)
def test_the_jacobian_agrees_with_autograd(field, seed):
    points = random_tensor(seed, 4, field.group.dim)
    by_autograd = jacobian(lambda p: field(p), points)
    torch.testing.assert_close(field.jacobian(points), by_autograd, rtol=1e-11, atol=1e-10)


@given(small_fields, seeds)
def test_the_divergence_is_the_trace_of_the_jacobian(field, seed):
    points = random_tensor(seed, 3, 4, field.group.dim)
    trace = field.jacobian(points).diagonal(dim1=-2, dim2=-1).sum(dim=-1)
    torch.testing.assert_close(field.divergence(points), trace, rtol=1e-12, atol=1e-11)


@given(small_fields, seeds)
def test_bound_forms_give_the_same_values(field, seed):
    points = random_tensor(seed, 4, field.group.dim)
    values, divergence = field.bound_with_divergence()(points)
    torch.testing.assert_close(field.bound()(points), field(points), rtol=0, atol=0)
    torch.testing.assert_close(values, field(points), rtol=0, atol=1e-13)
    torch.testing.assert_close(divergence, field.divergence(points), rtol=1e-13, atol=1e-12)


@settings(max_examples=5)
@given(wallpaper_groups(), seeds)
def test_gradients_of_parameters_and_points_pass_gradcheck(group, seed):
    field = random_field(group, 2, seed, smoothness=1.0)

    def values(parameters, points):
        return torch.func.functional_call(field, {"parameters_": parameters}, (points,))

    inputs = (
        field.parameters_.detach().clone().requires_grad_(),
        random_tensor(seed, 3, 2).requires_grad_(),
    )
    assert torch.autograd.gradcheck(values, inputs, atol=1e-6, rtol=1e-5)


@pytest.mark.parametrize("quantity", ["forward", "divergence", "jacobian"])
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_a_batch_of_fields_is_the_fields_one_by_one(quantity, dim):
    group = {
        1: CrystallographicGroup.generate([[1.3]]),
        2: wallpaper_group("p6"),
        3: space_group("P2_1/c", 0),
    }[dim]
    batch = random_field(group, 2, 0, batch=3)
    points = random_tensor(1, 3, 4, 2, dim)
    together = getattr(batch, quantity)(points)
    for s in range(3):
        single = FourierField(group, 2)
        with torch.no_grad():
            single.parameters_.copy_(batch.parameters_[s])
        alone = getattr(single, quantity)(points[s])
        torch.testing.assert_close(together[s], alone, rtol=1e-13, atol=1e-13)


def test_a_batch_has_one_lipschitz_bound_a_field():
    batch = random_field(wallpaper_group("p4"), 3, 0, batch=3)
    bounds = batch.lipschitz_bound()
    for s in range(3):
        single = FourierField(batch.group, 3)
        with torch.no_grad():
            single.parameters_.copy_(batch.parameters_[s])
        assert float(single.lipschitz_bound()) == pytest.approx(float(bounds[s]), rel=1e-14)
