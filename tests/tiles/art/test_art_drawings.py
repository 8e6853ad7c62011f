"""Drawings in curves: vector and raster agree, the drawing is there once, paints are kept."""

import base64
import io
import re
from pathlib import Path
from typing import Any

import numpy as np
import pypdfium2
import pytest
import shapely
from PIL import Image

from artworks import EYE, art_settings, copies_of, flat, motif_on, pixels_of, squirrel
from orbiflow.drawing import palette
from orbiflow.errors import InputFileError
from orbiflow.tiles import Made, Over, artwork, read_outline, read_over, write_dxf, write_pdf
from orbiflow.tiles.page import INK, PathPart
from refusals import refused

PAGE = art_settings(area="300x200px", tile_size="130px", outline=0.0)


def svg_of(name: str, body: str, folder: Path) -> Path:
    low, high = squirrel(name).covered[:2]
    left, top, width, height = *low, *(high - low)
    path = folder / "drawing.svg"
    path.write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{left} {top} {width} {height}">{body}</svg>'
    )
    return path


def drawn(name: str, body: str, folder: Path, **options) -> Made:
    tile = squirrel(name)
    over = read_over(svg_of(name, body, folder), tile)
    settings = PAGE.replace(**options)
    return artwork(tile, settings, over)


BODY = f"""
<style>.blue {{ fill: #1030c0 }}</style>
<rect x="0" y="0" width="2000" height="330" class="blue"/>
<g fill="#20a020" opacity="0.5"><circle cx="620" cy="250" r="90"/></g>
<path d="M 300 400 L 500 300 L 640 500 Z M 400 380 L 520 340 L 560 420 Z" fill="#ffcc00"
      fill-rule="evenodd"/>
<circle cx="{EYE[0]}" cy="{EYE[1]}" r="30" fill="none" stroke="red" stroke-width="12"/>
"""


def rgb(colour: str) -> np.ndarray:
    return np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)], dtype=float)


def region(part: PathPart) -> Any:
    """What a filled part covers, by the even-odd rule."""
    found: Any = shapely.Polygon()
    for curve in part.curves:
        ring = shapely.Polygon(curve.pieces[:, 0]).buffer(0)
        found = found.symmetric_difference(ring)
    return found


@pytest.mark.parametrize("strokes", ["hatch", "echoes", "feathers"])
def test_engraving_keeps_to_the_tile_and_off_the_eye(strokes) -> None:
    tile = squirrel("IH6")
    settings = PAGE.replace(strokes=strokes, eyes=(EYE,), tile_size="260px")
    art = artwork(tile, settings)
    parts = motif_on(tile, settings).parts
    ink = parts[0]
    assert ink.style.fill == INK
    assert len(ink.curves) > 15
    inside = shapely.Polygon(tile.tile.polygon).buffer(tile.silhouette_outline.max() * 0.004)
    for curve in ink.curves:
        assert inside.contains(shapely.MultiPoint(curve.pieces[:, 0]))
    middle = tile.forward(np.array(EYE))
    points = np.concatenate([curve.pieces[:, 0] for curve in ink.curves])
    eye = np.concatenate([curve.pieces[:, 0] for curve in parts[1].curves])
    radius = np.hypot(*(eye - middle).T)
    np.testing.assert_allclose(radius, radius[0], rtol=1e-6)  # round
    assert np.hypot(*(points - middle).T).min() > 1.5 * radius[0]
    plain = artwork(tile, PAGE.replace(tile_size="260px"))
    assert (pixels_of(art) != pixels_of(plain)).any()


def test_the_drawing_is_there_once(tmp_path: Path) -> None:
    art = drawn("IH4", BODY, tmp_path, outline="2px")
    text = art.content(format="svg")
    assert isinstance(text, str)
    assert text.count("#ffcc00") == 1
    shown = len(re.findall('href="#motif"', text))
    assert shown == len(copies_of(art)[1]) == len(re.findall('href="#tile" ', text)) / 2
    assert 'opacity="0.5"' in text
    assert 'fill="#ff0000"' in text  # a wide stroke is an area that bends with the tile
    width = 300 * 25.4 / 300
    assert f'width="{width:g}mm"' in text


def test_a_picture_in_an_svg_is_one_image() -> None:
    tile = squirrel("IH4")
    text = artwork(tile, PAGE, Over(flat(tile, "#c02040"))).content(format="svg")
    assert isinstance(text, str)
    (data,) = re.findall('href="data:image/png;base64,([^"]+)"', text)
    image = np.asarray(Image.open(io.BytesIO(base64.b64decode(data))))
    assert (image[image[..., 3] > 0] == (0xC0, 0x20, 0x40, 255)).all()
    assert (image[..., 3] > 0).mean() > 0.4


