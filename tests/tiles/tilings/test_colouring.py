"""Colourings are proper, periodic and small."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.symmetry import CrystallographicGroup, translation
from orbiflow.tiles import IsohedralClass, Tile, colouring, isohedral_class, neighbours, patch
from orbiflow.tiles.tilings.colourings import colour_graph
from refusals import refused

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


def test_chessboard() -> None:
    tile = Tile(SQUARE, CrystallographicGroup.generate(np.eye(2)))
    assert colouring(tile).count == 2


@pytest.mark.parametrize("skew", [0.5, 7.3, 97.25, 5040.5])
def test_skew_lattices_never_fail(skew: float) -> None:
    """The same bricks, but the lattice basis hides that neighbours are translates."""
    tile = Tile(SQUARE, CrystallographicGroup.generate(np.array([[1.0, skew], [0.0, 1.0]])))
    assert_proper(tile, (-4.0, -4.0, 4.0, 4.0))
    assert colouring(tile).count == 3


def test_foreign_isometry() -> None:
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
