"""The bound of a field's Jacobian: it holds, and the group's factor is what can be reached."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.fields import FourierField, group_factor, steepness
from orbiflow.flows import METHODS
from orbiflow.symmetry import WALLPAPER_GROUPS, CrystallographicGroup, wallpaper_group
from strategies import SMALL_SPACE_GROUPS, groups, random_field, random_tensor, seeds, space_group

NINE = ("p1", "p2", "p3", "p4", "p6", "pg", "pgg")
"""Groups of the nine isohedral classes."""


def factor(field: FourierField) -> float:
    return group_factor(field.group, field.basis)


def steep(field: FourierField) -> float:
    return float(steepness(field.parameters_.detach(), torch.tensor(field.basis.magnitude)))


def steepest(field: FourierField, seed: int, count: int = 100) -> float:
    with torch.no_grad():
        slopes = field.jacobian(random_tensor(seed, count, field.group.dim))
    return float(torch.linalg.matrix_norm(slopes, ord=2).max())


@settings(max_examples=30)
@given(groups, st.integers(1, 3), seeds)
def test_no_sampled_slope_exceeds_the_groups_factor_times_the_steepness(
    group: CrystallographicGroup, max_frequency: int, seed: int
) -> None:
    field = random_field(group, min(max_frequency, 4 - group.dim), seed)
    found = steepest(field, seed) * (1 - 1e-12)
    assert found <= float(field.lipschitz_bound())
    assert found <= factor(field) * steep(field)


@pytest.mark.parametrize("name", WALLPAPER_GROUPS)
def test_the_factor_is_nearly_reached(name: str) -> None:
    field = FourierField(wallpaper_group(name), 3)
    reached = 0.0
    for index in range(field.size):
        with torch.no_grad():
            field.parameters_.zero_()
            field.parameters_[index] = 1.0
        if steep(field) > 0:
            reached = max(reached, steepest(field, index, 2000) / steep(field))
    assert 0.95 * factor(field) <= reached <= factor(field) * (1 + 1e-12)


@pytest.mark.parametrize(
    ("name", "expected"),
    [("p1", 1.0), ("p2", 1.0), ("p3", 0.75**0.5), ("p4", 0.5**0.5), ("p6", 0.75**0.5)],
)
def test_the_factor_of_groups_without_reflections(name: str, expected: float) -> None:
    field = FourierField(wallpaper_group(name), 4)
    assert factor(field) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("name", WALLPAPER_GROUPS)
def test_no_plane_group_exceeds_root_two(name: str) -> None:
    field = FourierField(wallpaper_group(name), 8)
    assert factor(field) <= math.sqrt(2.0)
    if name in NINE:  # the descent's steps need not shrink
        assert 0.4 * factor(field) < METHODS["midpoint"].injective_below


@pytest.mark.parametrize("name", SMALL_SPACE_GROUPS)
def test_the_factor_of_a_space_group_is_at_most_the_root_of_its_orbits(name: str) -> None:
    group = space_group(name, 0)
    field = FourierField(group, 1)
    assert 0.0 < factor(field) <= math.sqrt(group.order) + 1e-12


@given(st.sampled_from(sorted(WALLPAPER_GROUPS)), st.integers(1, 3), seeds)
def test_the_bound_is_near_what_is_reached_in_the_plane(name, max_frequency, seed) -> None:
    field = random_field(wallpaper_group(name), max_frequency, seed)
    assert float(field.lipschitz_bound()) <= 1.35 * steepest(field, seed, 4000)
