"""The check for users' own tests: passes what commutes, names what fails."""

from collections.abc import Callable

import numpy as np
import pytest
import torch
from hypothesis import given, settings

from orbiflow.errors import GroupError
from orbiflow.fields import symmetrize
from orbiflow.flows import Flow
from orbiflow.symmetry import EquivarianceError, assert_equivariant, group_by_name, wallpaper_group
from orbiflow.symmetry.equivariance import Kind
from refusals import refused
from strategies import groups, plane_groups, random_field, random_tensor, seeds, several


@settings(max_examples=3)
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


def test_the_error_names_the_coset_and_the_size():
    p4 = wallpaper_group("p4")
    field = symmetrize(torch.tanh, p4)
    with refused("V(g p)", "p4", "of 4", "2.0e", kind=EquivarianceError):
        assert_equivariant(lambda p: field(p) + torch.tensor([0.0, 1.0]).to(p), p4)
    # a field is no map
    with refused("D(g p)", kind=EquivarianceError):
        assert_equivariant(field, p4, kind="map")
    with refused("f(g p)", kind=EquivarianceError):
        assert_equivariant(lambda p: p[:, 0], p4, kind="invariant")


def test_a_field_that_is_not_periodic_fails():
    with pytest.raises(EquivarianceError) as caught:
        assert_equivariant(lambda p: p, wallpaper_group("p2"))
    assert abs(caught.value.element.translation).max() > 0.5


def test_values_that_are_no_numbers_fail():
    with refused("nan", kind=EquivarianceError):
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


def bumps(centers: list[np.ndarray], width: float) -> Callable[[torch.Tensor], torch.Tensor]:
    """A sum of bumps of height 1, of the lattice's unit."""
    at = torch.tensor(np.array(centers))
    return lambda p: torch.exp(-((torch.cdist(p, at) / width) ** 2) / 2).sum(dim=1)


@pytest.mark.parametrize("name", ["p1", "p4g", "P 21 3"])
@pytest.mark.parametrize("kind", ["field", "map", "invariant"])
def test_what_is_wrong_only_in_a_narrow_bump_fails(name: str, kind: Kind) -> None:
    group, rng = group_by_name(name), np.random.default_rng(0)
    width = 0.02 if group.dim == 2 else 0.05
    base = random_field(group, 2 if group.dim == 2 else 1, 0, rms=0.1)
    along = torch.linspace(0.2, 1.0, group.dim, dtype=torch.float64)
    for cell in (0, 0, 1, -1):  # the bump is in one of the cells alone
        bump = bumps([group.lattice @ (rng.random(group.dim) + cell)], width)
        wrong: dict[Kind, Callable[[torch.Tensor], torch.Tensor]] = {
            "field": lambda p, bump=bump: base(p) + bump(p)[:, None] * along,
            "map": lambda p, bump=bump: p + bump(p)[:, None] * along,
            "invariant": lambda p, bump=bump: 3.0 + bump(p),
        }
        with pytest.raises(EquivarianceError) as caught:
            assert_equivariant(wrong[kind], group, kind=kind)
        assert caught.value.error > 0
        assert "4096 points" in str(caught.value)
        assert f"{3**group.dim} cells" in str(caught.value)


@pytest.mark.parametrize("name", ["p2", "p4g"])
def test_one_of_many_images_of_a_narrow_bump_is_missed_by_one_element(name: str) -> None:
    group, rng = wallpaper_group(name), np.random.default_rng(1)
    steps = [group.lattice @ [i, j] for i in range(-3, 4) for j in range(-3, 4)]
    for _ in range(3):
        center = group.lattice @ rng.random(2)
        whole = [g(center) + step for g in group.cosets for step in steps]
        assert_equivariant(bumps(whole, 0.01), group, kind="invariant")
        with pytest.raises(EquivarianceError):
            assert_equivariant(bumps(whole[: -len(steps)], 0.01), group, kind="invariant")


def test_mistakes_are_refused():
    p2 = wallpaper_group("p2")
    with refused("kind", "scalar"):
        assert_equivariant(torch.sin, p2, kind="scalar")  # type: ignore[arg-type]
    with refused("wallpaper_group", kind=GroupError):
        assert_equivariant(torch.sin, "p2")  # type: ignore[arg-type]
    with refused("(4096, 2)", "(4096,)"):
        assert_equivariant(lambda p: p[:, 0], p2)
