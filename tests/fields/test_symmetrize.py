"""Any field made to commute with a group, and the paper's nested operators."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import nn

from orbiflow.fields import jacobian, periodic_operator, summed_over_powers, symmetrize
from orbiflow.symmetry import (
    IDENTIFICATION_SPACES,
    CrystallographicGroup,
    identification_group,
    wallpaper_group,
)
from orbiflow.tiles import CLASSES
from refusals import refused
from strategies import (
    central_difference,
    equivariance_error,
    groups,
    random_field,
    random_tensor,
    seeds,
)


def swirl(p):
    """A field with no symmetry and no period."""
    return torch.tanh(p + 0.3) * (1.0 + 0.2 * p.sum(dim=-1, keepdim=True).cos()) + 0.1 * p


@settings(max_examples=10)
@given(groups, seeds)
def test_any_function_becomes_equivariant_and_periodic(group, seed):
    points = random_tensor(seed, 8, group.dim)
    assert equivariance_error(symmetrize(swirl, group), group, points) < 1e-11


@given(groups, seeds)
def test_an_equivariant_field_is_unchanged(group, seed):
    field = random_field(group, 1, seed)
    points = random_tensor(seed, 6, group.dim)
    torch.testing.assert_close(symmetrize(field, group)(points), field(points), rtol=0, atol=1e-12)


@pytest.mark.parametrize("order", [0, 1])
def test_the_value_and_slope_do_not_jump_at_the_edge_of_the_cell(order):
    group = wallpaper_group("p1")
    basis = torch.tensor(group.lattice)
    along = torch.linspace(0.05, 0.95, 7, dtype=torch.float64)

    def across(epsilon):
        u = torch.stack([torch.full_like(along, epsilon), along], dim=-1)
        field = symmetrize(swirl, group)
        quantity = field if order == 0 else lambda p: central_difference(field, p, 1e-6)
        return quantity(u @ basis.mT)

    jump = (across(1e-5) - across(-1e-5)).abs().max()
    within = (across(3e-5) - across(1e-5)).abs().max()
    assert float(jump) < 2 * float(within) + 1e-8


@settings(max_examples=10)
@given(groups, seeds, st.booleans())
def test_the_divergence_is_the_trace_of_the_jacobian(group, seed, closed):
    inner = random_field(group, 1, seed) if closed else torch.tanh
    field = symmetrize(inner, group)
    points = random_tensor(seed, 5, group.dim)
    values, divergence = field.bound_with_divergence()(points)
    torch.testing.assert_close(values, field(points), rtol=0, atol=1e-12)
    trace = jacobian(field, points).diagonal(dim1=-2, dim2=-1).sum(dim=-1)
    torch.testing.assert_close(divergence, trace, rtol=1e-9, atol=1e-9)


def test_parameters_are_trained_through_the_divergence():
    field = symmetrize(torch.nn.Linear(2, 2).double(), wallpaper_group("p3"))
    points = random_tensor(0, 5, 2)
    _, divergence = field.bound_with_divergence()(points)
    found = torch.autograd.grad(divergence.square().sum(), list(field.parameters()))
    trace = jacobian(field, points).diagonal(dim1=-2, dim2=-1).sum(dim=-1)
    expected = torch.autograd.grad(trace.square().sum(), list(field.parameters()))
    for one, other in zip(found, expected, strict=True):
        torch.testing.assert_close(one, other, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("field", "about"),
    [
        *(("p4", "p4"), (None, "None"), (lambda p: p[..., 0], (3,))),
        *((lambda p: torch.cat([p, p], dim=-1), (3, 4)), (lambda p: p.numpy(), "array")),
        (nn.Linear(2, 3), (3, 3)),
    ],
)
def test_what_is_no_field_is_refused_at_once(field, about):
    with refused(about):
        symmetrize(field, wallpaper_group("p4"))


@pytest.mark.parametrize("periodic", [True, False])
def test_a_field_of_other_points_is_refused_with_words(periodic):
    points = torch.zeros(5, 2, dtype=torch.float64)
    single = symmetrize(nn.Linear(2, 2), wallpaper_group("p4"), periodic=periodic)
    spatial = symmetrize(nn.Linear(3, 3).double(), wallpaper_group("p4"), periodic=periodic)
    late = symmetrize(
        lambda p: p if len(p) < 4 else p[..., :1], wallpaper_group("p4"), periodic=True
    )
    for field in (single, spatial):
        for call in (field, field.divergence):
            with refused("float64", "(..., 2)"):
                call(points)
    with refused("(4, 5, 1)"):
        late(points)


@pytest.mark.parametrize("periodic", [True, False])
def test_lists_arrays_and_dtypes_are_followed(periodic):
    weight = random_tensor(0, 2, 2)
    field = symmetrize(lambda p: p.double() @ weight, wallpaper_group("p3"), periodic=periodic)
    points = random_tensor(0, 4, 2)
    known, slope = field(points), field.divergence(points)
    for same in (points.tolist(), points.numpy()):
        torch.testing.assert_close(field(same), known)
        torch.testing.assert_close(field.divergence(same), slope)  # pyright: ignore[reportArgumentType]
    assert field(points.float()).dtype == field.divergence(points.float()).dtype == torch.float32
    assert field(np.array([1, 2])).dtype == torch.float64
    with refused("points", "ab"):
        field("ab")


def test_trying_a_field_draws_nothing():
    torch.manual_seed(3)
    wanted = torch.rand(4)
    torch.manual_seed(3)
    symmetrize(lambda p: p + torch.rand_like(p), wallpaper_group("p1"))
    assert torch.equal(torch.rand(4), wanted)


UNIT_CELL = CrystallographicGroup.generate(np.eye(2))

# terms of the paper's nested sums = factor between them and the mean over cosets
TERMS = {
    **{"IH1": 1, "IH2": 2 * 2, "IH3": 2 * 2, "IH4": 2 * 2 * 2 * 2, "IH5": 2 * 2 * 2 * 2},
    **{"IH6": 2 * 2 * 2 * 2, "IH7": 3, "IH21": 3 * 6, "IH28": 4 * 4, "torus": 1, "sphere": 4},
    **{"klein-bottle": 2, "projective-plane": 2 * 2},
}


def group_and_operators(name):
    """The group, and the paper's operators as (isometry, number of terms), outermost first."""
    if name in CLASSES:
        return CLASSES[name].group(), CLASSES[name].paper_operators()
    orders = {"sphere": 4}
    generators = IDENTIFICATION_SPACES[name].generators
    return identification_group(name), [(g, orders.get(name, 2)) for g in generators]


