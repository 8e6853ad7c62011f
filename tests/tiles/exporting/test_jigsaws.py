"""Jigsaws measured in the files: faces between the lines, crumbs, thin strips, and the tray."""

from functools import cache
from typing import Literal

import numpy as np
import pytest
import shapely
from shapely.affinity import translate

from artworks import squirrel
from exported import dxf_lines, svg_lines, tile_of
from orbiflow.errors import SettingError
from orbiflow.tiles import ExportSettings, Scene, as_tile, polygons_in, scenes, sheet_content
from orbiflow.tiles.make.jigsaws import LEAST_SHARE
from refusals import refused

AREA, MARGIN, SIZE = (150.0, 110.0), 5.0, 35.0
OPTIONS = {"cut": "jigsaw", "area": AREA, "margin": MARGIN, "tile_size": SIZE}


def faces(scene: Scene, form: Literal["svg", "dxf"] = "svg") -> list[shapely.Polygon]:
    """The faces between the lines of the file, as any program would find them."""
    text = sheet_content(scene, ExportSettings(format=form, **OPTIONS))
    assert isinstance(text, str)
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


each = pytest.mark.parametrize("name", ["IH2", "IH6", "IH28", "IH5*"])


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


@pytest.mark.parametrize(
    ("options", "name"),
    [
        ({"cut": "pieces", "tray": 10.0}, "tray"),
        ({"bed": (100.0, 80.0)}, "bed"),
        ({"kerf": 0.1}, "kerf"),
        ({"clip": True}, "clip"),
    ],
)
def test_options_that_do_not_go_together(options, name: str) -> None:
    with refused(name, kind=SettingError):
        ExportSettings(**{**OPTIONS, **options})


def test_a_rectangle_that_is_one_piece() -> None:
    with refused("jigsaw", "area"):
        scenes(tile_of("IH4"), ExportSettings(cut="jigsaw", area=(41.0, 41.0), tile_size=40.0))
