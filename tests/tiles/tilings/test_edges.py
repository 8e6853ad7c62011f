"""The edges that are read off a polygon are those of its class."""

from __future__ import annotations

import numpy as np
import pytest

from orbiflow.tiles import IsohedralClass, Tile, edges


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
