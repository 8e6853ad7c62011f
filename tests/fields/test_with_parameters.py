"""Parameters that come from elsewhere, or are made under inference mode."""

from collections.abc import Callable

import pytest
import torch
from hypothesis import given, settings
from torch import Tensor, nn

from orbiflow.fields import FourierField, SplineField, divergence, jacobian, symmetrize
from orbiflow.flows import Flow
from orbiflow.symmetry import CrystallographicGroup, wallpaper_group
from refusals import refused
from strategies import (
    largest,
    map_equivariance_error,
    neural_field,
    plane_groups,
    random_field,
    random_tensor,
    seeds,
)

SQUARE = wallpaper_group("p1", [[1.0, 0.0], [0.0, 1.0]])


@settings(max_examples=5)
@given(plane_groups, seeds)
def test_every_context_has_the_symmetry(group: CrystallographicGroup, seed: int) -> None:
    field = FourierField(group, 2)
    network = torch.nn.Linear(2, 2 * field.size).double()
    context, points = random_tensor(seed, 3, 2), random_tensor(seed, 4, 2)
    rows = [gentle(field, own) for own in network(context).chunk(2, dim=-1)]
    flow = Flow([field.with_parameters(own) for own in rows], steps=2)
    together = flow(points.expand(3, -1, -1))
    for index in range(3):
        alone = Flow([field.with_parameters(own[index]) for own in rows], steps=2)
        assert largest(alone(points) - together[index]) < 1e-10
        assert map_equivariance_error(alone, group, points) < 1e-9


def gentle(field: FourierField, rows: Tensor) -> Tensor:
    """The parameters, made smaller where their fields are steep."""
    bounds = field.with_parameters(rows).lipschitz_bound()
    return rows / bounds.clamp(min=1.0)[:, None]


def test_the_network_learns_and_the_field_stays() -> None:
    field = random_field(SQUARE, 2, 0)
    before = field.parameters_.detach().clone()
    network = torch.nn.Linear(1, field.size).double()
    flow = Flow(field.with_parameters(network(random_tensor(0, 5, 1))), bijective=True)
    flow.inverse_and_log_det(random_tensor(1, 5, 3, 2))[1].sum().backward()
    assert network.weight.grad is not None
    assert largest(network.weight.grad) > 0
    assert field.parameters_.grad is None
    assert torch.equal(field.parameters_, before)
    assert list(field.with_parameters(before).parameters()) == []


def test_a_spline_takes_one_row() -> None:
    spline, own = SplineField(SQUARE, 2), random_field(SQUARE, 2, 3).parameters_
    points = random_tensor(0, 5, 2)
    expected = SplineField(SQUARE, 2)
    with torch.no_grad():
        expected.parameters_.copy_(own)
    assert torch.equal(spline.with_parameters(own)(points), expected(points))
    with refused("parameters", "(50,)", "(2, 50)"):
        spline.with_parameters(own.expand(2, -1))


@pytest.mark.parametrize("shape", [(), (3,), (2, 3), (2, 2, 50)])
def test_other_shapes_are_refused(shape: tuple[int, ...]) -> None:
    field = FourierField(SQUARE, 2)
    with refused("(50,)", "(S, 50)"):
        field.with_parameters(torch.zeros(shape, dtype=torch.float64))


def test_another_dtype_is_refused() -> None:
    field = FourierField(SQUARE, 2)
    with refused("float64", "float32"):
        field.with_parameters(torch.zeros(field.size))


KINDS: dict[str, Callable[[CrystallographicGroup], nn.Module]] = {
    "fourier": lambda group: FourierField(group, 3),
    "spline": lambda group: SplineField(group, 3),
    "network": lambda group: neural_field(group, hidden=(4,)),
    "symmetrized": lambda group: symmetrize(nn.Linear(2, 2).double(), group),
}


OURS = ("fourier", "spline", "network")
"""Kinds whose parameters we make ourselves."""


@pytest.mark.parametrize("kind", OURS)
def test_a_field_built_in_inference_mode_leaves_training_alone(kind: str) -> None:
    group, points = wallpaper_group("p4"), random_tensor(0, 5, 2)
    with torch.inference_mode():
        first = KINDS[kind](group)
        Flow(first, steps=2).forward_and_log_det(points)
        jacobian(first, points)
        divergence(lambda p: first(p), points)
    field = KINDS[kind](group)
    moved, log_det = Flow(field, steps=2).forward_and_log_det(points)
    (moved.sum() + log_det.sum()).backward()
    assert all(p.grad is not None for p in field.parameters())


@pytest.mark.parametrize("kind", OURS)
def test_a_field_built_in_inference_mode_can_be_trained(kind: str) -> None:
    with torch.inference_mode():
        field = KINDS[kind](wallpaper_group("p4"))
    field(random_tensor(0, 5, 2)).sum().backward()
    assert all(p.grad is not None for p in field.parameters())
