"""Fields without divergence: symmetric, complete, saved, and flows that keep volumes."""

import numpy as np
import torch
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.fields import FourierField, SplineField
from orbiflow.flows import Flow, load_flow, save_flow
from orbiflow.symmetry import CrystallographicGroup, wallpaper_group
from refusals import refused
from strategies import SMALL_SPACE_GROUPS, groups, largest, random_tensor, seeds, space_groups


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
