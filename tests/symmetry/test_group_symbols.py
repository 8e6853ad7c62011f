"""Space groups by name, by operators as text, and with two origins."""

import re
from pathlib import Path

import gemmi
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from orbiflow.density import QuotientSpace
from orbiflow.errors import GroupError, InputFileError, LatticeMismatchError
from orbiflow.symmetry import (
    CrystallographicGroup,
    Isometry,
    group_by_name,
    group_from_cif,
    group_from_operators,
    is_group_name,
    operators,
    space_group,
    translation,
    wallpaper_group,
)
from orbiflow.symmetry.group import generated
from orbiflow.symmetry.group_symbols import (
    USUAL,
    find_hall,
    find_setting,
    has_two_origins,
    plain,
    settings_named,
    settings_numbered,
)
from orbiflow.symmetry.triplets import parse_operator
from refusals import refused
from strategies import groups, random_orthogonal, seeds

TABLE = list(gemmi.spacegroup_table())
SCREW = re.compile(r"\b([2346])([1-5])\b")
BAR = re.compile(r"-(\d)")

TYPESETTING = {
    "plain": lambda symbol: symbol,
    "underscores": lambda symbol: SCREW.sub(r"\1_\2", symbol),
    "brackets": lambda symbol: SCREW.sub(r"\1(\2)", symbol),
    "square brackets": lambda symbol: SCREW.sub(r"\1[\2]", symbol),
    "LaTeX": lambda s: "$" + BAR.sub(r"\\bar{\1}", SCREW.sub(r"\1_{\2}", s)) + "$",
    "LaTeX in short": lambda symbol: BAR.sub(r"\\overline{\1}", SCREW.sub(r"\1_\2", symbol)),
    "HTML": lambda symbol: "<i>" + SCREW.sub(r"\1<sub>\2</sub>", symbol) + "</i>",
    "HTML bars": lambda symbol: BAR.sub(
        r'<span style="text-decoration:overline">\1</span>', symbol
    ),
    "subscripts": lambda s: SCREW.sub(lambda m: m[1] + chr(0x2080 + int(m[2])), s),
    "bars above": lambda symbol: BAR.sub("\\1\u0305", symbol),
    "bars before": lambda symbol: BAR.sub("\u00af\\1", symbol),
    "minus": lambda symbol: symbol.replace("-", "\u2212"),
}
BLANKS = {
    "all": lambda symbol: symbol,
    "none": lambda symbol: symbol.replace(" ", ""),
    "after the lattice": lambda symbol: symbol[:2] + symbol[2:].replace(" ", ""),
    "many": lambda symbol: f"  {symbol.replace(' ', '   ')} ",
}


@pytest.mark.parametrize(
    ("typesetting", "blanks"),
    [*((way, "none") for way in TYPESETTING), *(("plain", blanks) for blanks in BLANKS)],
)
def test_every_setting_in_every_way_to_write_it(typesetting: str, blanks: str) -> None:
    for row in TABLE[:USUAL]:
        extension = row.ext.strip("\0")
        name = BLANKS[blanks](TYPESETTING[typesetting](row.hm))
        for colon in (":", " :", " : ") if extension else (":",):
            found = find_setting(gemmi, name + (colon + extension if extension else ""))
            assert found is not None, name
            assert found.xhm() == row.xhm(), name
        if extension:  # without it, it is at least of the same number
            found = find_setting(gemmi, name)
            assert found is not None, name
            assert found.number == row.number, name


@pytest.mark.parametrize("change", [str.lower, str.upper, str.swapcase])
def test_large_and_small_letters(change) -> None:
    for row in TABLE[:USUAL]:
        short = find_setting(gemmi, row.short_name())
        assert short is not None
        assert short.number == row.number
        found = find_setting(gemmi, change(row.xhm().replace(" ", "")))
        assert found is not None
        assert found.xhm() == row.xhm()


