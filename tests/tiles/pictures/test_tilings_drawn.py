"""Pictures of tilings with symmetric tiles and several prototiles; the example and its page."""

import io
import re
import runpy
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from orbiflow.drawing import PALETTES, Sheet, rgb
from orbiflow.symmetry import rotation_matrix, wallpaper_group
from orbiflow.tiles import (
    Page,
    Tile,
    colouring,
    copies_meeting,
    tile_picture,
    tiling_picture,
    tilings_png,
)
from refusals import refused
from some_tilings import NAMED

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
    page = Page.of_window(tiling, window, 100.0, y_down=y_down, known=known)
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
