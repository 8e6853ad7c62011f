"""The check for users' own tests: passes what commutes, names what fails."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given, settings

from orbiflow.errors import GroupError, OrbiflowError
from orbiflow.fields import symmetrize
from orbiflow.flows import Flow
from orbiflow.symmetry import EquivarianceError, assert_equivariant, wallpaper_group
from strategies import groups, plane_groups, random_field, random_tensor, seeds, several


@settings(max_examples=7)
@given(groups, seeds)
def test_symmetric_fields_maps_and_densities_pass(group, seed):
    fields = several(group, seed, 2) if group.dim < 3 else [random_field(group, 1, seed, rms=0.02)]
    flow = Flow(fields, steps=2)
    assert_equivariant(fields[0], group, seed=seed)
    assert_equivariant(flow, group, kind="map", points=random_tensor(seed, 9, group.dim))
    assert_equivariant(flow.log_abs_det_jacobian, group, kind="invariant")


@given(plane_groups.filter(lambda group: group.order > 1), seeds)
def test_a_field_of_the_lattice_alone_fails(group, seed):
    lattice = type(group)(group.lattice, group.cosets[:1])
    field = random_field(lattice, 2, seed)
    assert_equivariant(field, lattice)
    with pytest.raises(EquivarianceError) as caught:
        assert_equivariant(field, group)
    found, element = caught.value, caught.value.element
    assert found.error > 1e-3
    assert any(
        torch.equal(torch.tensor(element.linear), torch.tensor(g.linear)) for g in group.cosets
    )
    assert f"off by {found.error:.1e}" in str(found)


def test_the_message_names_the_coset_and_the_size():
    p4 = wallpaper_group("p4")
    field = symmetrize(torch.tanh, p4)
    message = r"V\(g p\) = R_g V\(p\) fails for .*p4.* coset [2-4] of 4, g = Isometry.*off by 2\.0e"
    with pytest.raises(EquivarianceError, match=message):
        assert_equivariant(lambda p: field(p) + torch.tensor([0.0, 1.0]).to(p), p4)
    # a field is no map
    with pytest.raises(EquivarianceError, match=r"D\(g p\)"):
        assert_equivariant(field, p4, kind="map")
    with pytest.raises(EquivarianceError, match=r"f\(g p\)"):
        assert_equivariant(lambda p: p[:, 0], p4, kind="invariant")


def test_a_field_that_is_not_periodic_fails():
    with pytest.raises(EquivarianceError, match="coset 1 of 2"):
        assert_equivariant(lambda p: p, wallpaper_group("p2"))


def test_values_that_are_no_numbers_fail():
    with pytest.raises(EquivarianceError, match="off by nan"):
        assert_equivariant(lambda p: p * torch.nan, wallpaper_group("p1"))


@pytest.mark.parametrize("cells", [0, 3])
def test_tolerances_scale_with_the_values(cells):
    p2, field = wallpaper_group("p2"), random_field(wallpaper_group("p2"), 2, 0)
    assert_equivariant(lambda p: 1e9 * field(p), p2, cells=cells)
    with pytest.raises(EquivarianceError):
        assert_equivariant(lambda p: field(p) + 1e-6, p2, cells=cells)
    assert_equivariant(lambda p: field(p) + 1e-6, p2, cells=cells, atol=1e-5)


@pytest.mark.parametrize("metres", [4e-10, 1e-6, 1.0, 3e8])
@pytest.mark.parametrize("name", ["p2", "pg", "p4g", "p6m"])
def test_maps_are_measured_in_cells_whatever_the_unit(name, metres):
    group = wallpaper_group(name)
    group = group.conjugate(metres * torch.eye(2).numpy(), [0.0, 0.0])
    shift = torch.tensor([0.28 * metres, 0.0], dtype=torch.float64)
    assert_equivariant(lambda p: p, group, kind="map")
    assert_equivariant(lambda p: p * (1 + 1e-12), group, kind="map")
    with pytest.raises(EquivarianceError):  # it commutes with translations alone
        assert_equivariant(lambda p: p + shift * torch.tensor([1.0, 0.5]).to(p), group, kind="map")
    with pytest.raises(EquivarianceError):
        assert_equivariant(lambda p: p * (1 + 1e-7), group, kind="map")


@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e20])
def test_fields_and_invariants_are_measured_by_their_own_size(unit):
    group = wallpaper_group("p4")
    group = group.conjugate(1e-9 * torch.eye(2).numpy(), [0.0, 0.0])
    field = random_field(group, 2, 0)
    scale = unit / float(field(torch.zeros(1, 2, dtype=torch.float64) + 1e-10).detach().abs().max())
    assert_equivariant(lambda p: scale * field(p), group)
    wrong = torch.tensor([1e-6 * unit, 0.0], dtype=torch.float64)
    with pytest.raises(EquivarianceError):
        assert_equivariant(lambda p: scale * field(p) + wrong, group)
    wave = torch.tensor([2e9 * torch.pi, 0.0], dtype=torch.float64)
    with pytest.raises(EquivarianceError):
        assert_equivariant(lambda p: unit * torch.cos(p @ wave), group, kind="invariant")
    assert_equivariant(lambda p: 0.0 * p[:, 0], group, kind="invariant")


def test_mistakes_are_refused():
    p2 = wallpaper_group("p2")
    with pytest.raises(OrbiflowError, match="kind must be"):
        assert_equivariant(torch.sin, p2, kind="scalar")  # type: ignore[arg-type]
    with pytest.raises(GroupError, match="wallpaper_group"):
        assert_equivariant(torch.sin, "p2")  # type: ignore[arg-type]
    with pytest.raises(OrbiflowError, match=r"got \(32,\)"):
        assert_equivariant(lambda p: p[:, 0], p2)
