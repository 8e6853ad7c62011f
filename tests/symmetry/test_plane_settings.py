"""Plane groups by all their symbols, and the tables of groups."""

import math

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
    group_from_operators,
    identification_group,
    rotation,
    rotation_matrix,
    transflection,
    wallpaper_group,
)
from refusals import refused
from strategies import angles, lattices, random_points, seeds

# International Tables for Crystallography, volume A, the 17 plane groups: short and full symbol, cell,
# and the coordinates of the general position. Those of cells that are centred have (1/2, 1/2)+ beside.
THREE = "x,y -y,x-y -x+y,-x "
SIX = THREE + "-x,-y y,-x+y x-y,x "
FOUR = "x,y -x,-y -y,x y,-x "
ACROSS, ALONG = "-y,-x -x+y,y x,x-y ", "y,x x-y,-y -x,-x+y "
TABLES = {
    **{("p1",): ("oblique", "x,y"), ("p2", "p211"): ("oblique", "x,y -x,-y")},
    ("pm", "p1m1"): ("rectangular", "x,y -x,y"),
    **{("pg", "p1g1"): ("rectangular", "x,y -x,y+1/2"), ("cm", "c1m1"): ("centred", "x,y -x,y")},
    ("pmm", "p2mm"): ("rectangular", "x,y -x,-y -x,y x,-y"),
    ("pmg", "p2mg"): ("rectangular", "x,y -x,-y -x+1/2,y x+1/2,-y"),
    ("pgg", "p2gg"): ("rectangular", "x,y -x,-y -x+1/2,y+1/2 x+1/2,-y+1/2"),
    **{("cmm", "c2mm"): ("centred", "x,y -x,-y -x,y x,-y"), ("p4",): ("square", FOUR)},
    ("p4m", "p4mm"): ("square", FOUR + "-x,y x,-y y,x -y,-x"),
    ("p4g", "p4gm"): ("square", FOUR + "-x+1/2,y+1/2 x+1/2,-y+1/2 y+1/2,x+1/2 -y+1/2,-x+1/2"),
    **{("p3",): ("hexagonal", THREE), ("p3m1",): ("hexagonal", THREE + ACROSS)},
    **{("p31m",): ("hexagonal", THREE + ALONG), ("p6",): ("hexagonal", SIX)},
    ("p6m", "p6mm"): ("hexagonal", SIX + ACROSS + ALONG),
    # the other setting, in which a and b are exchanged
    ("p11m",): ("rectangular", "x,y x,-y"),
    ("p11g",): ("rectangular", "x,y x+1/2,-y"),
    ("c11m",): ("centred", "x,y x,-y"),
    ("p2gm",): ("rectangular", "x,y -x,-y -x,y+1/2 x,-y+1/2"),
}
CELLS = {
    **{"oblique": (1.3, 0.9, 73.0), "rectangular": (1.0, 1.7), "centred": (1.0, 1.7)},
    **{"square": (2.0, 2.0), "hexagonal": (1.5, 1.5)},
}
CENTRED = [[0.5, 0.5], [0.5, -0.5]]  # its primitive vectors (a + b) / 2 and (a - b) / 2, by columns
ROWS = [(name, *row) for names, row in TABLES.items() for name in names]


def basis_of(system: str) -> np.ndarray:
    """Return the conventional vectors of a cell, as columns."""
    a, b, *angle = CELLS[system]
    gamma = np.radians(angle[0] if angle else 120 if system == "hexagonal" else 90)
    return np.array([[a, b * np.cos(gamma)], [0.0, b * np.sin(gamma)]])


@pytest.mark.parametrize(("name", "system", "general"), ROWS, ids=[row[0] for row in ROWS])
def test_groups_have_the_general_positions_of_the_tables(
    name: str, system: str, general: str
) -> None:
    listed, basis = general.split(), basis_of(system)
    if system == "centred":
        listed.append("x+1/2,y+1/2")
    wanted = group_from_operators(listed, basis)
    assert wanted.order == len(general.split())
    primitive = basis @ CENTRED if system == "centred" else basis
    assert wallpaper_group(name, primitive) == wanted
    spaced = " ".join(name)
    for written in (name, spaced, f"${name}$"):
        assert group_by_name(written, CELLS[system]) == wanted
        assert wallpaper_group(written.upper(), primitive) == wanted


def test_settings_differ_and_cells_of_neither_are_refused() -> None:
    for one, other in (("pm", "p11m"), ("pg", "p11g"), ("cm", "c11m"), ("pmg", "p2gm")):
        assert wallpaper_group(one) != wallpaper_group(other)
    for name in ("c12m", "c1m", "p1m", "c2mg", "c11g"):
        with refused(name, kind=GroupError):
            wallpaper_group(name)
    with refused("cm", "[0.0, 2.0]", kind=GroupError):
        wallpaper_group("c11m", np.diag([1.0, 2.0]))


coordinates = st.tuples(st.floats(-3, 3), st.floats(-3, 3))
orders = st.integers(1, 12)
lines = st.builds(
    lambda c, angle, length: Line(c, (length * math.cos(angle), length * math.sin(angle))),
    coordinates,
    angles,
    st.floats(0.1, 10),
)
shifts = st.floats(-3, 3)


@given(lines, shifts, seeds)
def test_transflection_is_the_papers_formula(line, mu, seed):
    p = random_points(seed, 7, 2)
    c, d = line.point, line.direction
    mirrored = 2 * c - p + 2 * ((p - c) @ d)[:, None] * d
    np.testing.assert_allclose(transflection(line, mu)(p), mirrored + mu * d, atol=1e-13)


@given(coordinates, orders, seeds)
def test_rotation_multiplies_the_complex_offset_by_a_root_of_unity(center, order, seed):
    p = random_points(seed, 7, 2)
    c = complex(*center)
    turned = c + np.exp(2j * np.pi / order) * (p[:, 0] + 1j * p[:, 1] - c)
    expected = np.stack([turned.real, turned.imag], axis=-1)
    np.testing.assert_allclose(rotation(center, order)(p), expected, atol=1e-13)


@given(coordinates, orders)
def test_a_negative_order_turns_clockwise(center, order):
    assert rotation(center, -order).is_close(rotation(center, order).inverse(), 1e-13)


@given(st.integers(-9, 9))
def test_quarter_turns_are_exact(quarters):
    assert set(np.abs(rotation_matrix(quarters * math.pi / 2)).ravel().tolist()) == {0.0, 1.0}


@pytest.mark.parametrize("order", [0, 2.5])
def test_an_order_that_is_no_integer_is_refused(order):
    with refused("order", order, kind=GroupError):
        rotation((0.0, 0.0), order)


@pytest.mark.parametrize(
    ("point", "direction", "match"),
    [
        ((0.0, 0.0), (0.0, 0.0), "must not be zero"),
        ((0.0, np.nan), (1.0, 0.0), "the point of a line"),
        ((0.0, 0.0), (1.0, 0.0, 0.0), "the direction of a line"),
    ],
)
def test_lines_that_are_none_are_refused(point, direction, match):
    with pytest.raises(GroupError, match=match):
        Line(point, direction)


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
