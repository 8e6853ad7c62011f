"""Space groups by name, on the cells that they fit."""

import sys

import gemmi
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import strategies as own
from orbiflow.errors import (
    GroupError,
    InputFileError,
    LatticeMismatchError,
    RoundedOperatorsWarning,
    SettingError,
)
from orbiflow.symmetry import (
    cell_lattice,
    cell_parameters,
    cif_text,
    group_from_cif,
    group_from_operators,
    operators,
    space_group,
    translation,
)
from orbiflow.symmetry.group import generated
from refusals import refused, warned

SETTINGS = {row.xhm(): row for row in gemmi.spacegroup_table()}


@settings(max_examples=4)
@given(st.sampled_from(sorted(SETTINGS)))
def test_every_setting_is_the_group_of_the_tables_on_its_primitive_lattice(name):
    group, listed = space_group(name), SETTINGS[name].operations()
    assert group.name == name
    assert group.order == len(listed.sym_ops)
    assert len(np.unique(np.round(group.linear_parts, 6), axis=0)) == group.order


@settings(max_examples=4)
@given(st.sampled_from(sorted(SETTINGS)))
def test_the_cure_of_a_wrong_cell_is_one(name):
    # without symmetry, so that only triclinic groups fit
    cell = (2.0, 3.0, 4.0, 70.0, 80.0, 100.0)
    try:
        group = space_group(name, cell)
        assert SETTINGS[name].number <= 2
    except LatticeMismatchError as error:
        cure = str(error).split("fits has [")[1].strip("]").split(", ")
        group = space_group(name, [float(text) for text in cure])
    assert group.order == len(SETTINGS[name].operations().sym_ops)


@pytest.mark.parametrize(
    "cell", [1, "abc", (1, 2), (1, 1, 1, 90, 90), np.eye(2), (1, 2, np.nan), (0, 1, 1), (1, -1, 1)]
)
def test_cells_that_are_none_are_refused(cell):
    with refused("cell", kind=SettingError):
        space_group(1, cell)


@pytest.mark.parametrize("cell", [(1, 1, 1, 10, 20, 90), (1, 1, 1, 90, 90, 180), np.zeros((3, 3))])
def test_cells_without_volume_are_refused(cell):
    with pytest.raises(GroupError):
        space_group(1, cell)


def test_without_gemmi_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "gemmi", None)
    with refused("orbiflow[crystals]"):
        space_group(1)


CORE = """data_quartz
_cell_length_a 4.9134(2)
_cell_length_b 4.9134(2)
_cell_length_c 5.4052(1)
_cell_angle_alpha 90
_cell_angle_beta 90
_cell_angle_gamma 120
"""
OPERATORS = "loop_\n_space_group_symop_operation_xyz\n" + "\n".join(
    f"'{op.triplet()}'" for op in SETTINGS["P 32 2 1"].operations()
)


@pytest.mark.parametrize(
    "symmetry",
    [
        OPERATORS,
        "loop_\n_symmetry_equiv_pos_site_id\n_symmetry_equiv_pos_as_xyz\n1 x,y,z\n2 -y,x-y,z+2/3\n"
        "3 y,x,-z",
        "_space_group_name_Hall 'P 32 2\"'",
        "_symmetry_space_group_name_H-M 'P 32 2 1'",
        "_symmetry_space_group_name_H-M ?\n_space_group_name_H-M_alt '.'\n_space_group_IT_number 154",
        f"{OPERATORS}\n_space_group_IT_number 154\n_symmetry_space_group_name_H-M P3_221",
    ],
)
def test_cifs_with_operators_symbols_or_numbers(tmp_path, symmetry):
    path = tmp_path / "quartz.cif"
    path.write_text(f"data_first\n_audit_author_name me\n{CORE}{symmetry}\n", "utf-8")
    assert group_from_cif(path) == space_group(154, (4.9134, 4.9134, 5.4052, 90, 90, 120))
    volume = group_from_cif(path, (1, 1, 3, 90, 90, 120)).cell_volume
    assert volume == pytest.approx(2.598, abs=1e-3)


@settings(max_examples=5)
@given(name=st.sampled_from(sorted(SETTINGS)))
def test_a_group_is_read_from_its_own_cif(tmp_path_factory, name):
    group = space_group(name)
    path = tmp_path_factory.mktemp("cif") / "group.cif"
    path.write_text(cif_text(group), "utf-8")
    assert group_from_cif(path) == group_from_operators(
        operators(group), cell_lattice(cell_parameters(group.lattice))
    )
    assert gemmi.cif.read(str(path))[0].name == "group"