FULL = (
    """
P 2/m 2/m 2/m; P 2/n 2/n 2/n; P 2/c 2/c 2/m; P 2/b 2/a 2/n; P 21/m 2/m 2/a; P 2/n 21/n 2/a
P 2/m 2/n 21/a; P 21/c 2/c 2/a; P 21/b 21/a 2/m; P 21/c 21/c 2/n; P 2/b 21/c 21/m; P 21/n 21/n 2/m
P 21/m 21/m 2/n; P 21/b 2/c 21/n; P 21/b 21/c 21/a; P 21/n 21/m 21/a; C 2/m 2/c 21/m; C 2/m 2/c 21/a
C 2/m 2/m 2/m; C 2/c 2/c 2/m; C 2/m 2/m 2/a; C 2/c 2/c 2/a; F 2/m 2/m 2/m; F 2/d 2/d 2/d
I 2/m 2/m 2/m; I 2/b 2/a 2/m; I 21/b 21/c 21/a; I 21/m 21/m 21/a; P 4/m 2/m 2/m; P 4/m 2/c 2/c
P 4/n 2/b 2/m; P 4/n 2/n 2/c; P 4/m 21/b 2/m; P 4/m 21/n 2/c; P 4/n 21/m 2/m; P 4/n 21/c 2/c
P 42/m 2/m 2/c; P 42/m 2/c 2/m; P 42/n 2/b 2/c; P 42/n 2/n 2/m; P 42/m 21/b 2/c; P 42/m 21/n 2/m
P 42/n 21/m 2/c; P 42/n 21/c 2/m; I 4/m 2/m 2/m; I 4/m 2/c 2/m; I 41/a 2/m 2/d; I 41/a 2/c 2/d
P -3 1 2/m; P -3 1 2/c; P -3 2/m 1; P -3 2/c 1; R -3 2/m; R -3 2/c; P 6/m 2/m 2/m; P 6/m 2/c 2/c
P 63/m 2/c 2/m; P 63/m 2/m 2/c; P 2/m -3; P 2/n -3; F 2/m -3; F 2/d -3; I 2/m -3; P 21/a -3
I 21/a -3; P 4/m -3 2/m; P 4/n -3 2/n; P 42/m -3 2/n; P 42/n -3 2/m; F 4/m -3 2/m; F 4/m -3 2/c
F 41/d -3 2/m; F 41/d -3 2/c; I 4/m -3 2/m; I 41/a -3 2/d
""".replace("\n", ";")
    .strip(";")
    .split(";")
)
"""The full symbols in International Tables A that are none of the short ones, by their numbers."""

ABBREVIATED = [*range(47, 75), *range(123, 143), *range(162, 168), *range(191, 195)]
ABBREVIATED += [*range(200, 207), *range(221, 231)]


@pytest.mark.parametrize("typesetting", TYPESETTING)
def test_every_full_symbol_is_of_its_number(typesetting: str) -> None:
    for number, symbol in zip(ABBREVIATED, FULL, strict=True):
        for blanks in BLANKS.values():
            found = find_setting(gemmi, blanks(TYPESETTING[typesetting](symbol.strip())))
            assert found is not None, symbol
            assert found.number == number, symbol


@settings(max_examples=4)
@given(st.integers(1, 230))
def test_numbers(number: int) -> None:
    row = gemmi.find_spacegroup_by_number(number)
    if row.ext in ("1", "2"):
        with refused(f"'{number}:1'", f"'{number}:2'", kind=GroupError):
            space_group(number)
        return
    assert space_group(number).name == space_group(f"0{number}").name == row.xhm()


KNOWN = {
    **{"P2_1": "P 1 21 1", "P 2_1/c": "P 1 21/c 1", "P2(1)/c": "P 1 21/c 1"},
    **{"p2_{1}/c": "P 1 21/c 1", "P21/n": "P 1 21/n 1", "P 21/b": "P 1 1 21/b"},
    **{"I4(1)/amd:2": "I 41/a m d:2", "P6(3)/mmc": "P 63/m m c", "R-3:H": "R -3:H"},
    **{"R3:R": "R 3:R", "R-3mH": "R -3 m:H", "R -3 m R": "R -3 m:R", "H 3 2": "R 3 2:H"},
    **{"Fd-3m:2": "F d -3 m:2", "F d -3 m Z": "F d -3 m:2", "F d -3 m S": "F d -3 m:1"},
    **{"Fm3m": "F m -3 m", "Pa3": "P a -3", "Cmce": "C m c a", "Aem2": "A b m 2"},
    **{"P3_221": "P 32 2 1", "P 3221": "P 32 2 1", "P321": "P 3 2 1", "C2/c:b1": "C 1 2/c 1"},
    **{"I2_1": "I 1 21 1", "B2_1": "B 1 21 1", "B 2": "B 1 1 2", "P_21/c": "P 1 21/c 1"},
    **{"P_1_21/c_1": "P 1 21/c 1", "P_21": "P 1 21 1", "P_n_m_a": "P n m a"},
    **{"I_41/a_m_d:2": "I 41/a m d:2", "P 2_1/n 2_1/m 2_1/a": "P n m a"},
    **{"P2_1/n2_1/m2_1/a": "P n m a", "P21/m21/n21/b": "P m n b", "C 2/m 2/c 2_1/e": "C m c a"},
    **{"P_2/m_2/m_2/m": "P m m m", r"$F\,4_1/d\,\bar{3}\,2/m$:2": "F d -3 m:2"},
    **{"F 41/d -3 2/m :2": "F d -3 m:2", "R -3 2/c:R": "R -3 c:R", "227:2": "F d -3 m:2"},
    **{"227:1": "F d -3 m:1", "62:cab": "P b n m", "14:b1": "P 1 21/c 1", "166:R": "R -3 m:R"},
    **{"No. 225": "F m -3 m", "#225": "F m -3 m", "P 4 / m m m": "P 4/m m m"},
    **{"I41/amdZ": "I 41/a m d:2", "P4/nmmS": "P 4/n m m:1", "Pbar1": "P -1"},
    **{"Fdbar3m:1": "F d -3 m:1", "Pm3barm": "P m -3 m", "F 4d 2 3 -1d": "F d -3 m:1"},
    **{"P 2c -2ac": "P c a 21", "-P 2ac 2ab": "P b c a", "-P 6c 2c": "P 63/m m c"},
    "-F 4vw 2vw 3": "F d -3 m:2",
}


