"""Tilings measured in the files: areas, edges, sizes, layers, and the ground below them."""

import io
import math
import re
import xml.etree.ElementTree as ET
from typing import Any, Literal

import numpy as np
import pypdfium2
import pytest
import resvg_py
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from exported import dxf_lines, polygons, scenes, sheet_content, svg_lines, tile_of, tiles
from orbiflow.tiles import CLASSES, EscherTile, ExportSettings, Tile, colouring
from orbiflow.tiles.page import longer_side, smallest_rectangle
from orbiflow.tiles.write import write_scene

INKSCAPE = "{http://www.inkscape.org/namespaces/inkscape}"
SVG = "{http://www.w3.org/2000/svg}"


def text_of(tile: Tile | EscherTile, **options) -> str:
    chosen = ExportSettings(**options)
    found, _ = scenes(tile, chosen)
    return sheet_content(found[0], chosen)


@settings(max_examples=7, deadline=None)
@given(tiles, st.floats(25, 60), st.booleans(), st.just(0.0) | st.floats(-180, 180))
def test_tiles_cover_the_page_once(tile: Tile, size: float, dxf: bool, angle: float) -> None:
    options = {"tile_size": size, "area": (120.0, 90.0), "clip": True, "rotate": angle}
    page = shapely.box(0, 0, 120, 90)
    tolerance = ExportSettings(tile_size=size).deviation
    if dxf:
        _, lines = dxf_lines(text_of(tile, format="dxf", **options))
    else:
        lines = [line for line in svg_lines(text_of(tile, **options)) if line.layer != "paper"]
    found = polygons(lines)
    if dxf:  # cut at the page's edge
        assert shapely.union_all(found).within(page.buffer(1e-6))
    pieces = shapely.intersection(found, page)
    edge = sum(polygon.length for polygon in found)
    assert shapely.area(pieces).sum() == pytest.approx(page.area, rel=1e-3)
    # overlaps and gaps are slivers no wider than the rounding of the numbers written
    missing = page.area - shapely.union_all(pieces, grid_size=1e-6).area
    width = tolerance / 2 if dxf else 2e-3
    assert abs(missing) <= edge * width
    assert shapely.area(pieces).sum() - (page.area - missing) <= edge * width


@pytest.mark.parametrize("cut", ["none", "skeleton"])
def test_a_tiling_is_turned_counterclockwise_on_the_page(cut: Literal["none", "skeleton"]) -> None:
    (straight,), _ = scenes(tile_of("IH4"), ExportSettings(cut=cut))
    (turned,), _ = scenes(tile_of("IH4"), ExportSettings(cut=cut, rotate=30))
    assert straight.prototiles
    assert turned.prototiles
    step, other = (ring[1] - ring[0] for ring in (straight.prototiles[0], turned.prototiles[0]))
    # y points down: what points right turns up
    before, after = complex(step[0], -step[1]), complex(other[0], -other[1])
    assert after == pytest.approx(before * np.exp(1j * np.radians(30)))
    first, second = (
        {tuple(tile.linear.round(9).ravel()) for tile in scene.tiles}
        for scene in (straight, turned)
    )
    assert first == second  # half turns stay half turns


@pytest.mark.parametrize("name", CLASSES)
def test_sizes_are_what_was_asked_for(name: str) -> None:
    text = text_of(tile_of(name), tile_size=37.0, area=(210.0, 148.5))
    root = ET.fromstring(text)
    assert (root.get("width"), root.get("height")) == ("210mm", "148.5mm")
    assert root.get("viewBox") == "0 0 210 148.5"
    for line in svg_lines(text):
        if line.layer != "paper":
            assert longer_side(line.points) == pytest.approx(37, abs=0.11)
            assert (line.points >= 0).all()
            assert (line.points <= (210, 148.5)).all()


