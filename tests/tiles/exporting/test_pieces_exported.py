"""Pieces and jigsaws measured in the files: width, distance, number, crumbs and the tray."""

from functools import cache
from typing import Literal

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import pdist
from shapely.affinity import translate

from artworks import squirrel
from exported import dxf_lines, polygons, scenes, sheet_content, svg_lines, tile_of, tiles
from orbiflow.tiles import ExportSettings, Scene, Tile, as_tile, polygons_in
from orbiflow.tiles.make import cut_ring
from orbiflow.tiles.make.jigsaws import LEAST_SHARE
from orbiflow.tiles.make.layout import layout
from orbiflow.tiles.make.nesting import Nesting, on_sheet
from orbiflow.tiles.make.offsets import offset_ring
from refusals import refused


def cut(tile: Tile, **options) -> list[list[shapely.Polygon]]:
    """The regions that the cuts bound, sheet by sheet."""
    chosen = ExportSettings(cut="pieces", **options)
    found = []
    for scene in scenes(tile, chosen)[0]:
        text = sheet_content(scene, chosen)
        assert "<use" not in text
        lines = dxf_lines(text)[1] if chosen.format == "dxf" else svg_lines(text)
        found.append(polygons([line for line in lines if line.layer == "cut"]))
    return found


@settings(max_examples=4, deadline=None)
@given(
    tiles,
    st.sampled_from([0.0, 0.15, 0.4]),
    st.sampled_from([0.0, 0.1, 0.3]),
    st.sampled_from(["svg", "dxf"]),
)
def test_what_the_beam_leaves_is_the_piece(tile, kerf, clearance, form) -> None:
    options = {"tile_size": 50.0, "area": (120.0, 80.0), "spacing": 0.5}
    (sheet,) = cut(tile, kerf=kerf, clearance=clearance, format=form, **options)
    chosen = ExportSettings(cut="pieces", **options)
    wanted = shapely.Polygon(layout(as_tile(tile), chosen).page.ring)
    wanted = wanted.buffer(-clearance / 2) if clearance else wanted
    for polygon in sheet:
        left = polygon.buffer(-kerf / 2, quad_segs=32)  # the beam is round
        assert left.geom_type == "Polygon"
        # rounding of inner corners apart, the tolerance all around
        slack = chosen.deviation * wanted.length
        assert abs(left.area - wanted.area) < slack
        assert left.length == pytest.approx(wanted.length, rel=0.03)
        assert diameter(left) == pytest.approx(diameter(wanted), abs=2.1 * chosen.deviation)


def diameter(polygon: shapely.Polygon) -> float:
    """Largest distance of two of its points: no turn changes it."""
    return float(pdist(shapely.get_coordinates(polygon.convex_hull)).max())


@pytest.mark.parametrize(("name", "spacing"), [("IH1", 0.0), ("IH5", 2.5), ("IH21", 0.0)])
def test_pieces_keep_their_distance_and_the_page(name: str, spacing: float) -> None:
    (sheet,) = cut(tile_of(name), spacing=spacing, area=(220.0, 160.0), kerf=0.1)
    page = shapely.box(0, 0, 220, 160)
    assert all(polygon.within(page) for polygon in sheet)
    tree = shapely.STRtree(sheet)
    first, second = tree.query(sheet, predicate="dwithin", distance=max(0.99 * spacing, 1e-4))
    assert (first == second).all()
    # dense: most of the page is pieces
    assert shapely.area(sheet).sum() > (0.6 if spacing == 0 else 0.5) * page.area