@pytest.mark.parametrize(("name", "setting"), KNOWN.items())
def test_names_that_people_write(name: str, setting: str) -> None:
    assert space_group(name).name == setting


@pytest.mark.parametrize(
    "name",
    [
        "C2_1",  # C 1 21 1 is number 5, C 1 1 21 number 4
        *(
            *("P 2 1", "P 32 1", "P 3_2 1", "P3_21", "P 2_1 2_1 2 1", "P_3_21", "P_2_1/c"),
            "P 2/n 2/m 2/a",  # an axis that is none of P n m a
            *("P 21/n m a", "P 42/m 2/m 2/m", "P 3/m 2/m 2/m", "P 2/m -3 2/m", "P2_7", "P2/_c"),
            "P21/c/c",
        ),
        *("P21_/c", "P 21c", "P21-c", "P2_1/", "/P21", "P", "P-", "_", ":", "P:1", "P 21:1"),
        *(
            *("Pnma:2", "Fd-3m:3", "R-3:1", "P-3:H", "H 3:R", "H m", "X 1", "P 2 2", "P 1 1"),
            *("P 2c", "P 4n"),
        ),
        *(
            *("-P 4", "-I 4", "Hall: P2_1", "Hall: P 21/c", "Hall: Q 2", "Hall", "hall: x"),
            "P 2 ybc zz",
        ),
        *("14:3", "225:2", "300", "#0", "0:1", "P 31 2", "I 4 2 3", "-R 3"),
        *("14 15", "231", "P 21/c 14", "Fd-3m (origin 3)", "<sub>", "$$", "\\bar", "P\u0305"),
    ],
)
def test_names_of_none_are_refused(name: str) -> None:
    with refused("space group", kind=GroupError):
        space_group(name)


@st.composite
def mistyped(draw: st.DrawFn) -> str:
    row = draw(st.sampled_from(TABLE))
    ways = [row.xhm(), row.short_name(), *(way(row.hm) for way in TYPESETTING.values())]
    name = draw(st.sampled_from(ways))
    at = draw(st.integers(0, len(name) - 1))
    letter = draw(st.sampled_from(["", *"PABCFIRHabcdemnxyz-/_ 123456:()'"]))
    return name[:at] + letter + name[at + draw(st.integers(0, 1)) :]


@given(mistyped())
def test_a_mistyped_name_is_another_only_if_it_reads_so(name: str) -> None:
    found = find_setting(gemmi, name)
    if found is None:
        return
    known = gemmi.find_spacegroup_by_name(plain(name).partition(":")[0].replace("_", ""))
    assert known is None or known.number == found.number
    assert not re.search(r"[xyz('\"]", plain(name).partition(":")[0].rstrip(" zZ"))


@given(st.text(alphabet="PABCIRHFabcdemnxyz-/_ 123456:()'\"*=", max_size=14))
def test_random_text_is_no_hall_symbol_unless_it_is_said(text: str) -> None:
    found = find_hall(gemmi, text)
    if found is not None:
        assert " ".join(text.split()) in {row.hall for row in TABLE}


def test_the_symbols_of_hall() -> None:
    for row in TABLE:
        found = find_hall(gemmi, f"Hall: {row.hall}")
        assert found is not None
        assert gemmi.find_spacegroup_by_ops(gemmi.GroupOps(found)).number == row.number
    assert space_group("hall: P 2").name == "P 1 1 2"
    assert space_group("HALL:P 2 (0 0 1)").order == 2


def test_no_symbol_of_hall_is_taken_for_another_group() -> None:
    for row in gemmi.spacegroup_table():
        found = find_hall(gemmi, row.hall)
        if found is not None:
            assert gemmi.GroupOps(found) == row.operations(), row.hall


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


