"""Neighbours by edge and by point, patches without gaps, and proper colourings."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from exported import tile_of
from orbiflow.symmetry import CrystallographicGroup, identity, rotation_matrix, translation
from orbiflow.tiles import (
    CLASSES,
    IsohedralClass,
    Tile,
    certify,
    colouring,
    copies_inside,
    copies_meeting,
    edge_to_edge,
    edges,
    isohedral_class,
    neighbours,
    patch,
)
from orbiflow.tiles.tilings.colourings import colour_graph
from orbiflow.tiles.tilings.tiling import coset_and_cell
from refusals import refused
from some_tilings import shared_lengths

CORNER_NEIGHBOURS = {"IH21": 3, "IH28": 2}  # across the 6-fold, and across the two 4-fold centres


def test_counts(kind: IsohedralClass, make_tile: Any) -> None:
    found = neighbours(make_tile(kind, 4, stretch=0.2))
    assert len(found.edge) == len(kind.template())
    assert len(found.point) == CORNER_NEIGHBOURS.get(kind.name, 0)


def test_squares_and_bricks() -> None:
    polygon = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    squares = neighbours(Tile(polygon, CrystallographicGroup.generate(np.eye(2))))
    assert (len(squares.edge), len(squares.point)) == (4, 4)
    bricks = CrystallographicGroup.generate(np.array([[1.0, 0.5], [0.0, 1.0]]))
    found = neighbours(Tile(polygon, bricks))
    assert (len(found.edge), len(found.point)) == (6, 0)


def test_tile_alone() -> None:
    polygon = np.array([[0.0, 0.0], [0.1, 0.0], [0.0, 0.1]])
    found = neighbours(Tile(polygon, CrystallographicGroup.generate(np.eye(2))))
    assert found == ((), ())


def bricks(width: float, offset: float, angle: float = 0.0, scale: float = 1.0) -> Tile:
    """Bricks of height 1, each row moved by an offset."""
    group = CrystallographicGroup.generate(np.array([[width, offset], [0.0, 1.0]]))
    ring = np.array([[0.0, 0.0], [width, 0.0], [width, 1.0], [0.0, 1.0]])
    tile = Tile(ring, group)
    return tile.transformed(scale * rotation_matrix(angle), scale * np.array([3.0, -7.0]))


@settings(max_examples=12, deadline=None)
@given(
    st.floats(0.3, 4.0),
    st.floats(-6.0, -0.5),
    st.sampled_from([1.0, -1.0]),
    st.floats(-3.2, 3.2),
    st.sampled_from([1e-2, 1.0, 300.0]),
)
def test_bricks_with_any_offset_have_the_neighbours_and_colours_that_shapely_measures(
    width: float, power: float, sign: float, angle: float, scale: float
) -> None:
    tile = bricks(width, sign * 10.0**power * width, angle, scale)
    reach = 1.5 * scale * max(width, 1.0)
    x, y = tile.center
    placed = patch(tile, (x - reach, y - reach, x + reach, y + reach))
    shared = shared_lengths(tile.tiling, placed)
    chosen = colouring(tile)
    colours = [chosen.colour(g) for g in placed]
    assert all(colours[i] != colours[j] for i, j in shared)
    itself = next(i for i, g in enumerate(placed) if g.is_close(identity(2), 1e-9))
    near = neighbours(tile)
    assert len(near.edge) == sum(i == itself for i, _ in shared) == 6
    assert (certify(tile).neighbours, chosen.count, len(near.point)) == (6, 3, 0)
    assert len(edges(edge_to_edge(tile))) == 6


@pytest.mark.parametrize("angle", [0.0, 0.4, 2.0])
def test_sides_shorter_than_the_tolerance_are_points(angle: float) -> None:
    found = neighbours(bricks(1.0, 3e-8, angle))
    assert (len(found.edge), len(found.point)) == (4, 4)


def test_needles_share_no_boundary_at_their_points() -> None:
    lattice = np.array([[1.0, 0.99], [0.0, 0.02]])
    ring = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]) @ lattice.T
    found = neighbours(Tile(ring, CrystallographicGroup.generate(lattice)))
    assert (len(found.edge), len(found.point)) == (4, 4)


def window_of(tile: Tile, shift: tuple[float, float], size: tuple[float, float]) -> tuple:
    middle = tile.center + tile.radius * np.array(shift)
    half = tile.radius * np.array(size)
    return (*(middle - half), *(middle + half))


@pytest.mark.parametrize("name", CLASSES)
def test_neighbours_and_colours(name: str) -> None:
    tile = tile_of(name)
    copies = copies_meeting(tile, window_of(tile, (0, 0), (3, 3)))
    own, colours = edges(tile), colouring(tile)
    beyond = copies.neighbours(own.across).copy
    table = colours.colours(copies)
    known = {
        (int(c), *map(int, cell)): k
        for k, (c, cell) in enumerate(zip(copies.cosets, copies.cells, strict=True))
    }
    for k in range(len(copies)):
        g = copies.isometry(k)
        assert table[k] == colours.colour(g)
        for edge, element in enumerate(own.across):
            coset, cell = coset_and_cell(tile.group, g @ element)
            assert beyond[k, edge] == known.get((coset, *cell), -1)
            if beyond[k, edge] >= 0:
                assert table[k] != table[beyond[k, edge]]


def test_an_empty_window_of_whole_tiles() -> None:
    tile = tile_of("IH5")
    found = copies_inside(tile, window_of(tile, (0, 0), (0.1, 0.1)))
    assert len(found) == 0
    assert found.neighbours(edges(tile).across).copy.shape == (0, 6)


def test_window_inside_one_tile() -> None:
    tile = Tile(isohedral_class("IH7").template(), isohedral_class("IH7").group())
    (only,) = patch(tile, (0.1, 0.1, 0.2, 0.2))
    assert only.is_close(identity(2))


@pytest.mark.parametrize("window", [(0, 0, 0, 1), (1, 0, 0, 1), (0, 0, np.nan, 1), (0, 0, 1)])
def test_windows_that_are_none(window: tuple[float, ...]) -> None:
    tile = Tile(isohedral_class("IH1").template(), isohedral_class("IH1").group())
    with refused("window"):
        patch(tile, window)


def test_a_long_thin_window() -> None:
    tile = Tile(isohedral_class("IH1").template(), isohedral_class("IH1").group())
    found = patch(tile, (0.1, 0.1, 9000.1, 0.1 + 1e-9))
    assert len(found) == pytest.approx(9000 / 1.5, abs=2)


@pytest.mark.parametrize("window", [(-500, -500, 500, 500), (0, 0, 1e9, 1)])
def test_too_many_tiles(window: tuple[float, ...]) -> None:
    tile = Tile(isohedral_class("IH1").template(), isohedral_class("IH1").group())
    with refused("window", 20000):
        patch(tile, window)


SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def assert_proper(tile: Tile, window: tuple[float, float, float, float]) -> None:
    colours, touching = colouring(tile), neighbours(tile).edge
    for g in patch(tile, window):
        own = colours.colour(g)
        assert 0 <= own < colours.count
        assert all(own != colours.colour(g @ n) for n in touching)


@pytest.mark.parametrize("seed", range(2))
def test_proper_with_three_colours(kind: IsohedralClass, make_tile: Any, seed: int) -> None:
    tile = make_tile(kind, seed, stretch=0.3, shape=0.1)
    assert_proper(tile, (-8.0, -8.0, 8.0, 8.0))
    assert colouring(tile).count == 3


def test_periodic_and_deterministic(kind: IsohedralClass, make_tile: Any) -> None:
    tile = make_tile(kind)
    first, again = colouring(tile), colouring(tile)
    assert (first.table == again.table).all()
    a, b, c = first.sublattice
    for column in ((a, 0), (b, c)):
        shift = translation(tile.group.lattice @ np.array(column, dtype=float))
        for g in patch(tile, (-3.0, -3.0, 3.0, 3.0)):
            assert first.colour(shift @ g) == first.colour(g)


def test_most_frequent_colour_comes_first(kind: IsohedralClass, make_tile: Any) -> None:
    counts = np.bincount(colouring(make_tile(kind)).table.ravel())
    assert (np.diff(counts) <= 0).all()


@pytest.mark.parametrize("skew", [0.5, 7.3, 97.25, 5040.5])
def test_skew_lattices_never_fail(skew: float) -> None:
    """The same bricks, but the lattice basis hides that neighbours are translates."""
    tile = Tile(SQUARE, CrystallographicGroup.generate(np.array([[1.0, skew], [0.0, 1.0]])))
    assert_proper(tile, (-4.0, -4.0, 4.0, 4.0))
    assert colouring(tile).count == 3


def test_foreign_isometry_of_colouring() -> None:
    kind = isohedral_class("IH1")
    with refused("Isometry", "p1"):
        colouring(Tile(kind.template(), kind.group())).colour(translation((0.2, 0.0)))


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 12), st.integers(0, 2**32 - 1))
def test_graph_colouring_is_proper(size: int, seed: int) -> None:
    pairs = np.triu(np.random.default_rng(seed).random((size, size)) < 0.4, 1)
    graph = [set(np.flatnonzero(pairs[i] | pairs[:, i]).tolist()) for i in range(size)]
    count = next(k for k in range(1, size + 1) if colour_graph(graph, k) is not None)
    colours = colour_graph(graph, count)
    assert colours is not None
    assert all(colours[i] != colours[j] for i in range(size) for j in graph[i])
    assert count <= 1 + max(len(near) for near in graph)
    assert (count == 1) == (not pairs.any())
