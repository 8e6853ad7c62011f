"""The table of nine classes against the geometry, what is free in a lattice, and how tiles lie."""

from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.arrays import Array
from orbiflow.symmetry import (
    WALLPAPER_GROUPS,
    CrystallographicGroup,
    identity,
    rotation_matrix,
    wallpaper_group,
)
from orbiflow.tiles import (
    CLASSES,
    EdgeIdentification,
    IsohedralClass,
    Tile,
    Tiling,
    arrangement,
    dirichlet_tile,
    isohedral_class,
    signed_area,
)
from orbiflow.tiles.tilings import commutant
from orbiflow.tiles.tilings.isohedral import stretch_matrix
from refusals import refused
from strategies import random_tensor, seeds, wallpaper_groups

GROUP_ORDERS = {"p1": 1, "p2": 2, "pg": 2, "pgg": 4, "p3": 3, "p4": 4, "p6": 6}


IDENTIFIED = {
    **{"IH1": "0=3 1=4 2=5", "IH2": "0~5 1=4 2~3", "IH3": "0~2 1=4 3~5"},
    **{"IH4": "0o 1=4 2o 3o 5o", "IH5": "0~5 1=4 2o 3o", "IH6": "0~2 1~4 3o 5o"},
    **{"IH7": "0>5 1>2 3>4", "IH21": "0>4 1>2 3o", "IH28": "0>4 1>2 3o"},
}
"""As the paper prints them: = translation, ~ glide, > rotation, o half-turn."""


def edges_from_group(kind: IsohedralClass, vertices: Array) -> set[str]:
    """Pairs of edges that an element other than 1 maps onto each other, tiles on both sides."""
    count, found = len(vertices), set[str]()
    for element in kind.group().elements_near(np.zeros(2), 8.0):
        if element.is_close(identity(2), 1e-9):
            continue
        image = element(vertices)
        for i in range(count):
            ends = image[[i, (i + 1) % count]]
            ends = ends if element.determinant < 0 else ends[::-1]
            for j in range(i, count):
                if np.allclose(ends, vertices[[j, (j + 1) % count]], atol=1e-9):
                    found.add(EdgeIdentification(i, j, element).brief)
    return found


def test_group_closes_and_has_the_right_area(kind: IsohedralClass) -> None:
    group, area = kind.group(), signed_area(kind.template())
    assert group.order == GROUP_ORDERS[kind.group_name]
    assert all(group.contains(generator) for generator in (g for g, _ in kind.paper_operators()))
    assert group.order * area == pytest.approx(group.cell_volume, rel=1e-14)
    assert area == pytest.approx(1.5 * np.sqrt(3.0))  # all templates are of one size


def test_identified_edges_agree_with_the_group(kind: IsohedralClass) -> None:
    shape = np.full(kind.shape_dim, 0.13)  # a generic pentagon: no accidental coincidences
    assert edges_from_group(kind, kind.template(shape)) == set(IDENTIFIED[kind.name].split())
    covered = [edge for pair in kind.identified_edges for edge in {pair.first, pair.second}]
    assert sorted(covered) == list(range(len(kind.template())))


def test_edge_isometry_maps_edge_onto_partner(kind: IsohedralClass) -> None:
    vertices = kind.template()
    for pair in kind.identified_edges:
        element = pair.isometry
        start = pair.second + 1 if pair.reversed else pair.second
        image = element(vertices[pair.first])
        np.testing.assert_allclose(image, vertices[start % len(vertices)], atol=1e-12)
    assert " ".join(pair.brief for pair in kind.identified_edges) == IDENTIFIED[kind.name]


@pytest.mark.parametrize("name", ["IH21", "IH28"])
def test_pentagons_keep_the_lattice_for_every_shape(name: str) -> None:
    kind = isohedral_class(name)
    for shape in np.random.default_rng(1).uniform(-0.3, 0.3, (5, 2)):
        vertices = kind.template(shape)
        pairs = set(IDENTIFIED[name].split())
        assert pairs <= edges_from_group(kind, vertices)
        assert signed_area(vertices) * kind.group().order == pytest.approx(kind.group().cell_volume)


def test_stretch_commutes_with_the_point_group(kind: IsohedralClass) -> None:
    rng = np.random.default_rng(2)
    for parameters in rng.uniform(-1.5, 1.5, (10, kind.stretch_dim)):
        linear = kind.stretch(parameters)
        assert np.linalg.det(linear) == pytest.approx(1.0)
        np.testing.assert_allclose(linear, linear.T)
        for g in kind.group().cosets:
            np.testing.assert_allclose(linear @ g.linear, g.linear @ linear, atol=1e-12)
        group = kind.group().conjugate(linear)
        for g in group.cosets:
            for h in group.cosets:
                assert group.contains(g @ h)


def test_stretch_is_the_exponential() -> None:
    for a, b in [(0.0, 0.0), (1e-3, 2e-3), (0.06, 0.08), (0.7, -0.4)]:
        generator = torch.tensor([[a, b], [b, -a]], dtype=torch.float64)
        expected = torch.linalg.matrix_exp(generator).numpy()
        found = isohedral_class("IH4").stretch(np.array([a, b]))
        np.testing.assert_allclose(found, expected, atol=1e-14)


