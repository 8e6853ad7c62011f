"""Curves keep their tolerance and corners; lines are followed from the inside out."""

from collections import Counter
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from artworks import EYE, squirrel
from exported import scenes, tile_of, tiles
from orbiflow.tiles import Curve, ExportSettings, Scene, Tile
from orbiflow.tiles.make import exporting
from orbiflow.tiles.make.cut_order import in_cutting_order, ordered_lines
from orbiflow.tiles.page import Layer, PathPart, Style, fitted, outline, turning
from orbiflow.tiles.page.outlines import CORNER, SHARP_CORNER

rows = st.lists(st.tuples(*[st.floats(0, 100)] * 4), min_size=1, max_size=60)


@settings(max_examples=30)
@given(rows)
def test_open_lines_are_kept_and_go_to_the_nearest(ends: list) -> None:
    curves = [Curve.polyline([[a, b], [c, d]]) for a, b, c, d in ends]
    ordered, place = ordered_lines(curves, np.zeros(2))
    assert Counter(map(key, ordered)) == Counter(map(key, curves))
    left = [np.array([c.start, c.end]) for c in ordered if isinstance(c, Curve)]
    assert np.array_equal(place, left[-1][1])
    place = np.zeros(2)
    for k, own in enumerate(left):
        nearest = min(float(np.linalg.norm(ends - place, axis=1).min()) for ends in left[k:])
        assert np.isclose(np.linalg.norm(own[0] - place), nearest)
        place = own[1]


def key(line: Curve | PathPart) -> tuple:
    """What stays of a line however it is turned."""
    curve = line if isinstance(line, Curve) else line.curves[0]
    corners = curve.pieces[:, 0] if curve.closed else np.stack([curve.start, curve.end])
    return tuple(sorted(map(tuple, corners.tolist())))


@settings(max_examples=40)
@given(st.lists(st.tuples(st.floats(10, 90), st.floats(10, 90), st.floats(1, 40)), max_size=25))
def test_what_lies_inside_comes_first(discs: list) -> None:
    turns = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    ring = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    curves = [Curve.polyline(ring * r + (x, y), closed=True) for x, y, r in discs]
    ordered, _ = ordered_lines(curves, np.zeros(2))
    assert Counter(map(key, ordered)) == Counter(map(key, curves))
    assert_inside_out([own for own in ordered if isinstance(own, Curve)])


def assert_inside_out(curves: list[Curve]) -> None:
    regions = [shapely.Polygon(c.flattened(0.01)) if c.closed else None for c in curves]
    for k, outer in enumerate(regions):
        if outer is None or not outer.is_valid:
            continue
        for curve in curves[k + 1 :]:
            inner = shapely.LineString(curve.flattened(0.01))
            assert not outer.contains_properly(inner)


@pytest.mark.parametrize(
    "given",
    [
        {"cut": "skeleton"},
        {"cut": "skeleton", "clip": True, "border": True},
        {"cut": "skeleton", "bed": (70.0, 70.0)},
        {"cut": "pieces", "kerf": 0.2, "strokes": "hatch"},
        {"cut": "jigsaw", "margin": 5.0, "tray": 12.0},
        {"purpose": "plotter", "strokes": "echoes"},
        {"cut": "template"},
    ],
)
def test_every_cut_goes_inside_out_and_loses_no_line(given: dict[str, Any], monkeypatch) -> None:
    chosen = ExportSettings(
        **{"purpose": "laser", "area": (110.0, 95.0), "tile_size": 40.0, "eyes": (EYE,), **given}
    )
    tile = squirrel("IH4")
    written, _ = scenes(tile, chosen)
    monkeypatch.setattr(exporting, "in_cutting_order", lambda scene: scene)
    made, _ = scenes(tile, chosen)
    for before, after in zip(made, written, strict=True):
        for old, new in zip(before.layers, after.layers, strict=True):
            lines = list(after.curves(new))
            assert Counter(map(key, before.curves(old))) == Counter(map(key, lines))
            assert_inside_out(lines)
        assert travel(after) <= travel(before) + 1e-9


def travel(scene: Scene) -> float:
    """How far in mm the head goes between the lines of all layers."""
    found, place = 0.0, np.zeros(2)
    for layer in scene.layers:
        for curve in scene.curves(layer):
            found += float(np.hypot(*(curve.start - place)))
            place = curve.end
    return found


def test_a_filled_part_keeps_its_holes() -> None:
    rings = [
        Curve.polyline(
            np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * side + 5 - side / 2, closed=True
        )
        for side in (8.0, 4.0)
    ]
    hole = rings[1].reversed()
    part = PathPart((rings[0], hole), Style("#000000"))
    lone = PathPart(
        (Curve.polyline([[0.6, 0], [0.7, 0]]), Curve.polyline([[0, 0], [0.5, 0]])),
        Style(None, "#0000ff", 0.1),
    )
    layer = Layer("engrave", "drawing", Style(None, "#0000ff", 0.1), (part, lone))
    (done,) = in_cutting_order(Scene(10.0, 10.0, (layer,))).layers
    kinds = [type(item) for item in done.items]
    assert kinds == [Curve, Curve, PathPart]
    assert np.array_equal(done.items[0].start, [0, 0])  # type: ignore[union-attr]
    assert len(done.items[2].curves) == 2  # type: ignore[union-attr]


def test_whole_tiles_on_every_sheet() -> None:
    tile = tile_of("IH7")
    page = ExportSettings(purpose="laser", area=(300.0, 200.0), tile_size=40.0)
    (whole,), _ = scenes(tile, page)
    sheets, _ = scenes(tile, page.replace(bed=(100.0, 100.0)))
    assert len(sheets) > 1
    assert sum(len(sheet.tiles) for sheet in sheets) == len(whole.tiles)
    counts = [len(sheet.tiles) for sheet in sheets]
    assert len(set(counts[:-1])) == 1
    for sheet in sheets:
        assert (sheet.width, sheet.height) == (100.0, 100.0)
        assert all(own.whole for own in sheet.tiles)


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


@settings(max_examples=12, deadline=None)
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
