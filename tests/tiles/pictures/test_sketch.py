"""Sketches draw shapes where they are, whatever the bands, and its PNGs keep their colours."""

import io
import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from orbiflow.arrays import Array
from orbiflow.drawing import Sheet, palette_png
from orbiflow.drawing import raster as module
from orbiflow.tiles.pictures import Sketch
from orbiflow.tiles.pictures.sketch import dashes
from refusals import refused

RED, BLUE = "#c03020", "#204080"
WINDOW = (-2.0, -1.0, 2.0, 1.0)


def pixels(data: bytes) -> Array:
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)


def share(image: Array, colour: tuple[int, int, int]) -> float:
    return float((np.abs(image - colour).max(axis=-1) <= 2).mean())


@given(st.floats(-1, 0.5), st.floats(-0.8, 0.2), st.floats(0.3, 1.2), st.floats(0.2, 0.7))
def test_a_box_covers_its_pixels(x: float, y: float, wide: float, high: float) -> None:
    sketch = Sketch(WINDOW, Sheet.screen(200))
    sketch.fill(shapely.box(x, y, x + wide, y + high), RED)
    dark = 1 - np.asarray(sketch.picture().image(200)).astype(float)[..., 1] / 255
    covered = dark.sum() / (1 - 0x30 / 255) / 50**2
    # a line of fine pixels around it counts
    assert covered == pytest.approx(wide * high, abs=(wide + high) / 50 + 1e-3)


def test_bands_make_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    def drawn() -> Array:
        sketch = Sketch(WINDOW, Sheet.screen(150), strip=20 / 150)
        turn = np.linspace(0, 2 * np.pi, 50)
        ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        sketch.fill(ring, BLUE)
        sketch.line(ring * 0.8, RED, sketch.width / 30, closed=True)
        return np.asarray(sketch.picture().image(150)).astype(int)

    whole = drawn()
    monkeypatch.setattr(module, "MAX_FINE_PIXELS", 150 * 9 * 7)
    # lines end on whole fine pixels, of which there are nine in one
    assert np.abs(drawn() - whole).max() < 80
    assert (drawn() != whole).mean() < 0.01


def test_holes_show_what_is_below() -> None:
    sketch = Sketch(WINDOW, Sheet.screen(200))
    sketch.fill(np.array([[-2.0, -1.0], [2.0, -1.0], [2.0, 1.0], [-2.0, 1.0]]), BLUE)
    ring = shapely.Point(0, 0).buffer(0.8).difference(shapely.Point(0, 0).buffer(0.4))
    sketch.fill(shapely.GeometryCollection([ring, shapely.Point(1, 1)]), RED)
    image = np.asarray(sketch.picture().image(200))
    assert tuple(image[50, 100]) == (0x20, 0x40, 0x80)
    assert tuple(image[50, 100 + 30]) == (0xC0, 0x30, 0x20)


def test_y_goes_up_or_down() -> None:
    for y_down, row in ((False, 10), (True, 90)):
        sketch = Sketch(WINDOW, Sheet.screen(200), y_down=y_down)
        sketch.fill(np.array([[-2, 0.5], [2, 0.5], [2, 1.0], [-2, 1.0]]), RED)
        assert tuple(np.asarray(sketch.picture().image(200))[row, 100]) == (0xC0, 0x30, 0x20)


@given(st.lists(st.from_regex("#[0-9a-f]{6}", fullmatch=True), min_size=1, max_size=24))
def test_a_palette_keeps_the_colours_that_were_used(colours: list[str]) -> None:
    values = [[module.rgb(colour)] * 8 for colour in colours]
    picture = Image.fromarray(np.array(values, dtype=np.uint8))
    assert np.abs(pixels(palette_png(picture, colours)) - np.array(values)).max() <= 8


def test_sizes_that_cannot_be_made() -> None:
    with refused("300 by 0 pixels"):
        Sketch((0.0, 0.0, 1.0, 1e-3), Sheet.screen(300)).picture().png()


@given(st.floats(0.01, 3), st.floats(0.01, 2))
def test_dashes_lie_on_their_line(on: float, off: float) -> None:
    path = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]])
    pieces = dashes(path, on, off)
    line = shapely.LineString(path)
    total = sum(shapely.LineString(piece).length for piece in pieces)
    assert all(shapely.distance(line, shapely.points(piece)).max() < 1e-9 for piece in pieces)
    assert len(pieces) == math.ceil(7 / (on + off) - 1e-9)
    assert total == pytest.approx(
        sum(min(on, 7 - start) for start in np.arange(0, 7, on + off)), abs=1e-6
    )