def test_a_cif_in_the_conventional_cell_names_the_group_to_other_programs():
    group = space_group("F d -3 m:2", (3, 3, 3))
    block = gemmi.cif.read_string(cif_text(group, 3 * np.eye(3)))[0]
    structure = gemmi.make_small_structure_from_block(block)
    assert structure.spacegroup.xhm() == "F d -3 m:2"
    assert structure.cell.a == 3


@pytest.mark.parametrize(
    ("text", "about"),
    [
        ("", "neither operators nor a symbol"),
        ("rubbish", "expected block header"),
        (CORE, "neither operators nor a symbol"),
        ("data_a\n_symmetry_space_group_name_H-M 'P 1'", "its cell is not complete"),
        (CORE + "_space_group_name_H-M_alt 'P 5'", "'P 5'"),
        (CORE + "_space_group_name_H-M_alt 'P 4'", "fits has [4.9134, 4.9134, 5.4052, 90.0"),
        (CORE + "loop_\n_space_group_symop_operation_xyz\nx,y,z\nx,y", "'x,y' is no operator"),
        (CORE + "loop_\n_space_group_symop_operation_xyz\nx+z,y,z\n", "they fit no cell"),
        (CORE.replace("4.9134(2)", "-4") + "_space_group_IT_number 1", "lengths above 0"),
        (CORE.replace("120", "180") + "_space_group_IT_number 1", "it would be flat"),
        (CORE + "_space_group_IT_number 1\0", "string"),
        (CORE + "_space_group_name_H-M_alt 'P 32 2 1'\n_space_group_IT_number 152", "154|152"),
        (CORE + f"_symmetry_space_group_name_H-M 'P3_121'\n{OPERATORS}", "152|154"),
        (CORE + "_space_group_name_Hall 'P 3'\n_symmetry_space_group_name_H-M P31", "143|144"),
        (CORE + f"_symmetry_Int_Tables_number 14\n{OPERATORS}", "14)|154"),
        (CORE + "_space_group_name_H-M_alt 'P 21/q'\n_space_group_IT_number 14", "'P 21/q'"),
        (CORE + "_space_group_name_H-M_alt 'P 2'\n_space_group_IT_number 999", "999"),
    ],
)
def test_files_that_are_no_cifs_of_a_group_are_refused(tmp_path, text, about):
    path = tmp_path / "bad.cif"
    path.write_text(text, "utf-8")
    with refused(path, *about.split("|"), kind=InputFileError):
        group_from_cif(path)


ROUNDED = [("0.3333", "0.6667"), ("0.33", "0.67"), ("0.333333", "0.666666"), ("0.333", "0.667")]


@pytest.mark.parametrize(("third", "two"), ROUNDED)
def test_rounded_operators_are_read_as_fractions_and_said(tmp_path, third, two):
    listed = OPERATORS.replace("1/3", third).replace("2/3", two)
    path = tmp_path / "rounded.cif"
    path.write_text(f"{CORE}{listed}\n", "utf-8")
    with warned(third, "1/3", two, "2/3", kind=RoundedOperatorsWarning):
        group = group_from_cif(path)
    assert group == space_group(154, (4.9134, 4.9134, 5.4052, 90, 90, 120))


SHIFTS = {
    **{"0.1667": "1/6", "0.833": "5/6", "0.0833": "1/12", "0.041667": "1/24", "0.16": "1/6"},
    **{".66": "2/3", "0.33300": "1/3", "0.3334": "1/3", "0.49999": "1/2"},
}


@pytest.mark.parametrize(("shift", "exact"), SHIFTS.items())
def test_other_rounded_shifts(shift, exact):
    with pytest.warns(RoundedOperatorsWarning):
        group = group_from_operators([f"-x,y+1/2,-z+{shift}"], np.eye(3))
    assert group == group_from_operators([f"-x,y+1/2,-z+{exact}"], np.eye(3))


def test_exact_decimals_are_left_as_they_are():
    for shift in ("0.25", "0.5", "0.125", "0.3", "0.3333333333333333", "0.70710678"):
        assert operators(group_from_operators([f"-x+{shift},-y"], np.eye(2)))


MONOCLINIC = CORE.replace("120", "90").replace("beta 90", "beta 100")
FOUR = "x,y,z;-x,y+1/2,-z+1/2;-x,-y,-z;x,-y+1/2,z+1/2"


