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
    **{"p1": (1, False, False), "p2": (2, False, False), "pm": (1, True, True)},
    **{"pg": (1, True, False), "cm": (1, True, True), "pmm": (2, True, True)},
    **{"pmg": (2, True, True), "pgg": (2, True, False), "cmm": (2, True, True)},
    **{"p4": (4, False, False), "p4m": (4, True, True), "p4g": (4, True, True)},
    **{"p3": (3, False, False), "p3m1": (3, True, True), "p31m": (3, True, True)},
    **{"p6": (6, False, False), "p6m": (6, True, True)},
}


def mirror_exists(group):
    """Whether some element reverses orientation and has no glide component modulo the lattice."""
    for g in group.elements_near(group.lattice.sum(axis=1) / 2, 3 * np.abs(group.lattice).sum()):
        if g.determinant == -1 and np.allclose((g @ g).translation, 0, atol=1e-9):
            return True
    return False


@given(st.data(), st.sampled_from(sorted(WALLPAPER_GROUPS)))
def test_order_is_that_of_the_table_on_any_lattice(data, name):
    row = WALLPAPER_GROUPS[name]
    group = wallpaper_group(name, data.draw(lattices(row.system)))
    assert group.order == row.order
    assert group.name == name


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
