"""Space groups by name, by operators as text, and with two origins."""

import re

import gemmi
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from orbiflow.density import QuotientSpace
from orbiflow.errors import GroupError, LatticeMismatchError
from orbiflow.symmetry import (
    CrystallographicGroup,
    Isometry,
    group_by_name,
    group_from_operators,
    is_group_name,
    operators,
    space_group,
    translation,
    wallpaper_group,
)
from orbiflow.symmetry.group import generated
from orbiflow.symmetry.triplets import parse_operator
from refusals import refused
from strategies import groups, random_orthogonal, seeds

TABLE = list(gemmi.spacegroup_table())
USUAL = 530  # so many of them, the first, are in International Tables


@settings(max_examples=8)
@given(st.sampled_from(TABLE[:USUAL]))
def test_every_setting_in_the_ways_to_write_it(row) -> None:
    names = {row.xhm(), row.xhm().replace(" ", ""), f"Hall: {row.hall}"}
    assert {space_group(name).name for name in names} == {row.xhm()}
    for short in (row.short_name(), row.hm, row.hm[:2] + row.hm[2:].replace(" ", "")):
        assert gemmi.find_spacegroup_by_name(space_group(short, origin=1).name).number == row.number
    screws = re.sub(r"\b([2346])([1-5])\b", r"\1_\2", row.xhm())
    assert space_group(screws).name == row.xhm()


@settings(max_examples=4)
@given(st.integers(1, 230))
def test_numbers(number: int) -> None:
    row = gemmi.find_spacegroup_by_number(number)
    if row.ext in ("1", "2"):
        with refused(f"'{number}:1'", f"'{number}:2'", kind=GroupError):
            space_group(number)
        return
    assert space_group(number).name == space_group(str(number)).name == row.xhm()


KNOWN = {
    **{"P2_1": "P 1 21 1", "P 2_1/c": "P 1 21/c 1", "P21/n": "P 1 21/n 1", "C2/c": "C 1 2/c 1"},
    **{"R-3:H": "R -3:H", "R3:R": "R 3:R", "Fd-3m:2": "F d -3 m:2", "227:1": "F d -3 m:1"},
    **{"Fm3m": "F m -3 m", "Cmce": "C m c a", "P3_221": "P 32 2 1", "P321": "P 3 2 1"},
    **{"166:R": "R -3 m:R", "Hall: P 2c -2ac": "P c a 21", "Hall: -F 4vw 2vw 3": "F d -3 m:2"},
    "Hall: P 2": "P 1 1 2",
}


@pytest.mark.parametrize(("name", "setting"), KNOWN.items())
def test_names_that_people_write(name: str, setting: str) -> None:
    assert space_group(name).name == setting


@pytest.mark.parametrize(
    "name",
    [
        *("P 2 1", "P 32 1", "P 31 2", "P 3_2 1", "P3_21", "P 2_1 2_1 2 1", "P_3_21", "P_2_1/c"),
        *("P2(1)/c", "$P2_{1}/c$", "P2_7", "P2/_c", "P21/c/c", "P 21c", "P2_1/", "/P21", "P", "_"),
        *("Pnma:2", "Fd-3m:3", "R-3:1", "P-3:H", "H 3:R", "X 1", "-P 4", "-P 2ybc", "P 2c"),
        *("Hall: P2_1", "Hall: Q 2", "Hall", "14:3", "225:2", "300", "#0", "0:1", "00", "P\0 1"),
        *(0, 231, -1, 1.5, True, None, "", "Hall:", "9" * 99, "x" * 999, "\u00e9"),
    ],
)
def test_names_of_none_are_refused(name: object) -> None:
    with refused("space group", "P 21 21 21" if "Hall" not in str(name) else "", kind=GroupError):
        space_group(name)  # pyright: ignore[reportArgumentType]


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


ORIGINS = (
    """48 50 59 68 70 85 86 88 125 126 129 130 133 134 137 138 141 142 201 203 222 224 227 228"""
)


def test_only_those_names_are_asked_for_their_origin() -> None:
    rows = map(gemmi.find_spacegroup_by_number, range(1, 231))
    assert [str(row.number) for row in rows if row.ext in ("1", "2")] == ORIGINS.split()
    assert space_group("R -3 m", origin=2) == space_group("R -3 m")


@pytest.mark.parametrize("number", [int(number) for number in ORIGINS.split()[::3]])
def test_the_error_has_the_words_that_answer_it(number: int) -> None:
    symbol = gemmi.find_spacegroup_by_number(number).hm
    for name in (number, symbol.replace(" ", "")):
        with pytest.raises(GroupError) as caught:
            space_group(name)
        words = re.findall("'(.*?)'", str(caught.value))[-2:]
        first, second = map(space_group, words)
        assert (first.name, second.name) == (f"{symbol}:1", f"{symbol}:2")
        assert all(map(is_group_name, words))
    centre = Isometry(-np.eye(3), np.zeros(3))
    assert second.contains(centre)
    assert not first.contains(centre)
    assert space_group(number, origin=1) == first
    assert group_by_name(f"{number}:2") == second


def test_a_density_is_asked_too() -> None:
    with refused("227:1", "227:2", kind=GroupError):
        QuotientSpace("227")
    assert QuotientSpace("227:1") != QuotientSpace("227:2")


def test_there_is_no_third_origin() -> None:
    with refused("origin", 3):
        space_group(227, origin=3)  # pyright: ignore[reportArgumentType]
