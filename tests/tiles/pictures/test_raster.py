"""Pictures of tiles: their size, what they show, sketches, and tilings of several prototiles."""

import io
import math
import re
import runpy
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely
import torch
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from orbiflow.arrays import Array
from orbiflow.drawing import PALETTES, Sheet, field_picture, palette, palette_png, rgb
from orbiflow.drawing import raster as module
from orbiflow.symmetry import rotation_matrix, wallpaper_group
from orbiflow.tiles import (
    Page,
    Tile,
    classes_png,
    colouring,
    copies_meeting,
    isohedral_class,
    overlay_picture,
    tile_picture,
    tiling_picture,
    tilings_png,
)
from orbiflow.tiles.pictures import Sketch
from orbiflow.tiles.pictures.overlays import ADDED, COMMON, MISSING
from orbiflow.tiles.pictures.sketch import dashes
from refusals import refused
from some_tilings import NAMED


def pixels(data: bytes) -> Array:
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))


def share(image: Array, colour: str) -> float:
    rgb = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    return float((np.abs(image.astype(int) - rgb).max(axis=-1) <= 2).mean())


@pytest.mark.parametrize("outline", [0.8, 0.0])
def test_tiling_fills_the_picture_with_its_colours(bent_tile: Any, outline: float) -> None:
    image = pixels(tiling_picture(bent_tile("IH7"), outline=outline / 216).png(600))
    assert image.shape == (400, 600, 3)
    chosen = palette("delft")
    shares = [share(image, chosen.fill(k)) for k in range(3)]
    assert all(0.2 < value < 0.45 for value in shares)
    assert share(image, chosen.paper) < 1e-3  # no seams
    assert sum(shares) > (0.9 if outline else 0.96)


def square(side: float, offset: float = 0.0) -> Array:
    return offset + side * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def test_overlay_shows_missing_and_added_in_proportion() -> None:
    tile = Tile(square(1.0), isohedral_class("IH1").group(), "IH1")
    image = pixels(overlay_picture(tile, square(1.0) + np.array([0.25, 0.0])).png(800))
    common, missing, added = (share(image, colour) for colour in (COMMON, MISSING, ADDED))
    assert common / missing == pytest.approx(3.0, rel=0.05)
    assert added == pytest.approx(missing, rel=0.05)
    left = image[:, : image.shape[1] // 3]
    assert share(left[:500], ADDED) > 0.2
    assert share(left[:500], MISSING) == 0.0


def test_overlay_of_awkward_targets() -> None:
    tile = Tile(square(1.0), isohedral_class("IH1").group())
    bow_tie = np.array([[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]])
    assert share(pixels(overlay_picture(tile, bow_tie).png(400)), ADDED) > 0.1
    with refused("target"):
        overlay_picture(tile, np.zeros((5, 2))).png()
    with refused("outline", "(5, 3)"):
        overlay_picture(tile, np.zeros((5, 3))).png()


def test_y_down_turns_the_picture_over(bent_tile: Any) -> None:
    tile = bent_tile("IH5")
    up = pixels(tiling_picture(tile).png(300)).astype(int)
    down = pixels(tiling_picture(tile, y_down=True).png(300)).astype(int)
    assert np.abs(up[::-1] - down).mean() < 4.0
    assert np.abs(up - down).mean() > 10.0


def test_absurd_sizes_are_refused(bent_tile: Any) -> None:
    with refused("1000000 by 666667 pixels"):
        tiling_picture(bent_tile("IH1")).png(10**6)


def test_field_picture(bent_tile: Any, equivariant: Any) -> None:
    tile = bent_tile("IH6")
    field = equivariant(tile.group)
    image = pixels(
        field_picture(lambda p: field(p.numpy()), tile.group, tile, sheet=Sheet.screen(300)).file()
    )
    assert image.shape[1] == 300
    assert image.std() > 20
    still = field_picture(lambda p: torch.zeros_like(p), tile.group, sheet=Sheet.screen(300)).file()
    assert pixels(still).shape[1] == 300


def test_field_picture_has_the_symmetry_of_the_group() -> None:
    """Half a turn about the middle, a 2-fold centre, leaves a p2 picture as it is."""
    group = isohedral_class("IH4").group()
    (center,) = (g(np.zeros(2)) / 2 for g in group.cosets[1:])
    window = (center[0] - 2, center[1] - 2, center[0] + 2, center[1] + 2)

    def odd(points: torch.Tensor) -> torch.Tensor:
        inverse = torch.as_tensor(group.inverse_lattice)
        u = 2 * np.pi * (points - torch.as_tensor(center)) @ inverse.T
        return torch.sin(u + u.flip(-1))

    image = pixels(field_picture(odd, group, window=window, sheet=Sheet.screen(400)).file()).astype(
        int
    )
    assert np.abs(image - image[::-1, ::-1]).mean() < 5.0  # the outlined cell has no such symmetry
    assert np.abs(image - image[::-1]).mean() > 15.0


def test_field_must_return_vectors() -> None:
    group = isohedral_class("IH4").group()
    with refused("field", "(267, 400)"):
        field_picture(lambda p: p[..., 0], group, sheet=Sheet.screen(100)).file()
    with refused("field", "(267, 400, 2)"):
        field_picture(lambda p: p * np.nan, group, sheet=Sheet.screen(100)).file()


def test_nine_classes() -> None:
    image = pixels(classes_png(width_px=600))
    assert image.shape == (492, 600, 3)
    for row in range(3):
        for column in range(3):
            panel = image[row * 157 : row * 157 + 157, column * 200 : column * 200 + 200]
            assert panel.std() > 20


RED, BLUE = "#c03020", "#204080"
WINDOW = (-2.0, -1.0, 2.0, 1.0)


def pixels_of_sketch(data: bytes) -> Array:
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)


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