def cif(cell: str, listed: str = "", **symbols: object) -> str:
    tags = {"hall": "_space_group_name_Hall", "hm": "_symmetry_space_group_name_H-M"}
    tags |= {"alt": "_space_group_name_H-M_alt", "number": "_space_group_IT_number"}
    lines = [f"{tags[key]} '{value}'" for key, value in symbols.items()]
    loop = ["loop_", "_space_group_symop_operation_xyz", *listed.split(";")] if listed else []
    return "\n".join([cell.strip(), *lines, *loop]) + "\n"


CONTRADICTIONS = [
    # an inversion lost; half of C 2/c; one sign, half or third mistyped; rounded beyond reading
    (MONOCLINIC, "x,y,z;-x,y+1/2,-z+1/2", {"number": 14}),
    (MONOCLINIC, "x,y,z;-x,y,-z+1/2;x+1/2,y+1/2,z", {"number": 15}),
    (MONOCLINIC, "x,y,z;-x+0.4,y+1/2,-z", {"hm": "P 1 2 1"}),
    (MONOCLINIC, FOUR.replace("-y+1/2,z+1/2", "-y+1/2,z"), {"number": 14}),
    (MONOCLINIC, FOUR.replace("-z+1/2", "-z+1/3"), {"hm": "P 21/c"}),
    (MONOCLINIC, "x,y,z;-x,y+.49,-z", {"number": 4}),
    (CORE, "x,y,z;-y,x-y,z+0.3;-x+y,-x,z+0.7", {"hm": "P 31"}),
    # settings of one type that differ
    (MONOCLINIC, "", {"hall": "-P 2ybc", "hm": "P 21/n"}),
    (MONOCLINIC, FOUR, {"hm": "P 21/n"}),
    (CORE.replace("120", "90"), "", {"alt": "P n m a", "hm": "P b n m"}),
]


@pytest.mark.parametrize(("cell", "listed", "symbols"), CONTRADICTIONS)
def test_cifs_that_contradict_themselves_are_refused(tmp_path, cell, listed, symbols):
    path = tmp_path / "bad.cif"
    path.write_text(cif(cell, listed, **symbols).replace("IT_number '14'", "IT_number 14"), "utf-8")
    with refused("bad.cif", "contradicts itself", kind=InputFileError):
        group_from_cif(path)


@settings(max_examples=5)
@given(st.sampled_from(sorted(SETTINGS)), own.seeds)
def test_groups_in_settings_of_no_table_agree_with_their_numbers(tmp_path_factory, name, seed):
    group, rng = space_group(name), np.random.default_rng(seed)
    shift = translation(group.lattice @ rng.integers(0, 7, 3) / 7)
    moved = generated(group.lattice, [shift @ own @ shift.inverse() for own in group.cosets])
    path = tmp_path_factory.mktemp("cif") / "group.cif"
    path.write_text(cif_text(moved) + f"_space_group_IT_number {SETTINGS[name].number}\n")
    assert group_from_cif(path).order == group.order


def test_a_cif_without_operators_says_its_origin(tmp_path):
    cell = CORE.replace("5.4052(1)", "4.9134").replace("120", "90")
    path = tmp_path / "a.cif"
    path.write_text(cif(cell, alt="F d -3 m") + "_space_group_IT_number 227\n")
    with refused("origin", kind=InputFileError):
        group_from_cif(path)
    path.write_text(cif(cell, alt="F d -3 m", hall="-F 4vw 2vw 3") + "_space_group_IT_number 227\n")
    assert group_from_cif(path).name == "F d -3 m:2"


def test_rhombohedral_axes_are_named_after_what_was_read(tmp_path):
    path = tmp_path / "group.cif"
    cell = CORE.replace("5.4052(1)", "4.9134").replace("90", "55").replace("120", "55")
    path.write_text(cif(cell, hm="R -3 m") + "_space_group_IT_number 166\n")
    assert group_from_cif(path).name == "R -3 m:R"


def test_files_that_are_none_or_too_large_are_refused(tmp_path, monkeypatch):
    with refused("none.cif", kind=InputFileError):
        group_from_cif(tmp_path / "none.cif")
    monkeypatch.setattr("orbiflow.symmetry.space_groups.MAX_CIF_BYTES", 10)
    (tmp_path / "large.cif").write_text(CORE)
    with refused("large.cif", "10 bytes", kind=InputFileError):
        group_from_cif(tmp_path / "large.cif")
    with refused(3, 2, kind=GroupError):
        cif_text(own.identification_group("torus"))
