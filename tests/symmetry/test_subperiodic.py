"""Friezes, rods, layers and point groups: groups that are periodic along some axes alone."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.errors import GroupError, SettingError
from orbiflow.fields import divergence, jacobian, symmetrize
from orbiflow.flows import Flow, load_flow, save_flow
from orbiflow.symmetry import (
    EquivarianceError,
    assert_equivariant,
    lattice_along,
    space_group,
    wallpaper_group,
)
from refusals import refused
from strategies import largest, random_tensor

LAYERS = """
p 1|p -1|p 1 1 2|p 1 1 m|p 1 1 a|p 1 1 2/m|p 1 1 2/a|p 2 1 1|p 21 1 1|c 2 1 1|p m 1 1|p b 1 1|
c m 1 1|p 2/m 1 1|p 21/m 1 1|p 2/b 1 1|p 21/b 1 1|c 2/m 1 1|p 2 2 2|p 21 2 2|p 21 21 2|c 2 2 2|
p m m 2|p m a 2|p b a 2|c m m 2|p m 2 m|p m 21 b|p b 21 m|p b 2 b|p m 2 a|p m 21 n|p b 21 a|
p b 2 n|c m 2 m|c m 2 a|p m m m|p m a a|p b a n|p m a m|p m m a|p m a n|p b a a|p b a m|p b m a|
p m m n|c m m m|c m m a|p 4|p -4|p 4/m|p 4/n|p 4 2 2|p 4 21 2|p 4 m m|p 4 b m|p -4 2 m|p -4 21 m|
p -4 m 2|p -4 b 2|p 4/m m m|p 4/n b m|p 4/m b m|p 4/n m m|p 3|p -3|p 3 1 2|p 3 2 1|p 3 m 1|
p 3 1 m|p -3 1 m|p -3 m 1|p 6|p -6|p 6/m|p 6 2 2|p 6 m m|p -6 m 2|p -6 2 m|p 6/m m m
"""
RODS = """
p 1|p -1|p 2 1 1|p m 1 1|p c 1 1|p 2/m 1 1|p 2/c 1 1|p 1 1 2|p 1 1 21|p 1 1 m|p 1 1 2/m|
p 1 1 21/m|p 2 2 2|p 2 2 21|p m m 2|p c c 2|p m c 21|p 2 m m|p 2 c m|p m m m|p c c m|p m c m|p 4|
p 41|p 42|p 43|p -4|p 4/m|p 42/m|p 4 2 2|p 41 2 2|p 42 2 2|p 43 2 2|p 4 m m|p 42 c m|p 4 c c|
p -4 2 m|p -4 2 c|p 4/m m m|p 4/m c c|p 42/m m c|p 3|p 31|p 32|p -3|p 3 1 2|p 31 1 2|p 32 1 2|
p 3 m 1|p 3 c 1|p -3 1 m|p -3 1 c|p 6|p 61|p 62|p 63|p 64|p 65|p -6|p 6/m|p 63/m|p 6 2 2|p 61 2 2|
p 62 2 2|p 63 2 2|p 64 2 2|p 65 2 2|p 6 m m|p 6 c c|p 63 m c|p -6 m 2|p -6 c 2|p 6/m m m|
p 6/m c c|p 63/m m c
"""
KINDS = {
    "xy": [name.strip() for name in LAYERS.split("|")],
    "z": [name.strip() for name in RODS.split("|")],
}


def whole(name: str):
    """The space group of the same name, on a cell that all groups of its name fit."""
    sides = (
        (1.0, 1.0, 2.0) if name[2] in "346" or name[2:4] in ("-3", "-4", "-6") else (1.0, 1.2, 2.0)
    )
    cell = (*sides, 90, 90, 120 if name[2:4].strip("- ")[0] in "36" else 90)
    return space_group(name.capitalize(), cell, origin=1)


def wild(points):
    """A field without any symmetry or period."""
    mixed = torch.tensor([[0.9, -0.4, 0.3], [0.5, 0.8, -0.7], [-0.6, 0.3, 0.5]]).to(points)
    d = points.shape[-1]
    return torch.tanh(points @ mixed[:d, :d] + mixed[:d, 0])


names = st.sampled_from([(along, name) for along, names in KINDS.items() for name in names])


@settings(max_examples=4)
@given(names)
def test_a_layer_or_rod_group_is_a_space_group_without_some_translations(drawn):
    along, name = drawn
    group = whole(name)
    field = symmetrize(wild, group, along=along)
    assert lattice_along(group, along).shape == (3, len(along))
    assert_equivariant(field, group, along=along)
    with pytest.raises(EquivarianceError):  # not periodic across
        assert_equivariant(field, group)


FRIEZES = {
    **{"p1": ("p1", "x"), "p11g": ("pg", "y"), "p1m1": ("pm", "x"), "p11m": ("pm", "y")},
    **{"p2": ("p2", "x"), "p2mg": ("pmg", "x"), "p2mm": ("pmm", "x")},
}


@pytest.mark.parametrize("name", FRIEZES)
def test_friezes_are_plane_groups_along_one_axis(name):
    plane, along = FRIEZES[name]
    group = wallpaper_group(plane, [[1.0, 0.0], [0.0, 1.2]])
    flow = Flow([symmetrize(wild, group, along=along)], steps=4)
    assert_equivariant(flow, group, kind="map", along=along)
    with pytest.raises(EquivarianceError):
        assert_equivariant(flow, group, kind="map")


@pytest.mark.parametrize("name", ["1", "-1", "m m 2", "3 2 1", "m -3 m"])
def test_point_groups_are_space_groups_without_translations(name):
    group = space_group(f"P {name}")
    field = symmetrize(wild, group, along="")
    assert_equivariant(field, group, along="")
    points = random_tensor(0, 5, 3)
    mean = torch.stack([g.inverse().push(wild(g(points))) for g in group.cosets]).mean(dim=0)
    torch.testing.assert_close(field(points), mean, rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    ("name", "along"), [("P 4 m m", "z"), ("P 4/n b m:1", "xy"), ("P 2 3", "")]
)
def test_divergences_and_files(tmp_path, name, along):
    group = space_group(name)
    field = symmetrize(torch.nn.Tanh(), group, along=along)
    points = random_tensor(1, 6, 3)
    trace = jacobian(field, points).diagonal(dim1=-2, dim2=-1).sum(dim=-1)
    torch.testing.assert_close(divergence(field, points), trace, rtol=0, atol=1e-12)
    flow = Flow([field], steps=4)
    save_flow(flow, tmp_path / "flow.safetensors")
    again = load_flow(tmp_path / "flow.safetensors", modules={"Tanh": torch.nn.Tanh})
    assert largest(again(points) - flow(points)) == 0.0
    assert_equivariant(again, group, kind="map", along=along)


def test_a_group_about_another_point_or_with_slanted_vectors():
    moved = space_group("P 4/n b m:1").conjugate(np.eye(3), [0.2, 0.1, 0.3])
    assert lattice_along(moved, "xy").shape == (3, 2)
    centred = space_group("C 2 2 2", (1, 1.2, 0.3))
    assert np.abs(lattice_along(centred, "xy")[2]).max() == 0.0
    assert abs(np.linalg.det(lattice_along(centred, "xy")[:2])) == pytest.approx(0.6)


@pytest.mark.parametrize(
    ("name", "along"),
    [("P 41", "xy"), ("P c", "xy"), ("P 2 3", "xy"), ("P 2 3", "z"), ("P n n n:1", "")],
)
def test_groups_that_screw_glide_or_turn_across_are_refused(name, along):
    with refused(f"'{along}'", kind=GroupError):
        lattice_along(space_group(name), along)


@pytest.mark.parametrize("along", ["w", "xx", "X", 3, "xyzw", ("x",)])
def test_axes_that_are_none_are_refused(along):
    with refused("along", kind=SettingError):
        symmetrize(wild, wallpaper_group("p1"), along=along)