@pytest.mark.parametrize("name", ["IH4", "IH21"])
def test_other_formats_hold_artwork_unless_it_is_pixels(name: str, tmp_path: Path) -> None:
    art = drawn(name, BODY, tmp_path)
    scene, pixels = art.scenes[0], np.asarray(pixels_of(art), dtype=float)
    shares = [(pixels == colour).all(axis=2).mean() for colour in ((16, 48, 192), (255, 204, 0))]
    assert min(shares) > 0.01
    page = pypdfium2.PdfDocument(write_pdf(scene))[0]
    shown = page.render(scale=art.image().width / page.get_width()).to_pil().convert("RGB")
    apart = np.abs(np.asarray(shown.resize(pixels.shape[1::-1])) - pixels).max(axis=2)
    assert apart.mean() < 6
    assert np.median(apart) <= 2
    assert write_dxf(scene, tolerance=0.1).startswith("  0\nSECTION")
    tile = squirrel("IH4")
    with refused("DXF", "SVG"):
        write_dxf(artwork(tile, PAGE, Over(flat(tile, "#c02040"))).scenes[0], tolerance=0.1)


@pytest.mark.parametrize(
    "body",
    [
        '<linearGradient id="a"><stop stop-color="#000"/><stop offset="1" stop-color="#fff"/>'
        '</linearGradient><rect x="200" y="100" width="300" height="200" fill="url(#a)"/>',
        '<text x="300" y="400" font-size="200">hm</text>',
        '<filter id="f"><feGaussianBlur stdDeviation="30"/></filter>'
        '<circle cx="500" cy="300" r="90" filter="url(#f)"/>',
        '<clipPath id="c"><circle cx="500" cy="300" r="90"/></clipPath>'
        '<rect width="900" height="900" clip-path="url(#c)"/>',
        '<path d="M350 250L620 380" stroke="#000" stroke-width="20" stroke-dasharray="60 30"/>',
    ],
    ids=["gradient", "text", "filter", "clip", "dashes"],
)
def test_what_is_more_than_fills_and_strokes_is_carried_as_pixels(
    body: str, tmp_path: Path
) -> None:
    tile = squirrel("IH4")
    path = svg_of("IH4", body, tmp_path)
    over = read_over(path, tile)
    assert over.drawing is None
    assert over.picture is not None
    assert "as a picture" in over.notes[-1]
    opaque = np.asarray(over.picture.image)[..., 3] > 127
    seen, covered = read_outline(path).seen, tile.covered
    assert seen is not None
    share = seen.area / float(np.prod(covered.high - covered.low))
    assert opaque.mean() == pytest.approx(share, rel=0.1)


def test_lines_that_no_clip_cuts_stay_lines(tmp_path: Path) -> None:
    body = """<clipPath id="c"><rect x="0" y="0" width="900" height="900"/></clipPath>
    <g clip-path="url(#c)"><path d="M350 250L620 380" fill="none" stroke="#000"/></g>"""
    over = read_over(svg_of("IH4", body, tmp_path), squirrel("IH4"))
    assert over.drawing is not None
    assert [part.style.stroke for part in over.drawing.parts] == ["#000000"]


def test_wide_strokes_are_carried_as_regions(tmp_path: Path) -> None:
    """The same region is carried as when it is drawn as a fill."""
    tile = squirrel("IH4")
    line = 'd="M350 250L620 380" fill="none" stroke="#000000"'
    over = read_over(svg_of("IH4", f'<path {line} stroke-width="20"/>', tmp_path), tile)
    seen = read_outline(tmp_path / "drawing.svg").seen
    assert seen is not None
    filled = "".join(
        "M" + "L".join(f"{x} {y}" for x, y in part.exterior.coords) + "z"
        for part in getattr(seen, "geoms", [seen])
    )
    expected = read_over(svg_of("IH4", f'<path d="{filled}"/>', tmp_path), tile)
    assert over.drawing is not None
    assert expected.drawing is not None
    found, (goal,) = over.drawing.parts, expected.drawing.parts
    assert {part.style for part in found} == {goal.style}
    whole = shapely.union_all([region(part) for part in found])
    assert whole.symmetric_difference(region(goal)).area < 0.01 * region(goal).area


