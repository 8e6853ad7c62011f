"""Bijective flows, Runge-Kutta tables, and steps that are too coarse."""

import re
import warnings
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor, nn

from orbiflow.errors import CoarseStepsWarning
from orbiflow.fields import FourierField, SplineField, jacobian
from orbiflow.flows import METHODS, Flow, load_flow, method, save_flow
from orbiflow.symmetry import CrystallographicGroup, wallpaper_group
from refusals import refused, warned
from strategies import (
    gentle_field,
    groups,
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


def test_unknown_methods_and_fields_without_a_bound_are_refused() -> None:
    with refused("leapfrog", "euler"):
        method("leapfrog")
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


STEEP = random_field(space_group("P2_1/c", 0), 2, 0, rms=0.8)
POINTS = random_tensor(0, 140, 3)  # of which some are looked at


def roundtrip(flow: Flow) -> float:
    return float((flow.inverse(flow(POINTS)) - POINTS).norm(dim=-1).max())


@torch.no_grad()
def test_a_steep_flow_of_few_steps_warns_once_with_steps_that_do():
    flow = Flow(STEEP, steps=8)
    with pytest.warns(CoarseStepsWarning) as caught:
        assert roundtrip(flow) > 0.3
    assert len(caught) == 1
    message = str(caught[0].message)
    found = re.search(r"8 rk4 steps .* by (\d+) % of their way; raise steps to (\d+)", message)
    assert found
    assert int(found[1]) > 5
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert roundtrip(flow) > 0.3  # once is enough
        assert roundtrip(flow.with_steps(int(found[2]))) < 0.05
        assert roundtrip(flow.with_steps(256)) < 1e-5


@torch.no_grad()
@pytest.mark.parametrize("apply", ["inverse", "forward_and_log_det"])
def test_every_way_through_the_flow_is_looked_at(apply):
    with pytest.warns(CoarseStepsWarning):
        getattr(Flow(STEEP, steps=8), apply)(POINTS)
    Flow(STEEP, steps=8, warn=False).forward(POINTS)


@torch.no_grad()
def test_any_callable_is_looked_at():
    with warned("1 euler steps", kind=CoarseStepsWarning):
        Flow(lambda p: -3 * p, steps=1, method="euler")(POINTS)


def test_it_is_noticed_when_training_makes_a_field_steep():
    field = FourierField(wallpaper_group("p4"), 3)
    flow, points = Flow(field, steps=2), random_tensor(0, 20, 2)
    with torch.no_grad():
        flow(points)
        field.parameters_.copy_(random_field(field.group, 3, 0, rms=2.0).parameters_)
        with pytest.warns(CoarseStepsWarning):
            flow(points)


def test_training_is_looked_at_ever_more_rarely():
    calls = 0

    class Counted(nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.rate = nn.Parameter(torch.tensor(0.1, dtype=torch.float64))

        def forward(self, points: torch.Tensor) -> torch.Tensor:
            nonlocal calls
            calls += 1
            return self.rate * points

    field = Counted()
    flow = Flow(field, steps=4)
    for _ in range(100):
        flow(POINTS[:5]).sum()
        with torch.no_grad():
            field.rate.mul_(0.99)
    # 16 evaluations a call; looks at calls 1, 2, 4, ..., 64 cost 48 each
    assert calls == 16 * 100 + 48 * 7


@settings(max_examples=12)
@given(groups, seeds)
def test_gentle_flows_are_silent(group, seed):
    # warnings are errors here
    flow = Flow([gentle_field(group, 1, seed + i, slope=2.0) for i in range(2)], steps=8)
    points = random_tensor(seed, 10, group.dim)
    with torch.no_grad():
        flow.inverse(flow(points))


# of Euler, midpoint, Kutta 3, the classical method, Butcher 5
ORDERS = {"euler": 1, "midpoint": 2, "rk3": 3, "rk4": 4, "rk5": 5}


def tableau(name):
    """Butcher's A and b, the missing upper part filled with zeros."""
    rows = [(), *METHODS[name].stages]
    n = len(rows)
    a = np.zeros((n, n))
    for i, row in enumerate(rows):
        a[i, : len(row)] = row
    return a, np.array(METHODS[name].weights)


@pytest.mark.parametrize("name", METHODS)
def test_order_conditions_hold_up_to_the_order(name):
    a, b = tableau(name)
    c = a.sum(axis=1)
    # one condition a rooted tree (Hairer, Norsett, Wanner, table II.2.2), as (order, lhs, rhs)
    conditions = [
        *((1, b.sum(), 1), (2, b @ c, 1 / 2), (3, b @ c**2, 1 / 3), (3, b @ a @ c, 1 / 6)),
        *((4, b @ c**3, 1 / 4), (4, b @ (c * (a @ c)), 1 / 8), (4, b @ a @ c**2, 1 / 12)),
        *((4, b @ a @ a @ c, 1 / 24), (5, b @ c**4, 1 / 5), (5, b @ (c**2 * (a @ c)), 1 / 10)),
        *((5, b @ (c * (a @ c**2)), 1 / 15), (5, b @ (c * (a @ a @ c)), 1 / 30)),
        *((5, b @ (a @ c) ** 2, 1 / 20), (5, b @ a @ c**3, 1 / 20)),
        *((5, b @ a @ (c * (a @ c)), 1 / 40), (5, b @ a @ a @ c**2, 1 / 60)),
        (5, b @ a @ a @ a @ c, 1 / 120),
    ]
    met = [abs(left - right) < 1e-14 for order, left, right in conditions if order <= ORDERS[name]]
    assert all(met)
    missed = [abs(left - right) for order, left, right in conditions if order == ORDERS[name] + 1]
    assert not missed or max(missed) > 1e-3


@pytest.mark.parametrize(
    ("name", "expected"),
    # 1 + z/2 and the truncated exponential of rk4, times z, reach 1 there
    [("euler", 1.0), ("midpoint", 3**0.5 - 1), ("rk4", 0.693948), ("rk3", 0.62889)],
)
def test_the_longest_step_that_is_surely_injective(name, expected):
    assert METHODS[name].injective_below == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("name", METHODS)
def test_steps_below_the_bound_do_not_fold(name):
    # slopes from -1 to 1
    points = torch.linspace(-3, 3, 2001, dtype=torch.float64)[:, None]
    longest = METHODS[name].injective_below
    flow = Flow(lambda x: -x.sin(), steps=1, method=name, duration=longest, warn=False)
    assert bool((flow(points).diff(dim=0) > 0).all())
