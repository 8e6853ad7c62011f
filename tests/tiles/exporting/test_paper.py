"""What is made for paper: margins that stay empty, pages to colour."""

import numpy as np
import pytest
import shapely

from artworks import squirrel
from exported import Line, polygons, svg_lines, tile_of
from orbiflow.errors import SettingError
from orbiflow.tiles import EscherTile, ExportSettings, Scene, as_tile, scenes, sheet_content
from orbiflow.tiles.make.layout import layout
from orbiflow.tiles.make.templates import numbered_edges
from orbiflow.tiles.page import mark_corners
from refusals import refused


def drawn(tile: str | EscherTile, **options) -> tuple[Scene, list[Line]]:
    chosen = ExportSettings(format="svg", **options)
    (scene,), _ = scenes(tile_of(tile) if isinstance(tile, str) else tile, chosen)
    text = sheet_content(scene, chosen)
    assert isinstance(text, str)
    return scene, svg_lines(text)


@pytest.mark.parametrize(
    "options",
    [
        {"cut": "none"},
        {"cut": "skeleton", "clip": True, "border": True},
        {"cut": "skeleton", "calibrate": True},
        {"cut": "pieces"},
    ],
    ids=str,
)
def test_the_margin_stays_empty(options) -> None:
    scene, lines = drawn("IH5", area=(130, 110), margin=13, tile_size=30, **options)
    foot = 8 if "calibrate" in options else 0  # the mark's own strip
    inner = [line.points for line in lines if not line.layer.startswith("calibration")]
    points = np.concatenate(inner)
    assert (points >= 13 - 1e-3).all()
    assert (points <= np.array([117, 97 - foot]) + 1e-3).all()
    assert len(scene.tiles) >= 4


def test_tiles_that_only_the_margin_keeps_from_fitting() -> None:
    with refused("60 x 50 mm", "10 mm"):
        drawn("IH5", area=(60, 50), margin=10)


def test_a_page_to_colour_is_lines_within_a_border() -> None:
    scene, lines = drawn("IH4", purpose="colouring")
    assert (scene.width, scene.height) == (210, 297)
    styles = [layer.style for layer in scene.layers]
    assert all(style == (None, "#000000", 0.8) for style in styles)
    (border,) = [line for line in lines if line.layer == "border"]
    np.testing.assert_allclose(np.ptp(border.points, axis=0), (190, 277), atol=1e-3)


@pytest.mark.parametrize("name", ["IH1", "IH4", "IH5", "IH21"])
def test_a_template_says_which_edges_fit_together(name: str) -> None:
    scene, lines = drawn(squirrel(name), purpose="template", tolerance=0.3)
    layers = {layer.name: layer for layer in scene.layers}
    assert list(layers) == ["silhouette", "outline", "numbers"]
    (outline,) = polygons([line for line in lines if line.layer == "outline"])
    # as large as the page allows, and everything on it
    low, high = np.reshape(outline.bounds, (2, 2))
    assert min(abs(np.array([172, 259]) - (high - low))) < 0.2
    points = np.concatenate([line.points for line in lines if line.layer != "silhouette"])
    assert (points > 10).all()
    assert (points < (200, 287)).all()
    # an arrow's tip on the outline for each edge or half of one, in pairs
    marks = [line.points for line in lines if line.layer == "numbers"]
    tips = [mark[1] for mark in marks if is_arrow(mark)]
    assert len(tips) % 2 == 0
    assert len(tips) >= 6
    apart = shapely.distance(shapely.points(tips), outline.exterior)
    assert apart.max() < 0.15


def is_arrow(points: np.ndarray) -> bool:
    """Whether a line is two sides of the same length; the 1 has unequal ones."""
    sides = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return len(sides) == 2 and abs(sides[0] - sides[1]) < 0.01


def test_partners_are_images_of_each_other() -> None:
    """What carries an edge onto its partner carries its arrow, and the number stands at both."""
    placed = layout(as_tile(tile_of("IH5")), ExportSettings(purpose="template"))
    edges = list(numbered_edges(placed))
    assert [number for number, _ in edges[::2]] == [number for number, _ in edges[1::2]]
    for (_, first), (_, second) in zip(edges[::2], edges[1::2], strict=True):
        # the isometry nearest to the one that takes first onto second, start to start
        moved, there = (evenly(points) - evenly(points).mean(axis=0) for points in (first, second))
        left, _, right = np.linalg.svd(moved.T @ there)
        assert np.abs(moved @ left @ right - there).max() < 0.2
        turned = moved[::-1] @ left @ right
        assert np.abs(turned - there).max() > 5  # and not the other way round


def evenly(points: np.ndarray) -> np.ndarray:
    line, shares = shapely.LineString(points), np.linspace(0, 1, 33)
    return shapely.get_coordinates(shapely.line_interpolate_point(line, shares, normalized=True))


@pytest.mark.parametrize("offset", [2.0, -1.0])
def test_a_sheet_of_stickers(offset: float) -> None:
    options = {"tile_size": 50.0, "spacing": 1.0, "offset": offset}
    scene, lines = drawn("IH5", purpose="stickers", **options)
    cuts = polygons([line for line in lines if line.layer == "cut"])
    coloured = polygons([line for line in lines if line.layer.startswith("colour")])
    assert len(cuts) == len(coloured) == len(scene.tiles) > 5
    tree = shapely.STRtree(cuts)
    for tile in coloured:
        (cut,) = [cuts[k] for k in tree.query(tile.representative_point(), "within")]
        outer, inner = (cut, tile) if offset > 0 else (tile, cut)
        assert outer.buffer(0.1).contains(inner)
        assert inner.exterior.hausdorff_distance(outer.exterior) > abs(offset) - 0.2
    # colours do not run into other stickers, and nothing lies on the marks
    both = [*cuts, *coloured]
    own = shapely.STRtree(coloured)
    first, second = own.query(coloured, "dwithin", 0.5)
    assert (first == second).all()
    for box in mark_corners((210, 297)):
        assert not shapely.intersects(shapely.box(*box), cuts).any()
    assert (np.reshape([shape.bounds for shape in both], (-1, 2)) > 8).all()
    marks = [line for line in lines if line.layer.startswith("registration")]
    assert len(marks) == 3
    with refused("marks", "margin", "0 mm", kind=SettingError):
        ExportSettings(cut="pieces", marks=True)