def nested(field, name):
    """The field of the paper's table: its operators around P_B(F), innermost last."""
    group, operators = group_and_operators(name)
    result = periodic_operator(field, group.lattice)
    for g, terms in reversed(list(operators)):
        result = summed_over_powers(result, g, terms)
    return result


@pytest.mark.parametrize("name", TERMS)
@settings(max_examples=4)
@given(seed=seeds, max_frequency=st.integers(1, 4))
def test_nested_sums_are_the_mean_over_cosets_times_their_number_of_terms(
    name, seed, max_frequency
):
    group, _ = group_and_operators(name)
    plain = random_field(UNIT_CELL, max_frequency, seed)
    points = random_tensor(seed, 10, 2)
    mean = symmetrize(periodic_operator(plain, group.lattice), group, periodic=True)
    torch.testing.assert_close(
        nested(plain, name)(points), TERMS[name] * mean(points), rtol=0, atol=2e-11
    )


@given(seeds, st.integers(0, 3))
def test_the_basis_operator_pushes_a_unit_periodic_field_to_the_lattice(seed, max_frequency):
    plain = random_field(UNIT_CELL, max_frequency, seed)
    lattice = np.array([[1.5, 0.2], [-0.3, 0.8]])
    p = random_tensor(seed, 5, 2)
    expected = plain(p @ torch.tensor(np.linalg.inv(lattice)).mT) @ torch.tensor(lattice).mT
    torch.testing.assert_close(periodic_operator(plain, lattice)(p), expected, rtol=0, atol=1e-12)
