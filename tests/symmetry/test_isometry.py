"""Isometries of R^d as a group acting on points and vectors; centres and lines of groups."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.errors import GroupError, NotAnIsometryError
from orbiflow.symmetry import (
    WALLPAPER_GROUPS,
    CrystallographicGroup,
    Isometry,
    identity,
    rotation,
    symmetry_elements,
    transflection,
    wallpaper_group,
)
from refusals import refused
from strategies import isometries, random_points, seeds

dims = st.sampled_from((1, 2, 3, 5))
triples = dims.flatmap(lambda d: st.tuples(isometries(d), isometries(d), isometries(d)))
single = dims.flatmap(isometries)


@given(triples, seeds)
def test_a_product_acts_as_one_map_after_the_other(three, seed):
    f, g, _ = three
    p = random_points(seed, 4, 3, f.dim)
    np.testing.assert_allclose((f @ g)(p), f(g(p)), atol=1e-13)


@given(single)
def test_inverse_undoes_from_either_side(g):
    assert (g.inverse() @ g).is_close(identity(g.dim), 1e-13)
    assert (g @ g.inverse()).is_close(identity(g.dim), 1e-13)


@given(single, seeds)
def test_push_is_the_difference_of_two_images(g, seed):
    p, v = random_points(seed, 2, 6, g.dim)
    np.testing.assert_allclose(g.push(v), g(p + v) - g(p), atol=1e-13)


@given(single, seeds, st.sampled_from([(torch.float64, 1e-14), (torch.float32, 5e-6)]))
def test_torch_and_numpy_agree(g, seed, kind):
    dtype, tolerance = kind
    p = random_points(seed, 5, g.dim)
    moved, pushed = g(torch.tensor(p, dtype=dtype)), g.push(torch.tensor(p, dtype=dtype))
    assert moved.dtype == pushed.dtype == dtype
    np.testing.assert_allclose(moved.numpy(), g(p), atol=tolerance)
    np.testing.assert_allclose(pushed.numpy(), g.push(p), atol=tolerance)


def test_parts_cannot_be_changed_from_outside():
    linear = np.eye(2)
    g = Isometry(linear, np.zeros(2))
    linear[0, 0] = 5.0
    assert g.linear[0, 0] == 1.0
    with refused("read-only", kind=ValueError):
        g.translation[0] = 1.0


@given(single, st.floats(1e-7, 1.0))
def test_a_stretch_is_refused(g, amount):
    with refused("orthogonal", kind=NotAnIsometryError):
        Isometry(g.linear * (1 + amount), g.translation)


@pytest.mark.parametrize(
    ("linear", "shift"),
    [
        (np.eye(2), np.zeros(3)),
        (np.eye(3)[:2], np.zeros(2)),
        (np.eye(2), np.zeros((2, 1))),
        (np.zeros((0, 0)), np.zeros(0)),
    ],
)
def test_shapes_that_disagree_are_refused(linear, shift):
    with refused(np.shape(linear), np.shape(shift), kind=NotAnIsometryError):
        Isometry(linear, shift)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_entries_that_are_not_finite_are_refused(bad):
    with refused("NaN", kind=NotAnIsometryError):
        Isometry(np.eye(2), np.array([0.0, bad]))


def test_dimensions_do_not_mix():
    with refused("R^2", "R^3", kind=GroupError):
        _ = identity(2) @ identity(3)
    assert not identity(2).is_close(identity(3))


def test_integer_tensors_are_refused_rather_than_truncated():
    with refused("int64", kind=GroupError):
        identity(2)(torch.tensor([1, 2]))


@pytest.mark.parametrize("name", WALLPAPER_GROUPS)
def test_every_element_found_is_in_the_group(name: str) -> None:
    group = wallpaper_group(name)
    found = symmetry_elements(group)
    for center in found.centers:
        assert group.contains(rotation(center.point, center.order), 1e-7)
        for higher in (2 * center.order, 3 * center.order):
            assert not group.contains(rotation(center.point, higher), 1e-7)
    for line in found.lines:
        assert group.contains(transflection(line.line, line.shift), 1e-7)
        assert line.is_mirror == (line.shift == 0.0)


ORDERS = {"p2": {2}, "pmm": {2}, "pmg": {2}, "pgg": {2}, "cmm": {2}}
ORDERS |= {name: {2, 4} for name in ("p4", "p4m", "p4g")}
ORDERS |= {name: {3} for name in ("p3", "p3m1", "p31m")}
ORDERS |= {name: {2, 3, 6} for name in ("p6", "p6m")}


@pytest.mark.parametrize("name", WALLPAPER_GROUPS)
def test_kinds(name: str) -> None:
    found = symmetry_elements(wallpaper_group(name))
    assert {center.order for center in found.centers} == ORDERS.get(name, set())
    mirrors = {line.is_mirror for line in found.lines}
    assert (True in mirrors) == (
        name in {"pm", "cm", "pmm", "pmg", "cmm"} or "m" in name[2:] or name == "p4g"
    )
    assert (False in mirrors) == (
        name in {"pg", "cm", "pmg", "pgg", "cmm", "p4m", "p4g", "p3m1", "p31m", "p6m"}
    )


def test_a_disc_of_p4() -> None:
    found = symmetry_elements(wallpaper_group("p4"), np.array([0.5, 0.5]), 0.75)
    assert sorted(center.order for center in found.centers) == [2] * 4 + [4] * 5


def test_needs_a_plane_group() -> None:
    with refused("dimension", 3, kind=GroupError):
        symmetry_elements(CrystallographicGroup.generate(np.eye(3)))
