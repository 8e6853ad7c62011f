"""Names of space groups in every way that people write them: the right group, or none."""

import re

import gemmi
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.errors import GroupError
from orbiflow.symmetry import space_group
from orbiflow.symmetry.group_symbols import USUAL, find_hall, find_setting, plain
from refusals import refused

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