def test_artwork_is_carried_as_it_is_seen(tmp_path: Path) -> None:
    tile = squirrel("IH4")
    # what bleeds beyond the page is kept: the tile's own edge cuts it
    shapes = '<circle cx="500" cy="300" r="90" fill="#123456"/><rect x="-100" y="250" {0}/>'
    plain = shapes.format('width="700" height="90"')
    styled = "<style>#guides > rect{display:none} .a circle{fill:#123456!important}</style>"
    styled += '<g class="a"><circle cx="500" cy="300" r="90" style="fill:none"/></g>'
    styled += '<g id="guides"><rect width="900" height="400"/></g>'
    styled += '<g><rect x="-100" y="250" width="700" height="90"/></g>'
    found = [read_over(svg_of("IH4", text, tmp_path), tile).drawing for text in (styled, plain)]
    assert found[0] is not None
    assert found[1] is not None
    for one, two in zip(found[0].parts, found[1].parts, strict=True):
        assert one.style == two.style
        assert region(one).symmetric_difference(region(two)).area < 1e-3 * region(two).area


@pytest.mark.parametrize(
    "text",
    [
        '<svg viewBox="0 0 10 99"><rect width="3" height="3"/></svg>',  # of another aspect
        "<svg><g/></svg>",
        '<svg><rect x="-1e300" width="1e301" height="3"/></svg>',
        '<svg><path d="M0 0 L9e7 0 L9e7 9e7 Z"/></svg>',  # too intricate to be carried
        *("<svg><rect", "<html/>", '<!DOCTYPE a [<!ENTITY b SYSTEM "c">]><svg/>'),
    ],
)
def test_drawings_that_are_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "drawing.svg"
    path.write_text(text)
    with refused("drawing.svg", kind=InputFileError):
        read_over(path, squirrel("IH4"))


@pytest.mark.parametrize("name", ["IH1", "IH21"])
def test_long_lines_bend_with_the_tile(name: str, tmp_path: Path) -> None:
    tile = squirrel(name)
    body = '<line/><polyline points="300,250 700,250" fill="none" stroke="#000"/>'
    over = read_over(svg_of(name, body, tmp_path), tile)
    assert over.drawing is not None
    (part,) = over.drawing.parts
    (curve,) = part.curves
    ends = tile.forward(np.array([[300.0, 250.0], [700.0, 250.0]]))
    np.testing.assert_allclose([curve.start, curve.end], ends, atol=1e-9)
    assert len(curve.pieces) > 40


def test_current_colour_is_ink(tmp_path: Path) -> None:
    body = f"""<circle cx="{EYE[0]}" cy="{EYE[1]}" r="40" fill="currentColor"/>
    <path d="M 300 400 L 500 300" fill="none" stroke="currentcolor" stroke-width="9"/>
    <path d="M 300 400 L 500 300 L 600 400" fill="currentColor" color="#203040"/>"""
    art = drawn("IH4", body, tmp_path)
    assert [INK in part.style for part in art.scenes[0].motifs["motif"].parts] == [
        True,
        True,
        False,
    ]
    assert art.scenes[0].motifs["motif"].parts[2].style.fill == "#203040"
    chosen = palette(art.settings.palette)
    inks = {layer.ink for layer in art.scenes[0].layers} - {None}
    assert inks == {chosen.outline, chosen.paper}


def test_a_machine_follows_strokes_that_a_picture_has_as_areas(tmp_path: Path) -> None:
    tile = squirrel("IH4")
    size = float(np.sqrt(abs(tile.tile.signed_area)))
    line = f'<path d="M350 250L620 380" fill="none" stroke="#000000" stroke-width="{size / 100}"/>'
    path = svg_of("IH4", line, tmp_path)
    for followed in (False, True):
        over = read_over(path, tile, followed=followed)
        assert over.drawing is not None
        (part,) = over.drawing.parts
        assert (part.style.stroke is not None) == followed
    steady = line.replace("/>", ' vector-effect="non-scaling-stroke"/>')
    over = read_over(svg_of("IH4", steady, tmp_path), tile)
    assert over.drawing is not None
    assert over.drawing.parts[0].style.width == pytest.approx(size / 100)


def test_wide_strokes_leave_no_gap_where_the_tile_stretches(tmp_path: Path) -> None:
    """Strokes side by side fill what a rectangle fills."""
    wide = "".join(
        f'<path d="M{x} 150V520" fill="none" stroke="#000000" stroke-width="40"/>'
        for x in range(340, 640, 40)
    )
    block = '<rect x="320" y="150" width="320" height="370" fill="#000000"/>'
    regions = []
    for body in (wide, block):
        over = read_over(svg_of("IH4", body, tmp_path), squirrel("IH4"))
        assert over.drawing is not None
        regions.append(shapely.union_all([region(part) for part in over.drawing.parts]))
    assert regions[1].difference(regions[0]).area < 2e-3 * regions[1].area