@given(st.lists(st.from_regex("#[0-9a-f]{6}", fullmatch=True), min_size=1, max_size=24))
def test_a_palette_keeps_the_colours_that_were_used(colours: list[str]) -> None:
    values = [[module.rgb(colour)] * 8 for colour in colours]
    picture = Image.fromarray(np.array(values, dtype=np.uint8))
    assert np.abs(pixels_of_sketch(palette_png(picture, colours)) - np.array(values)).max() <= 8


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


ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("name", NAMED)
def test_each_tile_has_its_colour(name: str) -> None:
    """In the middle of each tile the picture has the colour that the colouring says."""
    tiling = NAMED[name][0]
    window = (-1.3, -1.1, 1.2, 0.9)
    picture = tiling_picture(tiling, window).image(500)
    copies = copies_meeting(tiling, window)
    colours = colouring(tiling).colours(copies)
    seen = 0
    for ring, number in zip(copies.rings(), colours.tolist(), strict=True):
        x, y = (ring.mean(axis=0) - (window[0], window[3])) * (200, -200)
        if 0 <= x < 500 and 0 <= y < picture.height:
            seen += 1
            assert picture.getpixel((int(x), int(y))) == rgb(PALETTES["delft"].fill(number))
    assert seen > 5


@pytest.mark.parametrize("name", NAMED)
@pytest.mark.parametrize("y_down", [False, True])
def test_a_known_colouring_is_the_one_that_is_drawn(name: str, y_down: bool) -> None:
    """Each tile has the colour that the colouring says, although the page has other cosets."""
    tiling = NAMED[name][0].transformed(rotation_matrix(0.7), np.array([1.3, -4.1]))
    known, window = colouring(tiling), (0.3, -5.0, 2.4, -3.1)
    page = Page.of_window(tiling, window, 100.0, y_down=y_down, colouring=known)
    elements = copies_meeting(tiling, window).elements()
    middles = [page.place(e(tiling.prototiles[e.prototile].center)) for e in elements]
    expected = {
        tuple(np.round(m, 3)): known.colour(e) for m, e in zip(middles, elements, strict=True)
    }
    found = zip(np.round(page.copies.centers(), 3).tolist(), page.colours.tolist(), strict=True)
    assert {tuple(middle): colour for middle, colour in found} == expected


def test_in_print_and_as_drawing() -> None:
    tiling = NAMED["hexagons and triangles"][0]
    assert tiling_picture(tiling, sheet=Sheet.column()).file().startswith(b"%PDF")
    window = (-1.03, -1.01, 1.02, 1.04)
    text = tiling_picture(tiling, window).svg()
    paper, *paths = re.findall(r' d="([^"]*)"', text)
    assert len(paper.split(" ")) == 3
    assert len(paths) == len(copies_meeting(tiling, window))
    assert {len(path.split(" ")) for path in paths} == {2, 5}  # triangles and hexagons
    ElementTree.fromstring(text)
    assert "A tiling of the plane (p6m)" in text


def test_a_sheet() -> None:
    shown = {name: tiling for name, (tiling, _) in NAMED.items()}
    picture = Image.open(io.BytesIO(tilings_png(shown, columns=3, width_px=600)))
    assert picture.width == 600
    pixels = np.asarray(picture.convert("RGB")).reshape(-1, 3)
    paper = (pixels == 255).all(axis=1).mean()
    assert 0.2 < paper < 0.8  # five panels of six, names, gaps
    with refused("tilings"):
        tilings_png({})
    with refused("columns", 0):
        tilings_png(shown, columns=0)


def test_the_example(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    out = tmp_path / "tilings.png"
    monkeypatch.setattr(sys, "argv", ["draw.py", "--out", str(out)])
    runpy.run_path(str(ROOT / "examples" / "tilings" / "draw.py"), run_name="__main__")
    assert len(capsys.readouterr().out.splitlines()) == 28
    with Image.open(out) as picture:
        assert picture.width == 1600


@pytest.mark.parametrize(("top", "y_down"), [(1.0, False), (-1.0, True)])
def test_a_tile_is_drawn_upright(top: float, y_down: bool) -> None:
    """A triangle that points up in its own coordinates points up on the page."""
    tile = Tile(np.array([[0.0, 0.0], [2.0, 0.0], [1.0, top]]), wallpaper_group("p1"))
    text = tile_picture(tile, y_down=y_down, title="Cat & <mouse>").svg()
    assert "Cat & <mouse>" in [own.text for own in ElementTree.fromstring(text).iter()]
    numbers = re.findall(r"-?\d+\.?\d*", re.findall(r' d="([^"]*)"', text)[-1])
    path = np.array(numbers, float).reshape(-1, 2)
    assert path[2, 1] < path[0, 1]  # SVG's y points down
    assert path[0, 0] < path[1, 0]  # not mirrored
