"""Operators as text: read, written, and refused."""

import gemmi
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from orbiflow.errors import GroupError, LatticeMismatchError
from orbiflow.symmetry import (
    CrystallographicGroup,
    Isometry,
    group_from_operators,
    operators,
    translation,
    wallpaper_group,
)
from orbiflow.symmetry.group import generated
from orbiflow.symmetry.triplets import parse_operator
from refusals import refused
from strategies import groups, random_orthogonal, seeds

# centres of inversion nearly at 0, at distances that equality of groups tells apart
near = [generated(np.eye(1), [Isometry(-np.eye(1), np.array([x]))]) for x in (2.4e-7, 1.003e-9)]


@settings(max_examples=7)
@given(groups, seeds)
@example(near[0], 0)
def test_any_group_is_that_of_its_operators(group, seed):
    rng = np.random.default_rng(seed)
    # turned, and about a point at no simple fraction
    turned = group.conjugate(random_orthogonal(rng, group.dim), rng.uniform(-1, 1, group.dim))
    for there in (group, turned):
        assert group_from_operators(operators(there), there.lattice) == there


@settings(max_examples=7)
@given(groups)
@example(near[1])
def test_operators_of_a_coarser_cell_have_the_centring(group):
    coarse = operators(group, 2 * group.lattice)
    assert len(coarse) == len(set(coarse)) == group.order * 2**group.dim
    again = group_from_operators(coarse, 2 * group.lattice)
    assert again.order == group.order
    assert again.cell_volume == pytest.approx(group.cell_volume)
    # what is rounded is a share of the cell's size, and this cell is twice as large
    assert all(group.contains(element, 4e-9) for element in again.cosets)


entries = st.sampled_from([-2, -1, 1, 2])
shifts = st.fractions(0, 1, max_denominator=24).filter(lambda x: 24 % x.denominator == 0)


@given(st.lists(st.tuples(entries, entries, entries, shifts), min_size=3, max_size=3))
def test_operators_are_read_as_another_program_reads_them(rows):
    text = ",".join(f"{a:+d}*x{b:+d}*y {c:+d}*z+{w}" for a, b, c, w in rows)
    read = gemmi.Op(text)
    table = parse_operator(text, 3)
    np.testing.assert_array_equal(table[:, :3], np.array(read.rot) / read.DEN)
    np.testing.assert_allclose(table[:, 3], np.array(read.tran) / read.DEN, atol=1e-15)


@pytest.mark.parametrize(
    "text",
    [
        *("", "x", "x,y", "x,y,z,x", "x,y,w", "x,y,+", "x,y,*z", "x,y,z*", "x,y,1/0", "x,y,z+-1"),
        *(
            *("x,y,1e9", "x,y," + "1" * 300, "x,y,z" * 99, "x,y,1/2/3", "x,y,.", "x,y,z\0"),
            *("xy,y,z", "x++y,y,z", "x,y,z" + " " * 200),
        ),
        "x,y,__import__('os')",
    ],
)
def test_texts_that_are_no_operators_are_refused(text):
    with refused("3 dimensions", kind=GroupError):
        group_from_operators([text], np.eye(3))


def test_too_many_operators_are_refused():
    with refused(2048, kind=GroupError):
        group_from_operators(("x" for _ in range(10**9)), [[1.0]])


def test_an_operator_that_does_not_fit_names_a_cell_that_does():
    with refused("74.744881", "90.0", kind=LatticeMismatchError) as caught:
        group_from_operators(["-x,-y", "-y,x"], [[1.0, 0.3], [0.0, 1.1]])
    side = float(str(caught.value).split("fits has [")[1].split(",")[0])
    assert group_from_operators(["-y,x"], side * np.eye(2)).order == 4
    with refused("[1.0, 1.0, 90.0]", kind=LatticeMismatchError):
        group_from_operators(["x+y,y"], np.eye(2))


def test_a_lattice_of_no_translations_is_refused():
    group = wallpaper_group("p4")
    with refused("lattice", kind=GroupError):
        operators(group, np.eye(2) / 2)
    with refused(3, 4, kind=GroupError):
        operators(CrystallographicGroup.generate(np.eye(4)))


def test_the_primitive_lattice_of_a_primitive_group_is_its_own():
    group = wallpaper_group("p4g")
    assert group.primitive() is group


@given(st.integers(1, 3), st.integers(2, 4), seeds)
def test_the_primitive_lattice_is_that_of_all_translations(dim, fold, seed):
    rng = np.random.default_rng(seed)
    lattice = rng.uniform(-0.3, 0.3, (dim, dim)) + np.eye(dim)
    shift = translation(lattice @ rng.integers(0, fold, dim) / fold)
    group = CrystallographicGroup.generate(lattice, [shift])
    fine = group.primitive()
    assert fine.order == 1
    assert fine == group
    assert (
        np.linalg.norm(fine.lattice, axis=0).min() <= np.linalg.norm(lattice, axis=0).min() + 1e-9
    )
