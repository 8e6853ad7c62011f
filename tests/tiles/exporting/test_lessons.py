"""A lesson: what is cut off a plain shape makes the tile."""

import pytest
import shapely

from exported import scenes, tile_of
from orbiflow.tiles import CLASSES, ExportSettings
from orbiflow.tiles.make.layout import layout
from orbiflow.tiles.make.lessons import Lesson
from orbiflow.tiles.result_file import as_tile


@pytest.mark.parametrize("name", list(CLASSES))
def test_moves_take_off_as_much_as_they_put_on_and_end_with_the_tile(name: str) -> None:
    settings = ExportSettings(purpose="lesson")
    (scene,), _ = scenes(tile_of(name), settings)
    placed = layout(as_tile(tile_of(name)), settings)
    lines = tuple(curve.flattened(0.01) for curve in placed.outline.curves)
    assert placed.outline.edges is not None
    lesson = Lesson(placed.outline.edges, lines)
    tile = shapely.Polygon(placed.prototiles[0])
    assert lesson.shape.area == pytest.approx(tile.area, rel=1e-3)
    made = lesson.shape
    for pair in lesson.moves:
        cut, landing = lesson.parts(pair)
        assert cut.area == pytest.approx(landing.area, rel=1e-2)
        made = (made - cut) | landing
    assert (made ^ tile).area < 0.02 * tile.area
    assert {layer.name for layer in scene.layers} >= {"shape", "steps", "words"}
