"""The tables of wallpaper groups and identification spaces."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.errors import GroupError
from orbiflow.symmetry import (
    IDENTIFICATION_SPACES,
    LATTICES,
    WALLPAPER_GROUPS,
    Line,
    group_by_name,
    identification_group,
    rotation,
    transflection,
    wallpaper_group,
)
from refusals import refused
from strategies import lattices

# counted by hand from the diagrams of the International Tables: largest rotation, then whether the
# point group holds a reflection, and whether some mirror line exists (pg and pgg only glide)
POINT_GROUPS = {
    "p1": (1, False, False),
    "p2": (2, False, False),
    "pm": (1, True, True),
    "pg": (1, True, False),
    "cm": (1, True, True),
    "pmm": (2, True, True),
    "pmg": (2, True, True),
    "pgg": (2, True, False),
    "cmm": (2, True, True),
    "p4": (4, False, False),
    "p4m": (4, True, True),
    "p4g": (4, True, True),
    "p3": (3, False, False),
    "p3m1": (3, True, True),
    "p31m": (3, True, True),
    "p6": (6, False, False),
    "p6m": (6, True, True),
}


def mirror_exists(group):
    """Whether some element reverses orientation and has no glide component modulo the lattice."""
    for g in group.elements_near(group.lattice.sum(axis=1) / 2, 3 * np.abs(group.lattice).sum()):
        if g.determinant == -1 and np.allclose((g @ g).translation, 0, atol=1e-9):
            return True
    return False


def test_there_are_seventeen():
    assert set(POINT_GROUPS) == set(WALLPAPER_GROUPS)
    assert len(WALLPAPER_GROUPS) == 17


@pytest.mark.parametrize("name", WALLPAPER_GROUPS)
def test_order_is_that_of_the_point_group(name):
    largest, reflects, _ = POINT_GROUPS[name]
    assert WALLPAPER_GROUPS[name].order == largest * (2 if reflects else 1)


@given(st.data(), st.sampled_from(sorted(WALLPAPER_GROUPS)))
def test_order_is_that_of_the_table_on_any_lattice(data, name):
    row = WALLPAPER_GROUPS[name]
    group = wallpaper_group(name, data.draw(lattices(row.system)))
    assert group.order == row.order
    assert group.name == name


@pytest.mark.parametrize("name", WALLPAPER_GROUPS)
def test_rotations_and_mirrors_are_those_of_the_diagrams(name):
    largest, reflects, mirrors = POINT_GROUPS[name]
    group = wallpaper_group(name)
    assert sum(g.determinant == 1 for g in group.cosets) == largest
    assert any(g.determinant == -1 for g in group.cosets) == reflects
    assert mirror_exists(group) == mirrors


def centres_off_mirrors(name):
    """Whether some 3-fold or 4-fold centre of the group lies on no mirror."""
    group = wallpaper_group(name)
    near = group.elements_near(np.zeros(2), 2.5)
    mirrors = [g for g in near if g.determinant == -1 and np.allclose((g @ g).translation, 0)]
    for g in near:
        if g.determinant == 1 and abs(np.trace(g.linear) - (-1 if "3" in name else 0)) < 1e-9:
            centre = np.linalg.solve(np.eye(2) - g.linear, g.translation)
            if np.linalg.norm(centre) < 1 and not any(
                np.allclose(m(centre), centre, atol=1e-9) for m in mirrors
            ):
                return True
    return False


@pytest.mark.parametrize(
    ("name", "off"), [("p3m1", False), ("p31m", True), ("p4m", False), ("p4g", True)]
)
def test_look_alikes_differ_by_their_centres(name, off):
    assert centres_off_mirrors(name) == off


@pytest.mark.parametrize("system", LATTICES)
def test_default_lattices_are_not_degenerate(system):
    assert abs(np.linalg.det(LATTICES[system])) > 0.5


@pytest.mark.parametrize(
    ("name", "system"),
    [("p4", "rectangular"), ("p3", "square"), ("pm", "oblique"), ("cm", "rectangular")],
)
def test_a_lattice_of_another_system_is_refused(name, system):
    with refused(name, "lattice", kind=GroupError):
        wallpaper_group(name, LATTICES[system])


@pytest.mark.parametrize("lattice", [np.ones((2, 2)), np.eye(3), np.zeros(2)])
def test_lattices_that_are_none_are_refused(lattice):
    with refused("lattice", kind=GroupError):
        wallpaper_group("p2", lattice)


ORBIFOLDS = {
    **{"o": "p1", "2222": "p2", "**": "pm", "××": "pg", "*×": "cm", "*2222": "pmm", "22*": "pmg"},
    **{"22×": "pgg", "2*22": "cmm", "442": "p4", "*442": "p4m", "4*2": "p4g", "333": "p3"},
    **{"*333": "p3m1", "3*3": "p31m", "632": "p6", "*632": "p6m"},
}


@pytest.mark.parametrize("symbol", ORBIFOLDS)
def test_orbifolds_have_the_cones_corners_and_mirrors_of_their_symbols(symbol):
    group = wallpaper_group(symbol)
    assert group.name == ORBIFOLDS[symbol]
    assert group_by_name(symbol) == group
    # Conway's count: what the features cost is 2, less the Euler characteristic 0
    cones, _, corners = symbol.partition("*")
    cost = sum((int(n) - 1) / int(n) for n in cones if n.isdigit())
    cost += sum((int(n) - 1) / (2 * int(n)) for n in corners if n.isdigit())
    assert cost + symbol.count("*") + symbol.count("×") + 2 * symbol.count("o") == 2
    assert mirror_exists(group) == ("*" in symbol)
    assert (group.order > 1 and max(map(int, filter(str.isdigit, symbol)), default=1)) == (
        group.order > 1 and POINT_GROUPS[group.name][0]
    )


def test_full_symbols_name_the_same_groups():
    full = {"p211": "p2", "p1g1": "pg", "c1m1": "cm", "p2gg": "pgg", "c2mm": "cmm", "p4gm": "p4g"}
    full |= {"p1m1": "pm", "p2mm": "pmm", "p2mg": "pmg", "p4mm": "p4m", "p6mm": "p6m"}
    assert all(wallpaper_group(symbol).name == name for symbol, name in full.items())
    assert all(group_by_name(symbol).name == name for symbol, name in full.items())


def test_unknown_names_are_refused_with_the_known_ones():
    with refused("p5", "p1", kind=GroupError):
        wallpaper_group("p5")
    with refused("cube", "torus", kind=GroupError):
        identification_group("cube")


def test_the_identification_spaces_are_those_of_the_paper():
    generators = {
        "torus": [],
        "sphere": [rotation((1.0, 1.0), 4), rotation((0.0, 0.0), 4)],
        "klein-bottle": [transflection(Line((0.5, 0.0), (0.0, 1.0)), 1.0)],
        "projective-plane": [
            transflection(Line((0.0, 0.5), (1.0, 0.0)), 1.0),
            transflection(Line((0.5, 0.0), (0.0, 1.0)), 1.0),
        ],
    }
    assert set(generators) == set(IDENTIFICATION_SPACES)
    for space, expected in generators.items():
        assert all(identification_group(space).contains(g) for g in expected)


@pytest.mark.parametrize("space", IDENTIFICATION_SPACES)
def test_the_canonical_square_is_a_fundamental_domain_by_area(space):
    group = identification_group(space)
    assert group.cell_volume / group.order == pytest.approx(1.0, abs=1e-15)
    assert group.name == IDENTIFICATION_SPACES[space].group


@pytest.mark.parametrize(
    ("name", "standard", "point", "image"),
    [
        ("p11m", "pm", (0.1, 0.2), (0.1, -0.2)),
        ("p11g", "pg", (0.1, 0.2), (0.6, -0.2)),
        ("p2gm", "pmg", (0.1, 0.2), (0.1, 0.3)),
    ],
)
def test_symbols_with_exchanged_axes(
    name: str, standard: str, point: tuple[float, float], image: tuple[float, float]
) -> None:
    group = wallpaper_group(name, np.eye(2))
    assert group.name == standard
    images = [np.array(isometry(np.array(point))) for isometry in group.cosets]
    assert any(np.allclose((found - image + 0.5) % 1, 0.5) for found in images)


def test_large_letters_name_plane_groups() -> None:
    assert wallpaper_group("P1") == wallpaper_group("p1")
    assert wallpaper_group("P4GM").name == "p4g"