def test_one_symbol_and_a_short_line_a_tile_in_layers() -> None:
    tile = tile_of("IH6")
    text = text_of(tile, area=(400.0, 300.0), tile_size=20.0)
    root = ET.fromstring(text)
    uses = re.findall(r"\n    <use [^\n]*/>", text)
    assert len(uses) > 200
    assert max(map(len, uses)) < 120
    assert len(list(root.iter(f"{SVG}path"))) == 2  # the paper and the symbol
    layers = [g for g in root.iter(f"{SVG}g") if g.get(f"{INKSCAPE}groupmode") == "layer"]
    names = [layer.get(f"{INKSCAPE}label") for layer in layers]
    assert names == ["paper", *(f"colour {k + 1}" for k in range(colouring(tile).count))]
    assert "C" in next(root.iter(f"{SVG}path")).attrib["d"]


def test_decimals_follow_the_tolerance() -> None:
    tile = tile_of("IH7")
    coarse, fine = (text_of(tile, tolerance=t) for t in (0.5, 0.0005))
    assert re.search(r"\d\.\d{5}", fine.split("<use")[0])
    assert not re.search(r"\d\.\d{4}", coarse.split("<use")[0])
    assert math.log10(len(fine)) > math.log10(len(coarse))


def test_what_the_user_should_know_is_noted() -> None:
    tile = tile_of("IH4")
    few = ExportSettings(tile_size=20, area=(100, 80), palette="ff0000")
    assert "the palette has 1" in scenes(tile, few)[1][-1]
    assert scenes(tile, ExportSettings(tile_size=20, area=(100, 80)))[1] == ()
    thin = ExportSettings(purpose="laser", tile_size=20, area=(100, 80))
    assert "0.01 mm hardly show" in scenes(tile, thin)[1][-1]


PALETTE = "202020,203040,402020,404040,paper=ffffff"  # nothing but paper is lighter than 40


def drawn(content: Any, form: str, dpi: int) -> np.ndarray:
    if form == "pdf":
        image = pypdfium2.PdfDocument(content)[0].render(scale=dpi // 72 + 1).to_pil()
    else:
        image = Image.open(io.BytesIO(bytes(resvg_py.svg_to_bytes(svg_string=content, dpi=dpi))))
    return np.asarray(image.convert("RGB")).max(axis=2)


@pytest.mark.parametrize("clip", [True, False])
@pytest.mark.parametrize("form", ["svg", "pdf"])
def test_no_pixel_among_tiles_shows_paper(bent_tile: Any, form: Any, clip: bool) -> None:
    settings = ExportSettings(
        format=form, outline=0.0, clip=clip, area=(60, 60), tile_size=12, palette=PALETTE
    )
    (scene,), _ = scenes(EscherTile(bent_tile("IH4")), settings)
    for dpi in (50, 96, 170):
        pixels = drawn(write_scene(scene, form), form, dpi)
        size = len(pixels)
        middle = pixels[size * 2 // 5 : size * 3 // 5, size * 2 // 5 : size * 3 // 5]
        assert middle.max() < 0x40 + 0.05 * (0xFF - 0x40)
        # and where no tile is, there is the paper alone
        assert (pixels.max() == 255) == (not clip)


@pytest.mark.parametrize("more", [{"purpose": "laser"}, {"cut": "pieces"}, {"cut": "jigsaw"}])
def test_cutters_get_no_ground(bent_tile: Any, more: dict[str, Any]) -> None:
    made, _ = scenes(EscherTile(bent_tile("IH4")), ExportSettings(outline=0.01, **more))
    assert {layer.role for scene in made for layer in scene.layers}.isdisjoint({"paper"})


@pytest.mark.parametrize("cut", [{}, {"clip": True}])
def test_a_drawing_of_lines_has_no_ground(bent_tile: Any, cut: dict[str, Any]) -> None:
    (scene,), _ = scenes(EscherTile(bent_tile("IH4")), ExportSettings(outline=0.0, **cut))
    text = str(write_scene(scene, "dxf"))
    assert "colour 1" in text
    assert "ground" not in text


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([3, 5, 40, 400]))
def test_a_tile_is_measured_by_the_smallest_rectangle(seed: int, count: int) -> None:
    random = np.random.default_rng(seed)
    ring = random.normal(size=(count, 2)) @ random.normal(size=(2, 2))
    box, points = shapely.Polygon(smallest_rectangle(ring)), shapely.MultiPoint(ring)
    assert box.buffer(1e-9 * np.ptp(ring)).contains(points)
    assert box.area == pytest.approx(shapely.minimum_rotated_rectangle(points).area, rel=1e-6)
