"""Neighbours by edge and by point."""

from __future__ import annotations

from typing import Any

import numpy as np

from orbiflow.symmetry import CrystallographicGroup, identity
from orbiflow.tiles import IsohedralClass, Tile, neighbours

CORNER_NEIGHBOURS = {"IH21": 3, "IH28": 2}  # across the 6-fold, and across the two 4-fold centres


def test_counts(kind: IsohedralClass, make_tile: Any) -> None:
    found = neighbours(make_tile(kind, 4, stretch=0.2))
    assert len(found.edge) == len(kind.template())
    assert len(found.point) == CORNER_NEIGHBOURS.get(kind.name, 0)


def test_closed_under_inverse_and_without_identity(kind: IsohedralClass, make_tile: Any) -> None:
    for elements in neighbours(make_tile(kind, 5)):
        for g in elements:
            assert not g.is_close(identity(2), 1e-6)
            assert any(h.is_close(g.inverse(), 1e-6) for h in elements)


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
