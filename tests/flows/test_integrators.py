"""Runge-Kutta tables: order conditions and the order measured."""

import numpy as np
import pytest
import torch

from orbiflow.flows import METHODS, Flow, method
from refusals import refused

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
