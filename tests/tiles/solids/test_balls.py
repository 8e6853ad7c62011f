"""Balls, their pieces and lamps: closed, of the right size, and the pieces are the ball."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold, OpType

from orbiflow.tiles import EscherTile, SolidSettings, make_solid, solid
from orbiflow.tiles.worlds import copies, facing, joints, unfolded
from refusals import refused
from swirled_tiles import is_sound, swirled_tile

COUNTS = {(2, 3, 3): 12, (2, 3, 4): 24, (2, 3, 5): 60}
tiles = st.builds(
    swirled_tile, st.sampled_from(["IH7", "IH28", "IH21"]), st.integers(0, 999), st.floats(0.0, 0.2)
).filter(is_sound)


@settings(max_examples=2)
@given(tiles, st.sampled_from(list(COUNTS)))
def test_balls_and_lamps_are_closed(tile: Any, order: Any) -> None:
    given_tile = EscherTile(tile)
    ball = make_solid(given_tile, SolidSettings(kind="ball", order=order, diameter=90.0))
    (body,) = ball.parts.values()
    whole = 4 / 3 * np.pi * 45.0**3
    assert body.status().name == "NoError"
    assert 0.85 * whole < body.volume() < whole
    assert body.genus() == 0
    assert body.bounding_box()[2] == pytest.approx(0, abs=1e-3)
    lamp = make_solid(given_tile, SolidSettings(kind="lamp", order=order, diameter=90.0, wall=2.0))
    (open_body,) = lamp.parts.values()
    assert open_body.genus() >= COUNTS[order] - 1  # an opening for each tile, at least
    assert 0 < open_body.volume() < 4 * np.pi * 45.0**2 * 2.0


@settings(max_examples=1)
@given(tiles, st.sampled_from([(2, 3, 3), (2, 3, 4)]))
def test_the_pieces_of_a_ball_are_the_ball(tile: Any, order: Any) -> None:
    given_tile = EscherTile(tile)
    chosen = SolidSettings(kind="ball-piece", order=order, diameter=60.0, wall=5.0, clearance=0.0)
    made = make_solid(given_tile, chosen)
    assert str(COUNTS[order]) in made.notes[-1]
    (piece,) = made.parts.values()
    shell = 4 / 3 * np.pi * (30.0**3 - 25.0**3)
    assert piece.volume() * COUNTS[order] == pytest.approx(shell, rel=0.01)
    loose = make_solid(given_tile, chosen.replace(clearance=0.4))
    assert next(iter(loose.parts.values())).volume() < piece.volume()
    found = unfolded(given_tile.tiling, order)
    frame = facing(found.middle)
    lowest = 30.0 - piece.bounding_box()[5]
    placed = piece.translate((0, 0, lowest))
    every = [
        placed.transform(np.column_stack([motion @ frame.T, np.zeros(3)]))
        for motion in copies(found, lambda own: np.ones(len(own), bool), 100)
    ]
    union = Manifold.batch_boolean(every, OpType.Add)
    assert union.volume() == pytest.approx(shell, rel=0.01)
    apart = sum(own.volume() for own in every) - union.volume()
    assert apart < 0.004 * shell


@settings(max_examples=3)
@given(tiles)
def test_joints_of_neighbours_meet(tile: Any) -> None:
    own = EscherTile(tile)
    found = unfolded(own.tiling, (2, 3, 4))
    pairs = joints(found.tiling, found.ring)
    assert len(pairs) >= 2
    for one, other in pairs:
        here, there = found.vectors(np.stack([one, other]))
        assert np.abs(found.neighbours @ there - here).max(axis=1).min() < 1e-9


def test_magnets_have_holes_in_the_sides_of_pieces() -> None:
    tile = EscherTile(swirled_tile("IH28", 3, 0.1))
    chosen = SolidSettings(kind="ball-piece", order=(2, 3, 4), diameter=120.0, wall=6.0)
    plain, holed = (
        next(iter(made.parts.values()))
        for made in (make_solid(tile, chosen), make_solid(tile, chosen.replace(magnet=3.0)))
    )
    found = unfolded(tile.tiling, (2, 3, 4))
    count = 2 * len(joints(found.tiling, found.ring))
    depth = 2.0 + chosen.clearance / 2
    missing = plain.volume() - holed.volume()
    assert missing == pytest.approx(count * np.pi * 1.5**2 * (depth - 0.1), rel=0.1)
    assert holed.genus() == 0
    with refused("magnet", "6 mm"):
        chosen.replace(magnet=6.0)
    with refused("magnet"):
        make_solid(tile, chosen.replace(magnet=5.0, magnet_depth=40.0))


def test_what_makes_no_ball_says_why(tmp_path: Path) -> None:
    with refused("p2", "IH28"):
        make_solid(EscherTile(swirled_tile("IH4", 3, 0.1)), SolidSettings(kind="ball"))
    tile = EscherTile(swirled_tile("IH28", 3, 0.1))
    with refused("2, 3, 7"):
        make_solid(tile, SolidSettings(kind="ball", order=(2, 3, 7)))
    with refused("wall", "diameter"):
        SolidSettings(kind="lamp", wall=30.0)
    with refused("diameter", "kind"):
        SolidSettings(kind="tile", diameter=30.0)
    solid(tile, tmp_path / "lamp.3mf", SolidSettings(kind="lamp", format="3mf"))
    assert (tmp_path / "lamp.3mf").exists()