# number: short symbol, and where origin 2 lies from origin 1, in the conventional cell
ORIGINS = {
    **{48: ("P n n n", (1 / 4, 1 / 4, 1 / 4)), 50: ("P b a n", (1 / 4, 1 / 4, 0))},
    **{59: ("P m m n", (1 / 4, 1 / 4, 0)), 68: ("C c c a", (0, 1 / 4, 1 / 4))},
    **{70: ("F d d d", (1 / 8, 1 / 8, 1 / 8)), 85: ("P 4/n", (-1 / 4, 1 / 4, 0))},
    **{86: ("P 42/n", (1 / 4, 1 / 4, 1 / 4)), 88: ("I 41/a", (0, 1 / 4, 1 / 8))},
    **{125: ("P 4/n b m", (1 / 4, 1 / 4, 0)), 126: ("P 4/n n c", (1 / 4, 1 / 4, 1 / 4))},
    **{129: ("P 4/n m m", (-1 / 4, 1 / 4, 0)), 130: ("P 4/n c c", (-1 / 4, 1 / 4, 0))},
    133: ("P 42/n b c", (-1 / 4, 1 / 4, -1 / 4)),
    134: ("P 42/n n m", (-1 / 4, 1 / 4, -1 / 4)),
    137: ("P 42/n m c", (-1 / 4, 1 / 4, -1 / 4)),
    **{138: ("P 42/n c m", (-1 / 4, 1 / 4, -1 / 4)), 141: ("I 41/a m d", (0, -1 / 4, 1 / 8))},
    **{142: ("I 41/a c d", (0, -1 / 4, 1 / 8)), 201: ("P n -3", (1 / 4, 1 / 4, 1 / 4))},
    **{203: ("F d -3", (1 / 8, 1 / 8, 1 / 8)), 222: ("P n -3 n", (1 / 4, 1 / 4, 1 / 4))},
    **{224: ("P n -3 m", (1 / 4, 1 / 4, 1 / 4)), 227: ("F d -3 m", (1 / 8, 1 / 8, 1 / 8))},
    228: ("F d -3 c", (3 / 8, 3 / 8, 3 / 8)),
}


def test_only_those_names_are_asked_for_their_origin() -> None:
    for number in range(1, 231):
        assert has_two_origins(settings_numbered(gemmi, str(number))) == (number in ORIGINS)
    # in other cells than the usual one, too
    for row in gemmi.spacegroup_table():
        is_one_of_two = row.ext in ("1", "2")
        assert has_two_origins(settings_named(gemmi, row.hm)) == is_one_of_two
        assert not is_one_of_two or row.number in ORIGINS
    assert space_group("P n c b", origin=2).name == "P n c b:2"
    assert space_group("R -3 m", origin=2) == space_group("R -3 m")


@pytest.mark.parametrize("number", ORIGINS)
def test_the_error_has_the_words_that_answer_it(number: int) -> None:
    symbol, shift = ORIGINS[number]
    cell = (1.0, 1.1, 1.3) if number < 75 else (1.0, 1.0, 1.3) if number < 195 else (1.0, 1.0, 1.0)
    for name in (number, symbol.replace(" ", "")):
        with pytest.raises(GroupError) as caught:
            space_group(name)
        first, second = (
            space_group(word, cell) for word in re.findall("'(.*?)'", str(caught.value))[-2:]
        )
        assert (first.name, second.name) == (f"{symbol}:1", f"{symbol}:2")
    centre = Isometry(-np.eye(3), np.zeros(3))
    assert second.contains(centre)
    assert not first.contains(centre)
    assert first.conjugate(np.eye(3), -np.diag(cell) @ shift) == second
    assert space_group(number, cell, origin=1) == first
    assert group_by_name(f"{number}:2", cell) == second
    assert is_group_name(f"{number}:2")


def test_a_density_is_asked_too() -> None:
    with refused("227:1", "227:2", kind=GroupError):
        QuotientSpace("227")
    with refused("Fd-3m:1", "Fd-3m:2", kind=GroupError):
        QuotientSpace("Fd-3m", cell=(3, 3, 3))
    assert QuotientSpace("227:1") != QuotientSpace("227:2")


def test_a_cif_without_operators_says_its_origin(tmp_path: Path) -> None:
    path, cell = (
        tmp_path / "a.cif",
        "data_a\n_cell_length_a 3\n_cell_length_b 3\n_cell_length_c 3\n",
    )
    cell += "_cell_angle_alpha 90\n_cell_angle_beta 90\n_cell_angle_gamma 90\n"
    bare = "_space_group_IT_number 227\n_space_group_name_H-M_alt 'F d -3 m'\n"
    path.write_text(cell + bare)
    with refused("origin", kind=InputFileError):
        group_from_cif(path)
    for more in (
        "_space_group_name_H-M_full 'F 41/d -3 2/m :2'",
        "_space_group_name_Hall '-F 4vw 2vw 3'",
    ):
        path.write_text(cell + bare + more + "\n")
        assert group_from_cif(path) == space_group("227:2", (3, 3, 3))


def test_there_is_no_third_origin() -> None:
    for name in (227, 19):
        with refused("origin", 3):
            space_group(name, origin=3)  # pyright: ignore[reportArgumentType]
