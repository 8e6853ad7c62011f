"""From template to tile: every frame tiles the plane, whichever way is taken."""

import itertools

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from orbiflow.tiles import Tile, certify, isohedral_class
from orbiflow.tiles.motion import Morph, OwnFrame
from orbiflow.tiles.silhouette import triangulate
from refusals import refused
from swirled_tiles import is_sound, swirled, swirled_tile


@settings(max_examples=4)
@given(swirled, st.lists(st.floats(0, 1), min_size=2, max_size=4))
def test_every_frame_tiles(tile: Tile, shares: list[float]) -> None:
    assume(is_sound(tile))
    morph = Morph(OwnFrame.of(tile))
    for share in (0.0, 1.0, *shares):
        frame = morph.at(share)
        frame.check()
        assert certify(frame.tile(), tolerance=1e-6).valid


@pytest.mark.parametrize("name", ["IH2", "IH21"])
def test_where_the_straight_way_crosses_itself(name: str) -> None:
    """Of each class a tile whose straight way does, and frame after frame of the other."""
    for seed, strength in itertools.product(range(30), (0.3, 0.5, 0.7)):
        tile = swirled_tile(name, seed, strength, per_edge=16)
        if not is_sound(tile):
            continue
        morph = Morph(OwnFrame.of(tile))
        if morph.weights is not None:
            break
    else:
        pytest.skip("no such tile among these")
    frames = [morph.at(float(share)) for share in np.linspace(0, 1, 7)]
    for frame in frames:
        certificate = certify(frame.tile(), tolerance=1e-6)
        assert certificate.valid, certificate.reasons
    steps = [
        np.sqrt(((b.points - a.points) ** 2).sum(axis=1).mean())
        for a, b in itertools.pairwise(frames)
    ]
    assert max(steps) < 4 * min(steps)  # it moves about evenly


@given(swirled)
def test_the_ends_are_the_template_and_the_tile(tile: Tile) -> None:
    assume(is_sound(tile))
    own = OwnFrame.of(tile)
    assert np.abs(own.tile().polygon - tile.polygon).max() < 1e-9
    morph = Morph(own)
    end = morph.at(1.0).tile()
    assert abs(abs(end.signed_area) - abs(tile.signed_area)) < 1e-9 * abs(tile.signed_area)
    start = morph.at(0.0)
    for k in range(len(start.starts)):
        edge = start.edge(k)
        along, away = edge[-1] - edge[0], edge - edge[0]
        off = np.abs(along[0] * away[:, 1] - along[1] * away[:, 0]) / (along @ along)
        assert off.max() < 2e-2  # straight, or nearly
    if morph.weights is None:
        corners = start.points[list(start.starts)]
        assert np.abs(corners - own.kind.template()).max() < 1e-12


@given(swirled, st.sets(st.integers(0, 119), min_size=1, max_size=9))
def test_refining_keeps_edges_identified(tile: Tile, sides: set[int]) -> None:
    own = OwnFrame.of(tile)
    finer = own.refined(sides)
    finer.check()
    assert len(finer.points) >= len(own.points) + len(sides)
    assert np.abs(finer.tile().signed_area - tile.signed_area) < 1e-9 * abs(tile.signed_area)


def test_a_way_whose_weights_are_hard_to_balance_stays_finite() -> None:
    tile = swirled_tile("IH2", 14, 0.3)
    morph = Morph(OwnFrame.of(tile), [triangulate(tile.polygon).points])
    for share in (0.5, 0.98):
        ring = morph.rings(share)[0]
        assert np.ptp(ring, axis=0).max() < 10


def test_tiles_of_no_class_are_refused() -> None:
    kind = isohedral_class("IH4")
    template = kind.template()
    with refused("class"):
        OwnFrame.of(Tile(template, kind.group()))
    with refused("corners", "IH4"):
        OwnFrame.of(Tile(template, kind.group(), "IH4", (0, 1, 2)))
    with refused("corners"):
        OwnFrame.of(Tile(template, kind.group(), "IH4", (0, 1, 2, 3, 5, 4)))
    bent = template + np.array([[0.0, 0.1], *[[0.0, 0.0]] * 5])
    with refused("edges", "IH4"):
        OwnFrame.of(Tile(bent, kind.group(), "IH4", (0, 1, 2, 3, 4, 5)))
