"""Offsets: seam allowances and borders at their distance, and what is said of what is lost."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from exported import polygons, svg_lines, tile_of
from orbiflow.tiles import ExportSettings, scenes, sheet_content
from orbiflow.tiles.make.offsets import offset_ring
from refusals import refused

HALF = [[0, 0], [4, 0], [4, 1.8], [6, 1.8], [6, 0], [10, 0]]
DUMBBELL = np.array([*HALF, *([x, 4.0 - y] for x, y in reversed(HALF))])
"""A neck 0.4 wide in the middle."""
STAR = np.array([[0, 0], [30, 3], [33, 20], [18, 12], [5, 24], [8, 10.0]])


@given(st.floats(0.05, 8) | st.floats(-1.5, -0.05))
def test_every_point_of_the_cut_is_at_the_distance(distance: float) -> None:
    line, _ = offset_ring(STAR, distance, 1e-3)
    apart = shapely.distance(shapely.points(line), shapely.LinearRing(STAR))
    np.testing.assert_allclose(apart, abs(distance), atol=1e-3)
    grown = shapely.Polygon(line).contains(shapely.Polygon(STAR))
    assert grown == (distance > 0)


def test_a_neck_that_vanishes() -> None:
    with refused("offset", "-0.3 mm", "2 parts") as e:
        offset_ring(DUMBBELL, -0.3, 1e-3)
    assert "0.40 mm wide 4.0 mm from its left and 2.0 mm from its top" in str(e.value)
    with refused("offset", "-2.1 mm"):
        offset_ring(DUMBBELL, -2.1, 1e-3)
    assert offset_ring(DUMBBELL, -0.15, 1e-3)[1] == ""


def test_a_limb_that_vanishes_is_a_note_with_its_place() -> None:
    tail = np.array([[0, 0], [10, 0], [10, 4], [20, 4], [20, 5], [10, 5], [10, 10], [0, 10.0]])
    line, note = offset_ring(tail, -0.6, 1e-3)
    assert np.ptp(line[:, 0]) < 9.1
    assert "1 limb vanishes where the outline is less than 1.2 mm across" in note
    assert "20.0 mm from its left" in note


def test_a_gap_that_closes_is_a_note_with_its_place() -> None:
    gap = np.array([[0, 0], [20, 0], [20, 4], [6, 4], [6, 5], [20, 5], [20, 9], [0, 9.0]])
    line, note = offset_ring(gap, 2.0, 1e-3)
    assert "1 gap closes where the outline is less than 4 mm across" in note
    assert "6.0 mm from its left" in note
    assert shapely.Polygon(line).covers(shapely.box(-2, 0, 20, 9))
    assert offset_ring(gap, 0.4, 1e-3)[1] == ""


@pytest.mark.parametrize("offset", [6.0, -1.0])
@pytest.mark.parametrize("name", ["IH1", "IH5"])
def test_pieces_in_the_file(name: str, offset: float) -> None:
    options = {"cut": "pieces", "tile_size": 50, "area": (200, 150), "format": "svg"}
    chosen = ExportSettings(offset=offset, kerf=0.2, copies=2, **options)
    (scene,), _ = scenes(tile_of(name), chosen)
    text = sheet_content(scene, chosen)
    assert isinstance(text, str)
    lines = svg_lines(text)
    cuts = polygons([line for line in lines if line.layer == "cut"])
    tile = shapely.Polygon(scene.prototiles[0])
    assert len(cuts) == len(scene.tiles)
    for placed in scene.tiles:
        own = shapely.affinity.affine_transform(tile, [*placed.linear.ravel(), *placed.offset])
        cut = max(cuts, key=lambda cut: cut.intersection(own).area)
        left = cut.buffer(-0.1)  # what the beam leaves
        assert (
            left.symmetric_difference(own.buffer(offset)).area < 2 * chosen.deviation * own.length
        )
    seams = [line for line in lines if line.layer == "seam"]
    # the line to sew along lies where the tile is; a cut inside needs none
    assert len(seams) == (2 if offset > 0 else 0)
    for seam in polygons(seams):
        assert seam.area == pytest.approx(tile.area, rel=1e-2)
        assert any(cut.contains(seam) for cut in cuts)
