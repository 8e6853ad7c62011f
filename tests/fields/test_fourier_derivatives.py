"""Jacobian and divergence of Fourier fields in closed form, and fields without divergence."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.fields import FourierField, SplineField, divergence, jacobian
from orbiflow.flows import Flow, load_flow, save_flow
from orbiflow.symmetry import CrystallographicGroup, wallpaper_group
from refusals import refused
from strategies import (
    SMALL_SPACE_GROUPS,
    groups,
    largest,
    random_field,
    random_tensor,
    seeds,
    small_fields,
    space_group,
    space_groups,
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


def filled(field: FourierField, seed: int, size: float = 1.0) -> FourierField:
    """The same with random parameters."""
    with torch.no_grad():
        field.parameters_.copy_(size * random_tensor(seed, *field.parameters_.shape))
    return field


@given(st.one_of(groups, space_groups(SMALL_SPACE_GROUPS)), seeds)
def test_it_commutes_with_the_group_and_has_no_divergence(group, seed) -> None:
    field = filled(FourierField(group, 2, divergence_free=True), seed)
    points = 3 * random_tensor(seed + 1, 20, group.dim)
    size = largest(field(points)) + 1e-300
    slope = 1e-300 + max(1.0, float(field.lipschitz_bound()))
    assert largest(field.divergence(points)) < 1e-12 * slope
    for g in group.cosets:
        linear, shift = torch.tensor(g.linear), torch.tensor(g.translation)
        apart = field(points @ linear.T + shift) - field(points) @ linear.T
        assert largest(apart) < 1e-11 * (size + slope)


@given(st.one_of(groups, space_groups(SMALL_SPACE_GROUPS)), seeds)
def test_its_fields_are_all_those_without_divergence(group, seed) -> None:
    """Their number is that of all fields less the rank of the divergence."""
    every, some = FourierField(group, 1), FourierField(group, 1, divergence_free=True)
    points = 3 * random_tensor(seed, 4 * every.size + 8, group.dim)

    def divergence(parameters: torch.Tensor) -> torch.Tensor:
        return every.with_parameters(parameters).divergence(points)

    table = torch.func.jacrev(divergence)(torch.zeros(every.size, dtype=torch.float64))
    rank = int(torch.linalg.matrix_rank(table, rtol=1e-9)) if every.size else 0
    assert some.size == every.size - rank


def test_its_flow_keeps_areas_ever_better() -> None:
    field = filled(FourierField(wallpaper_group("p4"), 3, divergence_free=True), 0, 0.02)
    points = random_tensor(1, 50, 2)
    errors = list[float]()
    for steps in (8, 16, 32):
        flow = Flow(field, steps=steps, warn=False)
        slopes = torch.func.vmap(torch.func.jacrev(flow))(points)
        errors.append(largest(torch.det(slopes) - 1))
    assert errors[2] < 1e-5
    assert errors[1] < errors[0] / 8
    assert errors[2] < errors[1] / 8


def test_it_is_saved_and_only_waves_can_do_it(tmp_path) -> None:
    field = filled(FourierField(wallpaper_group("p6"), 2, divergence_free=True), 3)
    save_flow(Flow(field), tmp_path / "flow.safetensors")
    again = load_flow(tmp_path / "flow.safetensors").segments[0]
    assert isinstance(again, FourierField)
    assert again.divergence_free
    points = random_tensor(4, 5, 2)
    assert torch.equal(again(points), field(points))
    with refused("SplineField", "FourierField"):
        SplineField(wallpaper_group("p1"), 2, divergence_free=True)


def test_one_dimension_leaves_translations_alone() -> None:
    line = CrystallographicGroup.generate(np.eye(1))
    assert FourierField(line, 3, divergence_free=True).size == 1
