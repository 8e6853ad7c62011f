"""Fits keep their tolerance and their corners; a smooth tile tiles as its polygon does."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from exported import tile_of, tiles
from orbiflow.tiles import Curve, Tile
from orbiflow.tiles.page import fitted, outline, turning
from orbiflow.tiles.page.outlines import CORNER, SHARP_CORNER


def polyline(seed: int, count: int, rough: float) -> np.ndarray:
    rng = np.random.default_rng(seed)
    angles = np.cumsum(rng.normal(scale=rough, size=count))
    lengths = rng.uniform(0.2, 3, count)
    steps = lengths[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.concatenate([[[0, 0]], np.cumsum(steps, axis=0)])


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 60), st.floats(0, 1.0), st.floats(1e-3, 0.3))
def test_fits_keep_their_tolerance(seed, count, rough, tolerance) -> None:
    points = polyline(seed, count, rough)
    curve = fitted(points, tolerance)
    np.testing.assert_array_equal(curve.start, points[0])
    np.testing.assert_array_equal(curve.end, points[-1])
    np.testing.assert_array_equal(curve.pieces[1:, 0], curve.pieces[:-1, 3])
    flat = shapely.LineString(curve.flattened(tolerance / 100))
    apart = shapely.hausdorff_distance(flat, shapely.LineString(points), densify=0.05)
    assert apart <= 1.1 * tolerance  # densified: the measure itself is coarse
    turn = turning(points)
    # what turns alone, the same way as neither neighbour by half as much, or sharply
    on = np.maximum(np.sign(turn) * np.pad(turn, 1)[:-2], np.sign(turn) * np.pad(turn, 1)[2:])
    alone = (np.abs(turn) > CORNER) & (on <= np.abs(turn) / 2)
    corners = points[1:-1][alone | (np.abs(turn) > SHARP_CORNER)]
    ends = {tuple(p) for p in curve.pieces[:, 0]}
    assert all(tuple(corner) in ends for corner in corners)


def polygon(sides: int) -> np.ndarray:
    turns = np.linspace(0, 2 * np.pi, sides + 1)
    return 10 * np.stack([np.cos(turns), np.sin(turns)], axis=1)


def kinks(curve: Curve) -> np.ndarray:
    """By how many radians it turns where its pieces meet."""
    before = curve.pieces[:-1, 3] - curve.pieces[:-1, 2]
    after = np.diff(curve.pieces, axis=1)[1:, 0]
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.abs(np.arctan2(cross, (before * after).sum(axis=1)))


def test_a_coarse_arc_has_no_facets() -> None:
    curve = fitted(polygon(10), 0.6)  # turns by 36 degrees
    assert not curve.straight.any()
    assert kinks(curve).max(initial=0) < 1e-9


def test_what_turns_once_is_a_corner() -> None:
    ring = polygon(6)
    halved = np.insert(ring, range(1, 7), (ring[1:] + ring[:-1]) / 2, axis=0)
    curve = fitted(halved, 0.6)
    assert np.isclose(kinks(curve), np.pi / 3).sum() == 5


def test_a_smooth_curve_takes_few_pieces_and_has_no_kinks() -> None:
    share = np.linspace(0, 3 * np.pi, 150)
    wave = np.stack([10 * share, 8 * np.sin(share)], axis=1)
    curve = fitted(wave, 0.05)
    assert len(curve.pieces) < 20
    assert not curve.straight.any()
    assert kinks(curve).max() < 1e-9


@settings(max_examples=25, deadline=None)
@given(tiles, st.floats(1e-4, 0.01))
def test_smooth_tiles_tile_as_exactly_as_polygons(tile: Tile, share: float) -> None:
    tolerance = share * tile.radius
    found = outline(tile, tolerance)
    assert found.edges is not None
    for pair in found.edges.identifications:
        image = found.curves[pair.first].moved(pair.isometry.linear, pair.isometry.translation)
        image = image.reversed() if pair.reversed else image
        np.testing.assert_allclose(
            image.pieces, found.curves[pair.second].pieces, atol=1e-9 * tile.radius
        )
    ring = found.closed[0].flattened(tolerance / 50)
    polygon = shapely.Polygon(ring)
    assert polygon.is_valid
    assert polygon.area == pytest.approx(abs(tile.signed_area), rel=1e-9)
    assert (
        shapely.hausdorff_distance(polygon.exterior, shapely.LinearRing(tile.polygon)) <= tolerance
    )


def test_curves_that_would_cross_are_fitted_more_closely() -> None:
    # two slits, closer to each other than the tolerance
    thin = [[0, 0], [4, 0], [4, 1.99], [1, 2.0], [4, 2.01], [4, 4], [0, 4]]
    group = tile_of("IH1").group
    found = outline(Tile(np.array(thin), group), 0.3)
    assert found.edges is None
    assert "left as it is" in found.note
    assert len(found.closed[0].pieces) == 7


def test_flattened_curves_keep_the_tolerance_they_are_given() -> None:
    half = Curve(np.array([[[0, 0], [0, 4 / 3], [2, 4 / 3], [2, 0]]]), np.array([False]))
    fine = half.flattened(1e-6)
    for tolerance in (1.0, 0.1, 1e-3):
        coarse = shapely.LineString(half.flattened(tolerance))
        assert shapely.distance(shapely.points(fine), coarse).max() <= tolerance
    assert half.reversed().flattened(1e-6)[::-1] == pytest.approx(fine)
