"""The space groups with two origins, typed from the International Tables: a name says which one."""

import re
from pathlib import Path

import gemmi
import numpy as np
import pytest

from orbiflow.density import QuotientSpace
from orbiflow.errors import GroupError, InputFileError
from orbiflow.symmetry import Isometry, group_by_name, group_from_cif, is_group_name, space_group
from orbiflow.symmetry.group_symbols import has_two_origins, settings_named, settings_numbered
from refusals import refused

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
