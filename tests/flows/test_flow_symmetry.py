"""Flows commute with the group of their fields, at any step count."""

import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.flows import METHODS, Flow
from orbiflow.symmetry import wallpaper_group
from strategies import (
    gentle_field,
    groups,
    map_equivariance_error,
    random_field,
    random_tensor,
    seeds,
)


@settings(max_examples=10)
@given(groups, seeds, st.sampled_from(sorted(METHODS)), st.integers(1, 4))
def test_equivariance_holds_to_rounding_for_any_group(group, seed, method, steps):
    flow = Flow(random_field(group, 1, seed), method=method, steps=steps, duration=0.1, warn=False)
    assert map_equivariance_error(flow, group, random_tensor(seed, 8, group.dim)) < 1e-11


def test_the_log_determinant_is_invariant():
    group = wallpaper_group("p4g")
    flow = Flow(gentle_field(group, 3, 0), steps=2)
    points = random_tensor(0, 20, 2)
    with torch.no_grad():
        expected = flow.log_abs_det_jacobian(points)
        for g in group.cosets:
            found = flow.log_abs_det_jacobian(g(points))
            torch.testing.assert_close(found, expected, rtol=0, atol=1e-12)