@pytest.mark.parametrize("name", ["IH1", "IH2", "IH7", "IH21"])
def test_batched_and_differentiable(name: str) -> None:
    kind = isohedral_class(name)
    shape = torch.zeros(3, 4, kind.shape_dim, dtype=torch.float64, requires_grad=True)
    corners = len(kind.template())
    vertices = kind.template(shape)
    assert vertices.shape == (3, 4, corners, 2)
    np.testing.assert_allclose(vertices[1, 2].detach().numpy(), kind.template())
    parameters = torch.zeros(5, kind.stretch_dim, dtype=torch.float64, requires_grad=True)
    stretch = kind.stretch(parameters)
    assert stretch.shape == (5, 2, 2)
    np.testing.assert_allclose(stretch[0].detach().numpy(), np.eye(2))
    if shape.numel():
        assert torch.autograd.gradcheck(lambda s: kind.template(s), (shape,))
    if parameters.numel():
        assert torch.autograd.gradcheck(lambda s: kind.stretch(s), (parameters,))


@pytest.mark.parametrize("size", [0.09, 0.11, 1.0])
def test_gradients_of_the_stretch_across_the_series_boundary(size: float) -> None:
    point = torch.tensor([size, 0.01], dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda s: isohedral_class("IH1").stretch(s), (point,))


def test_names() -> None:
    for spelling in ("IH4", "ih4", "4", "IH04", " ih-4 ", 4):
        assert isohedral_class(spelling) is CLASSES["IH4"]
    for wrong in ("IH94", "four", "", "IH", -4):
        with refused("IH1, IH2, IH3, IH4, IH5, IH6, IH7, IH21, IH28"):
            isohedral_class(wrong)


def test_wrong_number_of_parameters() -> None:
    with refused("IH21", "shape", "(3,)"):
        isohedral_class("IH21").template(np.zeros(3))
    with refused("IH7", "stretch", "(2,)"):
        isohedral_class("IH7").stretch(torch.zeros(2))


WORDS = {
    **{"IH1": "rows, all alike", "IH2": "brick rows, every other row mirrored"},
    "IH3": "rows, every other row facing the other way",
    "IH4": "rows, every other row upside down",
    "IH5": "rows, by turns upside down and mirrored",
    **{"IH6": "every other one upside down, half of them mirrored", "IH7": "three around a point"},
    **{"IH21": "six around a point", "IH28": "four around a point"},
}


@pytest.mark.parametrize("name", WORDS)
@settings(max_examples=5)
@given(degrees=st.floats(0, 360), log_size=st.floats(-9, 9), flip=st.booleans())
def test_words_do_not_depend_on_the_frame(
    name: str, degrees: float, log_size: float, flip: bool
) -> None:
    turn = rotation_matrix(np.radians(degrees)) @ np.diag([1.0, -1.0 if flip else 1.0])
    tile = Tile(CLASSES[name].template(), CLASSES[name].group())
    size = 10.0**log_size
    assert arrangement(tile.transformed(size * turn, size * np.array([3.0, -7.0]))) == WORDS[name]


@pytest.mark.parametrize(
    ("group", "point", "words"),
    [
        ("p1", (0.1, 0.2), "rows, all alike"),
        ("p6m", (0, 0), "rows, all alike"),  # hexagons with all the symmetry there is
        ("p4g", (0, 0), "every other one mirrored"),  # a chessboard of whirls
        ("pm", (0.13, 0.21), "rows, every other row mirrored"),
        ("p4m", (0.13, 0.21), "eight around a point, with their mirror images"),
        ("p6m", (0.13, 0.21), "twelve around a point, with their mirror images"),
        ("p4", (0.5, 0.0), "every other one turned a quarter"),
    ],
)
def test_cells_of_any_group(group: str, point: tuple[float, float], words: str) -> None:
    assert arrangement(dirichlet_tile(wallpaper_group(group), point)) == words


def test_several_shapes_are_counted() -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    left, right = square * (0.3, 1.0), square * (0.7, 1.0) + (0.3, 0.0)
    assert arrangement(Tiling(wallpaper_group("p1"), [left, right])) == "2 shapes, rows, all alike"


DIMENSION = {"p1": 2, "p2": 2, "pm": 1, "pg": 1, "cm": 1, "pmm": 1, "pmg": 1, "pgg": 1, "cmm": 1}
"""Of the 17 groups; 0 where a rotation has order 3 or more."""


@pytest.mark.parametrize("name", CLASSES)
def test_the_nine_have_the_basis_that_saved_models_are_in(name: str) -> None:
    kind = CLASSES[name]
    units: Any = np.eye(2)[: DIMENSION.get(kind.group_name, 0)]
    assert np.array_equal(commutant(kind.group().linear_parts), units)
    assert kind.stretch_dim == len(units)


@given(st.data())
def test_dimension_and_commuting(data: st.DataObject) -> None:
    name = data.draw(st.sampled_from(list(WALLPAPER_GROUPS)))
    group: CrystallographicGroup = data.draw(wallpaper_groups([name]))
    basis = commutant(group.linear_parts)
    assert len(basis) == DIMENSION.get(name, 0)
    assert np.allclose(basis @ basis.T, np.eye(len(basis)), atol=1e-12)
    maps = stretch_matrix(basis, random_tensor(data.draw(seeds), 3, len(basis), size=1.0)).numpy()
    assert np.allclose(np.linalg.det(maps), 1)
    for linear in group.linear_parts:
        assert np.abs(linear @ maps - maps @ linear).max() < 1e-9
    stretched = group.conjugate(maps[0])
    assert stretched.order == group.order
