"""Runge-Kutta tables, their order, and steps that are too coarse: a flow says so once."""

import re
import warnings

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from torch import nn

from orbiflow.errors import CoarseStepsWarning
from orbiflow.fields import FourierField
from orbiflow.flows import METHODS, Flow, method
from orbiflow.symmetry import wallpaper_group
from refusals import refused, warned
from strategies import gentle_field, groups, random_field, random_tensor, seeds, space_group

STEEP = random_field(space_group("P2_1/c", 0), 2, 0, rms=0.8)
POINTS = random_tensor(0, 200, 3)


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
        assert roundtrip(flow.with_steps(512)) < 1e-6


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


def test_an_unknown_method_is_refused_with_the_known_ones():
    with refused("leapfrog", "euler"):
        method("leapfrog")


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
