"""The edges that are read off a polygon are those of its class."""

from __future__ import annotations

import numpy as np
import pytest

from exported import tile_of
from orbiflow.symmetry import wallpaper_group
from orbiflow.tiles import CLASSES, IsohedralClass, Tile, edges
from refusals import refused


def test_the_templates(kind: IsohedralClass) -> None:
    found = edges(Tile(kind.template(), kind.group())).identifications
    expected = {(pair.first, pair.second, pair.reversed) for pair in kind.identified_edges}
    assert {(pair.first, pair.second, pair.reversed) for pair in found} == expected


@pytest.mark.parametrize("turned", [False, True])
def test_bent_tiles(kind: IsohedralClass, make_tile, turned: bool) -> None:
    tile = make_tile(kind, seed=3, stretch=0.1, per_edge=15)
    if turned:  # the other sense, and begun within an edge
        count = len(tile.polygon)
        tile = Tile(np.roll(tile.polygon[::-1], -4, axis=0), tile.group)
        corners = sorted((count - 1 - k * 15 - 4) % count for k in range(count // 15))
        assert list(edges(tile).starts) == corners
    else:
        assert edges(tile).starts == tile.corners
    own = edges(tile)
    assert sum(len(own.points(k)) - 1 for k in range(len(own.starts))) == len(tile.polygon)
    for pair in own.identifications:
        image = pair.isometry(own.points(pair.first))
        image = image[::-1] if pair.reversed else image
        np.testing.assert_allclose(image, own.points(pair.second), atol=1e-9)
        assert own.across[pair.second].is_close(pair.isometry)


def test_partners_are_partners_of_each_other() -> None:
    for name in CLASSES:
        own = edges(tile_of(name))
        for edge, partner in enumerate(own.partners):
            assert own.partners[partner] == edge
            there = own.across[edge] @ own.across[partner]
            assert there.is_close(own.across[edge] @ own.across[edge].inverse(), 1e-6)


def test_bricks_in_half_bond_have_sides_that_no_neighbour_has() -> None:
    brick = Tile(
        np.array([[0, 0], [2, 0], [2, 1], [0, 1]]), wallpaper_group("p1", [[2, 1], [0, 1]])
    )
    with refused(2, 4, "edge_to_edge"):
        edges(brick)
