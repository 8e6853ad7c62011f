"""Bijective flows: log-determinants are those of the map that is computed, at any number of steps."""

from pathlib import Path

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from orbiflow.fields import FourierField, SplineField, jacobian
from orbiflow.flows import METHODS, Flow, load_flow, save_flow
from orbiflow.symmetry import CrystallographicGroup, wallpaper_group
from refusals import refused
from strategies import (
    largest,
    map_equivariance_error,
    plane_groups,
    random_field,
    random_tensor,
    seeds,
    space_group,
)

few_groups = st.one_of(
    plane_groups, st.sampled_from(["P2_1/c", "P4_1"]).map(lambda n: space_group(n, 0))
)
methods = st.sampled_from(sorted(METHODS))
SQUARE = wallpaper_group("p1", [[1.0, 0.0], [0.0, 1.0]])


def steep_flow(group: CrystallographicGroup, seed: int, slope: float = 3.0, **how) -> Flow:
    """Two random fields that are too steep for few ordinary steps."""
    fields = [random_field(group, 1, seed + i) for i in range(2)]
    for field in fields:
        with torch.no_grad():
            field.parameters_.mul_(slope / field.lipschitz_bound().clamp(min=1e-3))
    return Flow(fields, steps=1, warn=False, **how)


def true_log_det(function, points: Tensor) -> Tensor:
    with torch.no_grad():
        determinants = torch.linalg.det(jacobian(function, points))
    assert bool((determinants > 0).all())
    return determinants.log()


@settings(max_examples=4)
@given(few_groups, methods, seeds)
def test_the_log_determinant_is_that_of_the_map(group: CrystallographicGroup, method, seed) -> None:
    flow = steep_flow(group, seed, method=method, bijective=True)
    points = random_tensor(seed, 4, group.dim)
    moved, log_det = flow.forward_and_log_det(points)
    assert largest(moved - flow(points)) < 1e-12
    assert largest(log_det - true_log_det(flow, points)) < 1e-9
    back, log_det = flow.inverse_and_log_det(points)
    assert largest(back - flow.inverse(points)) < 1e-12
    assert largest(log_det - true_log_det(flow.inverse, points)) < 1e-9
    assert map_equivariance_error(flow, group, points) < 1e-9


def test_an_integrated_log_determinant_is_not() -> None:
    points = random_tensor(0, 100, 2)
    coarse = steep_flow(SQUARE, 0)
    with torch.no_grad():
        _, integrated = coarse.forward_and_log_det(points)
    own = torch.linalg.slogdet(jacobian(coarse, points)).logabsdet
    assert largest(integrated - own) > 0.5


@settings(max_examples=4)
@given(methods, seeds, st.floats(0.5, 2.0))
def test_the_density_integrates_to_one(method: str, seed: int, slope: float) -> None:
    flow = steep_flow(SQUARE, seed, slope, method=method, bijective=True)
    line = (torch.arange(64, dtype=torch.float64) + 0.5) / 64
    with torch.no_grad():
        density = flow.inverse_and_log_det(torch.cartesian_prod(line, line))[1].exp()
    assert float(density.mean()) == pytest.approx(1.0, abs=0.01)


def test_steps_follow_the_parameters() -> None:
    field = random_field(SQUARE, 2, 0)
    flow = Flow(field, steps=3, bijective=True)
    view, before = flow.with_steps(100), flow.steps
    with torch.no_grad():
        field.parameters_.mul_(10.0)
    assert 9 * before < flow.steps <= 10 * before
    assert view.bijective
    assert view.steps == max(100, flow.steps)
    with torch.no_grad():
        field.parameters_.zero_()
    assert (flow.steps, view.steps) == (3, 100)


def test_gradients_are_those_of_the_likelihood() -> None:
    flow = steep_flow(SQUARE, 1, 1.0, bijective=True)
    own, points = flow.fields()[0].parameters_, random_tensor(2, 20, 2)

    def likelihood() -> Tensor:
        return flow.inverse_and_log_det(points)[1].mean()

    (gradient,) = torch.autograd.grad(likelihood(), own)
    with torch.no_grad():
        direction = torch.randn_like(own) * 1e-5
        own.add_(direction)
        above = likelihood()
        own.sub_(2 * direction)
        assert float(above - likelihood()) == pytest.approx(
            float(2 * gradient @ direction), rel=1e-5
        )


def test_splines_and_single_precision() -> None:
    for field in (SplineField(SQUARE, 1), FourierField(SQUARE, 1, dtype=torch.float32)):
        torch.nn.init.normal_(field.parameters_, std=0.1)
        flow = Flow(field, bijective=True)
        points = torch.rand(5, 2, dtype=field.parameters_.dtype)
        exact = true_log_det(flow, points)
        assert largest(flow.log_abs_det_jacobian(points) - exact) < 1e-5


def test_it_is_saved(tmp_path: Path) -> None:
    flow = steep_flow(SQUARE, 0, bijective=True)
    again = load_flow(save_flow(flow, tmp_path / "flow.safetensors"))
    points = random_tensor(0, 5, 2)
    assert again.bijective
    assert torch.equal(again.inverse_and_log_det(points)[1], flow.inverse_and_log_det(points)[1])
    plain = save_flow(Flow(flow.fields()), tmp_path / "plain.safetensors")
    assert not load_flow(plain).bijective


def test_a_field_without_a_bound_is_refused() -> None:
    with refused("lipschitz_bound()", "FourierField"):
        Flow(torch.sin, bijective=True)


@pytest.mark.parametrize("size", [1e6, float("nan"), float("inf")])
def test_a_field_that_runs_away_is_told(size: float) -> None:
    field = random_field(SQUARE, 2, 0)
    flow = Flow(field, bijective=True)
    with torch.no_grad():
        field.parameters_.mul_(size)
    with refused("learning rate", 4096):
        flow(random_tensor(0, 5, 2))
