"""Flows commute with the group of their fields, at any step count."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.flows import METHODS, Flow
from orbiflow.symmetry import rotation_matrix, wallpaper_group
from orbiflow.tiles import CLASSES
from strategies import (
    TABLED,
    gentle_field,
    groups,
    map_equivariance_error,
    random_field,
    random_tensor,
    seeds,
)


@pytest.mark.parametrize(("method", "steps"), [("euler", 1), ("rk4", 1), ("rk5", 7)])
@pytest.mark.parametrize("name", TABLED)
def test_equivariance_holds_to_rounding_at_any_step_count(name, method, steps):
    group = TABLED[name]
    fields = [random_field(group, 5, seed) for seed in range(2)]
    flow = Flow(fields, method=method, steps=steps, duration=0.1, warn=False)
    assert map_equivariance_error(flow, group, random_tensor(0, 20, 2)) < 1e-11
    assert map_equivariance_error(flow.inverse, group, random_tensor(1, 20, 2)) < 1e-11


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


@pytest.mark.parametrize("name", ["IH2", "IH3", "IH5", "IH6", "IH21"])
@given(angle=st.floats(-3, 3), scale=st.floats(0.3, 3), seed=seeds)
@settings(max_examples=4)
def test_a_similarity_composed_with_a_flow_commutes_with_the_conjugate_group(
    name, angle, scale, seed
):
    group = CLASSES[name].group()
    matrix, offset = scale * rotation_matrix(angle), np.array([0.3, -1.2])
    a, v = torch.tensor(matrix), torch.tensor(offset)
    flow = Flow(random_field(group, 3, seed), steps=1, method="euler", duration=0.2, warn=False)

    def moved(z):
        return flow((z - v) @ torch.linalg.inv(a).mT) @ a.mT + v

    assert map_equivariance_error(
        moved, group.conjugate(matrix, offset), random_tensor(seed, 10, 2)
    ) < 1e-11 * max(1.0, scale)


@pytest.mark.parametrize("angle", [0.3, 1.1])
def test_flowing_along_the_papers_field_breaks_glide_symmetry(angle):
    group = CLASSES["IH2"].group()
    matrix = rotation_matrix(angle)
    field = random_field(group, 3, 0)
    flow = Flow(lambda z: field(z @ torch.tensor(matrix)), steps=4, duration=0.2)
    error = map_equivariance_error(flow, group.conjugate(matrix), random_tensor(0, 40, 2))
    assert error > 0.05  # a field of size one, followed for a time of 0.2
