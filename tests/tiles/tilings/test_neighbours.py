"""Neighbours by edge and by point."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.symmetry import CrystallographicGroup, identity, rotation_matrix
from orbiflow.tiles import (
    IsohedralClass,
    Tile,
    certify,
    colouring,
    edge_to_edge,
    edges,
    neighbours,
    patch,
)
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