@pytest.mark.parametrize("count", [1, 7, 23])
def test_as_many_as_asked_for_on_as_few_sheets_as_it_takes(count: int) -> None:
    tile = tile_of("IH6")
    sheets = cut(tile, copies=count, bed=(110.0, 90.0))
    assert sum(len(sheet) for sheet in sheets) == count
    full = len(sheets[0])
    assert all(len(sheet) == full for sheet in sheets[:-1])
    assert len(sheets) == -(-count // full)


def test_too_many_for_the_page() -> None:
    tile = tile_of("IH6")
    (sheet,) = cut(tile, area=(110.0, 90.0))
    fit = len(sheet)
    with refused(2 * fit + 1, f"{fit} pieces", "110 x 90 mm"):
        cut(tile, copies=2 * fit + 1, area=(110.0, 90.0))


def test_a_single_piece_goes_in_whichever_way_it_fits() -> None:
    bar = np.array([[0, 0], [10, 0], [10, 1], [0, 1.0]])
    tile = Tile(bar, tile_of("IH1").group)
    chosen = ExportSettings(cut="pieces", tile_size=100)
    line = layout(as_tile(Tile(bar, tile.group)), chosen).page.ring
    one = Nesting(300 * np.eye(2), np.eye(2)[None], np.zeros((1, 2)))
    assert len(on_sheet([one], line, 12, 101)) == 1
    assert len(on_sheet([one], line, 79, 79)) == 1  # along the diagonal
    assert len(on_sheet([one], line, 70, 70)) == 0


def test_a_sheet_smaller_than_a_piece() -> None:
    with refused("30 x 30 mm", "27.9 mm"):
        cut(tile_of("IH4"), area=(30.0, 30.0))


HALF = [[0, 0], [4, 0], [4, 1.8], [6, 1.8], [6, 0], [10, 0]]
DUMBBELL = np.array([*HALF, *([x, 4.0 - y] for x, y in reversed(HALF))])


def test_a_kerf_wider_than_a_neck() -> None:
    with refused("kerf", "0.5 mm", "neck") as e:
        cut_ring(DUMBBELL, 0.5, 0.0)
    assert "0.40 mm wide 4.0 mm from its left and 2.0 mm from its top" in str(e.value)
    assert cut_ring(DUMBBELL, 0.3, 0.0) is not None
    with refused("clearance", "0.6 mm", "neck"):
        cut_ring(DUMBBELL, 0.0, 0.6)


def test_a_kerf_wider_than_a_slit() -> None:
    slit = np.array([[0, 0], [10, 0], [10, 2.9], [3, 2.9], [3, 3.1], [10, 3.1], [10, 6], [0, 6.0]])
    with refused("kerf", "slit", "0.20 mm"):
        cut_ring(slit, 0.25, 0.0)
    assert shapely.Polygon(cut_ring(slit, 0.15, 0.0)).is_valid


def test_a_fit_test_cuts_two_neighbours_five_times() -> None:
    tile = tile_of("IH5")
    chosen = ExportSettings(cut="pieces", tile_size=50, kerf=0.2, clearance=0.2, fit_test=True)
    ((scene,), notes) = scenes(tile, chosen)
    assert any("clearances of 0.1, 0.15, 0.2, 0.3 and 0.4 mm" in note for note in notes)
    text = sheet_content(scene, chosen)
    lines = svg_lines(text)
    pieces = polygons([line for line in lines if line.layer == "cut"])
    dots = polygons([line for line in lines if line.layer == "score"])
    assert len(pieces) == 10
    assert min(a.distance(b) for k, a in enumerate(pieces) for b in pieces[:k]) > 0.99
    area = shapely.Polygon(layout(as_tile(tile), chosen).page.ring)
    found = sorted((sum(piece.contains(dot) for dot in dots), piece.area) for piece in pieces)
    for (count, left), step in zip(found, np.repeat([0.1, 0.15, 0.2, 0.3, 0.4], 2), strict=True):
        assert 0.1 * [0, 1, 1.5, 2, 3, 4][count] == pytest.approx(step)
        # half the kerf outside, half of the clearance inside
        wanted = area.area + area.length * (0.2 - step) / 2
        assert left == pytest.approx(wanted, abs=chosen.deviation * area.length)
    with refused("120 x 80 mm"):
        scenes(tile, chosen.replace(area=(120.0, 80.0)))


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


@pytest.mark.parametrize(("name", "offset"), [("IH1", 6.0), ("IH5", -1.0)])
def test_pieces_in_the_file(name: str, offset: float) -> None:
    options = {"cut": "pieces", "tile_size": 50, "area": (200, 150), "format": "svg"}
    chosen = ExportSettings(offset=offset, kerf=0.2, copies=2, **options)
    (scene,), _ = scenes(tile_of(name), chosen)
    text = sheet_content(scene, chosen)
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


AREA, MARGIN, SIZE = (150.0, 110.0), 5.0, 35.0
OPTIONS = {"cut": "jigsaw", "area": AREA, "margin": MARGIN, "tile_size": SIZE}


def faces(scene: Scene, form: Literal["svg", "dxf"] = "svg") -> list[shapely.Polygon]:
    """The faces between the lines of the file, as any program would find them."""
    text = sheet_content(scene, ExportSettings(format=form, **OPTIONS))
    found = dxf_lines(text)[1] if form == "dxf" else svg_lines(text)
    lines = [
        shapely.LineString([*line.points, *line.points[: int(line.closed)]])
        for line in found
        if line.layer in ("cut", "border")
    ]
    # svgelements takes an inch for 25.39998 mm
    net = shapely.union_all(lines, grid_size=2e-3)
    return list(shapely.get_parts(shapely.polygonize(shapely.get_parts(net))))


@cache
def jigsaw(name: str) -> tuple[Scene, list[shapely.Polygon]]:
    tile = squirrel(name[:-1]) if name.endswith("*") else as_tile(tile_of(name, turn=1.1))
    (scene,), _ = scenes(tile, ExportSettings(**OPTIONS))
    return scene, faces(scene)


each = pytest.mark.parametrize("name", ["IH2", "IH28", "IH5*"])


@each
def test_the_pieces_are_the_rectangle_and_none_is_a_crumb(name: str) -> None:
    scene, pieces = jigsaw(name)
    assert len(pieces) == scene.facts["pieces"]
    assert sum(piece.area for piece in pieces) == pytest.approx(140 * 100, rel=1e-4)
    assert shapely.union_all(pieces).bounds == pytest.approx((5, 5, 145, 105), abs=5e-3)
    tile = shapely.Polygon(scene.prototiles[0])
    shares = np.array([piece.area / tile.area for piece in pieces])
    assert shares.min() >= LEAST_SHARE - 1e-3
    assert shares.min() == pytest.approx(scene.facts["smallest"], abs=2e-3)
    # whole tiles are images of the tile
    whole = sum(
        shapely.Polygon(scene.prototiles[0] @ placed.linear.T + placed.offset)
        .symmetric_difference(min(pieces, key=lambda p, at=placed: apart(p, scene, at)))
        .area
        < 0.006 * tile.area
        for placed in scene.tiles
    )
    assert whole == scene.facts["whole_tiles"] > 0


def apart(piece: shapely.Polygon, scene: Scene, placed) -> float:
    assert scene.prototiles
    centre = shapely.Polygon(scene.prototiles[0]).centroid
    x, y = placed.linear @ [centre.x, centre.y] + placed.offset
    return piece.centroid.distance(shapely.Point(x, y))


@each
def test_no_strip_along_the_border_breaks_off(name: str) -> None:
    _, pieces = jigsaw(name)
    border = shapely.box(5, 5, 145, 105).exterior.buffer(5e-3)
    width = SIZE / 30
    for piece in pieces:
        core = piece.buffer(-width / 2).buffer(1.01 * width / 2, quad_segs=16)
        for strip in polygons_in(piece.difference(core)):
            assert strip.exterior.intersection(border).length < 4 * width


def test_the_pieces_lie_in_the_tray() -> None:
    chosen = ExportSettings(tray=12.0, clearance=0.4, **OPTIONS)
    (puzzle, frame, base), notes = scenes(tile_of("IH4", turn=1.1), chosen)
    assert f"{puzzle.facts['pieces']} pieces" in notes[-1]
    assert "the tray's two sheets are 174.8 x 134.8 mm" in notes[-1]
    opening, wood = sorted(faces(frame), key=lambda face: len(face.interiors))
    (plate,) = faces(base)
    assert (frame.width, frame.height) == pytest.approx((140.8 + 34, 100.8 + 34))
    assert opening.bounds == pytest.approx((17, 17, 157.8, 117.8), abs=5e-3)
    assert wood.area == pytest.approx(164.8 * 124.8 - 140.8 * 100.8, rel=1e-4)
    assert plate.area == pytest.approx(164.8 * 124.8, rel=1e-4)
    # laid in: none on the wood, a gap of .4 mm all around, none on another
    laid = [translate(piece, 12.4, 12.4) for piece in faces(puzzle)]
    assert all(piece.within(opening) for piece in laid)
    assert shapely.union_all(laid).distance(wood) == pytest.approx(0.4, abs=5e-3)
    assert sum(piece.area for piece in laid) == pytest.approx(
        shapely.union_all(laid).area, rel=1e-4
    )


def test_a_rectangle_that_is_one_piece() -> None:
    with refused("jigsaw", "area"):
        scenes(tile_of("IH4"), ExportSettings(cut="jigsaw", area=(41.0, 41.0), tile_size=40.0))
