"""SVG drawings are read as they are seen: as resvg renders them, and as programs write them."""

import io
from pathlib import Path

import numpy as np
import pytest
import resvg_py
import shapely
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from orbiflow.arrays import Array
from orbiflow.errors import InputFileError
from orbiflow.tiles import Reading, read_outline, ring_length, signed_area
from orbiflow.tiles.silhouette import FileContent

DRAWINGS = Path(__file__).parent / "drawings"
ROOT = Path(__file__).parents[3]
SVG = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
PIXELS = 200
LINE = 'fill="none" stroke="#000"'
PEN = '<path d="M20 70C20 20 60 10 80 40L50 60 70 80" '

FEATURES = {
    "butt": f'{PEN}{LINE} stroke-width="8"/>',
    "round": (f'{PEN}{LINE} stroke-width="8" stroke-linecap="round" stroke-linejoin="round"/>'),
    "square bevel": (
        f'{PEN}{LINE} stroke-width="8" stroke-linecap="square" stroke-linejoin="bevel"/>'
    ),
    "miter limit": (
        '<path d="M10 20L50 25 10 30M90 80L50 70 90 60M20 50L60 50 70 95" '
        f'{LINE} stroke-width="5" stroke-miterlimit="5"/>'
    ),
    "miter sharp": (
        f'<path d="M20 20L60 25 20 30M90 80L60 70 90 60" {LINE} '
        'stroke-width="5" stroke-miterlimit="20"/>'
    ),
    "closed miter": f'<path d="M20 20L80 30 40 80z" {LINE} stroke-width="9"/>',
    "dash": f'{PEN}{LINE} stroke-width="6" stroke-dasharray="9 4"/>',
    "dash odd offset": (
        f'{PEN}{LINE} stroke-width="6" stroke-dasharray="9,4,2" stroke-dashoffset="3"/>'
    ),
    "dots": (f'{PEN}{LINE} stroke-width="6" stroke-dasharray="0 8" stroke-linecap="round"/>'),
    "squares": (f'{PEN}{LINE} stroke-width="6" stroke-dasharray="0 10" stroke-linecap="square"/>'),
    "dash ring": (
        f'<circle cx="50" cy="50" r="30" {LINE} stroke-width="6" stroke-dasharray="12 7"/>'
    ),
    "dash rect": (
        f'<rect x="20" y="20" width="60" height="50" {LINE} stroke-width="6" '
        'stroke-dasharray="10%"/>'
    ),
    "skew pen": (
        '<g transform="matrix(2 0 .5 .5 0 20)"><path d="M5 5L30 100 40 20 10 '
        f'90" {LINE} stroke-width="8"/></g>'
    ),
    "elliptic": (
        f'<g transform="scale(1 .3)"><circle cx="50" cy="150" r="30" {LINE} stroke-width="20"/></g>'
    ),
    "wide round": (
        f'<path d="M40 40q5 30 8 0t8 0 8 4" {LINE} stroke-width="40" '
        'stroke-linejoin="round" stroke-linecap="round"/>'
    ),
    "percent": f'{PEN}{LINE} stroke-width="7%"/>',
    "inherit": (
        f'<g {LINE} stroke-width="7"><g stroke-linejoin="round">{PEN} stroke="inherit"/></g></g>'
    ),
    "css": (
        "<style>"
        f".s{{fill:none;stroke:#000;stroke-width:4px;stroke-linecap:round}}</style>"
        f'{PEN} class="s"/>'
    ),
    "line": ('<line x1="10" y1="20" x2="80" y2="90" stroke="black" stroke-width="7"/>'),
    "open fill": '<path d="M10 20L80 30 50 80"/>',
    "fill+stroke": (
        '<rect x="30" y="30" width="30" height="40" rx="6" stroke="#000" stroke-width="7"/>'
    ),
    "marker": (
        '<marker id="m" viewBox="0 0 10 10" refX="2" refY="5" markerWidth="4" '
        'markerHeight="4" orient="auto-start-reverse"><path d="M0 0L10 5 0 '
        f'10z"/></marker>{PEN}{LINE} stroke-width="4" marker-start="url(#m)" '
        'marker-mid="url(#m)" marker-end="url(#m)"/>'
    ),
    "marker ref": (
        '<marker id="m" markerWidth="8" markerHeight="8" refX="1" refY="2" '
        'orient="30" markerUnits="userSpaceOnUse"><rect width="20" '
        f'height="20"/></marker>{PEN}{LINE} stroke-width="4" marker="url(#m)"/>'
    ),
    "clip": (
        '<clipPath id="c"><circle cx="50" cy="50" r="25"/></clipPath><rect '
        'width="60" height="60" clip-path="url(#c)"/>'
    ),
    "clip group": (
        '<clipPath id="c"><circle cx="50" cy="50" r="25"/><rect x="70" y="70" '
        'width="20" height="20"/></clipPath><g transform="rotate(10)" '
        f'clip-path="url(#c)"><rect width="60" height="60"/>{PEN}{LINE} '
        'stroke-width="10"/><rect x="75" y="60" width="9" height="30"/></g>'
    ),
    "clip box": (
        '<clipPath id="c" clipPathUnits="objectBoundingBox"><circle cx=".5" '
        'cy=".5" r=".5"/></clipPath><rect x="20" y="30" width="60" height="30" '
        'clip-path="url(#c)" transform="rotate(20 50 50)"/>'
    ),
    "clip evenodd": (
        '<clipPath id="c"><path clip-rule="evenodd" d="M10 10h80v80h-80zM30 '
        '30h40v40h-40z"/></clipPath><circle cx="50" cy="50" r="45" '
        'clip-path="url(#c)"/>'
    ),
    "clip nested": (
        '<clipPath id="a"><rect x="30" width="40" height="100"/></clipPath>'
        '<clipPath id="c"><circle cx="50" cy="50" r="35" clip-path="url(#a)"/>'
        '</clipPath><rect width="100" height="60" clip-path="url(#c)"/>'
    ),
    "mask": (
        '<mask id="c"><rect width="100" height="100" fill="#fff"/><circle '
        'cx="50" cy="50" r="20"/></mask><rect x="10" y="20" width="70" '
        'height="60" mask="url(#c)"/>'
    ),
    "mask alpha": (
        '<mask id="c" style="mask-type:alpha" maskUnits="userSpaceOnUse" x="0" '
        'y="0" width="100" height="100"><circle cx="50" cy="50" r="20"/></mask>'
        '<rect x="10" y="20" width="70" height="60" mask="url(#c)"/>'
    ),
    "nested svg": (
        '<svg x="10" y="20" width="50" height="60" viewBox="0 0 10 10"><circle '
        'cx="2" cy="5" r="5"/></svg>'
    ),
    "symbol": (
        '<symbol id="s" viewBox="0 0 10 10"><path d="M-5 2h20v5h-20z"/>'
        '</symbol><use href="#s" x="20" y="10" width="40" height="40"/><use '
        'xlink:href="#s" x="20" y="60" width="30" height="30" '
        'transform="skewX(5)"/>'
    ),
    "symbol visible": (
        '<symbol id="s" viewBox="0 0 10 10" overflow="visible"><path d="M-5 '
        '2h20v5h-20z"/></symbol><use href="#s" x="20" y="10" width="40" '
        'height="40"/>'
    ),
    "use stroke": (
        f'<defs><path id="p" d="M0 0L30 10 5 30z"/></defs><g {LINE} '
        'stroke-width="4"><use href="#p" x="20" y="20"/><use href="#p" '
        'transform="translate(60 50) scale(1 2)"/></g>'
    ),
    "white over": ('<circle cx="50" cy="50" r="40"/><circle cx="75" cy="50" r="20" fill="#fff"/>'),
    "white stroke": (
        f'<circle cx="50" cy="50" r="40"/>{PEN} fill="none" stroke="white" stroke-width="6"/>'
    ),
    "paint order": (
        '<circle cx="50" cy="50" r="30" fill="#fff" stroke="#000" '
        'stroke-width="12" paint-order="stroke"/>'
    ),
    "hidden": (
        '<circle cx="50" cy="50" r="30"/><g visibility="hidden"><rect '
        'width="90" height="90"/><rect width="40" height="40" '
        'visibility="visible"/></g>'
    ),
    "evenodd stroke": (
        '<path fill-rule="evenodd" d="M10 10h60v60h-60zM30 30h60v60h-60z" '
        'stroke="#000" stroke-width="4"/>'
    ),
    "pad": f'<path d="M10 10l30 0l-30 0" {LINE} stroke-width="6" />',
    "dot": (
        f'<circle cx="70" cy="70" r="5"/><path d="M20 20h0" {LINE} '
        'stroke-width="16" stroke-linecap="round"/>'
    ),
}


def read(body: str, attributes: str = "") -> Reading:
    text = f'{SVG} viewBox="0 0 100 100" {attributes}>{body}</svg>'
    return read_outline(FileContent(text.encode(), "drawing.svg"))


def agreement(body: str) -> float:
    """How much of what is seen or rendered is both, borders of shapes apart."""
    text = f'{SVG} viewBox="0 0 100 100" width="100" height="100">{body}</svg>'
    png = resvg_py.svg_to_bytes(
        svg_string=text, width=PIXELS, background="#ffffff", skip_system_fonts=True
    )
    light: Array = np.asarray(Image.open(io.BytesIO(png)).convert("L")) / 255
    middles = (np.arange(PIXELS) + 0.5) * 100 / PIXELS
    seen = read(body).seen
    shapely.prepare(seen)
    ours = shapely.contains_xy(seen, *np.meshgrid(middles, middles))
    clear = (light < 0.03) | (light > 0.97)
    dark = light < 0.5
    return float((ours & dark & clear).sum() / ((ours | dark) & clear).sum())


@pytest.mark.parametrize("name", FEATURES)
def test_what_is_read_is_what_a_renderer_draws(name: str) -> None:
    assert agreement(FEATURES[name]) > 0.998


NUMBERS = st.integers(15, 85)


@given(
    points=st.lists(st.tuples(NUMBERS, NUMBERS), min_size=3, max_size=6, unique=True),
    closed=st.booleans(),
    cap=st.sampled_from(["butt", "round", "square"]),
    join=st.sampled_from(["miter", "round", "bevel"]),
    width=st.integers(2, 12),
    dashes=st.sampled_from(["none", "10 6", "3 9 5", "0 14"]),
    matrix=st.sampled_from(["", "rotate(20 50 50)", "matrix(.8 .3 -.2 .6 10 5)"]),
    fill=st.sampled_from(["none", "#000"]),
)
def test_any_stroke_is_what_a_renderer_draws(
    points: list[tuple[int, int]],
    closed: bool,
    cap: str,
    join: str,
    width: int,
    dashes: str,
    matrix: str,
    fill: str,
) -> None:
    path = "M" + "L".join(f"{x} {y}" for x, y in points) + "z" * closed
    body = (
        f'<path d="{path}" stroke="#000" fill="{fill}" stroke-width="{width}" '
        f'stroke-linecap="{cap}" stroke-linejoin="{join}" stroke-dasharray="{dashes}" '
        f'stroke-dashoffset="2" transform="{matrix}"/><circle cx="50" cy="50" r="12"/>'
    )
    assert agreement(body) > 0.98


def covers(reading: Reading, *points: tuple[float, float]) -> list[bool]:
    shape = shapely.Polygon(reading.outline)
    return [shape.contains(shapely.Point(point)) for point in points]


def test_a_snail_keeps_its_neck_and_antennae() -> None:
    reading = read_outline(DRAWINGS / "snail.svg")
    neck, left, right, beside = (172, 80), (160, 37), (188, 39), (178, 50)
    assert covers(reading, neck, left, right, beside) == [True, True, True, False]
    assert reading.notes == ("filled 1 hole (7.0% of the area)",)
    assert reading.seen is not None
    assert reading.seen.area < shapely.Polygon(reading.outline).area


def test_a_fish_keeps_its_white_stripes() -> None:
    reading = read_outline(DRAWINGS / "fish.svg")
    stripe, fin, outside = (135, 130), (210, 33), (135, 45)
    assert covers(reading, stripe, fin, outside) == [True, True, False]
    assert not reading.seen.contains(shapely.Point(stripe))  # type: ignore[union-attr]


def test_a_cat_keeps_its_tail_and_whiskers() -> None:
    reading = read_outline(DRAWINGS / "cat.svg")
    assert covers(reading, (268, 225), (50, 136.7), (125, 120), (50, 150)) == [True] * 3 + [False]


def test_a_line_drawing_is_the_whole_animal() -> None:
    reading = read(f'<circle cx="50" cy="50" r="30" {LINE} stroke-width="2"/>')
    assert shapely.Polygon(reading.outline).area == pytest.approx(np.pi * 31**2, rel=2e-3)
    assert reading.notes == ("filled 1 hole (87.5% of the area)",)


def test_hairlines_keep_their_width() -> None:
    reading = read(f'<path d="M10 50H90" {LINE} stroke-width=".2"/>')
    assert shapely.Polygon(reading.outline).area == pytest.approx(80 * 0.2)


# vertices, signed area and length, from before strokes were read
FILLS = {
    "docs/gallery/silhouettes/alligator.svg": (350, -7407.346789523983, 621.6283043273406),
    "docs/gallery/silhouettes/eagle.svg": (174, -300.84679999999986, 103.85829927048718),
    "docs/gallery/silhouettes/hedgehog.svg": (198, -421.18680000000006, 104.50072944264465),
    "docs/gallery/silhouettes/owl.svg": (140, -529.1351999999999, 95.26978266843466),
    "docs/gallery/silhouettes/rooster.svg": (295, -433.06059999999997, 133.8257599105659),
    "docs/gallery/silhouettes/snail.svg": (168, -650.3616000000002, 109.74980110967843),
    "docs/gallery/silhouettes/unicorn.svg": (147, -493.62339999999983, 116.06212765741077),
    "examples/silhouettes/barbet.svg": (429, -235590.0804099579, 3267.54268594982),
}


@pytest.mark.parametrize("name", FILLS)
def test_drawings_of_fills_alone_read_as_ever(name: str) -> None:
    ring = read_outline(ROOT / name).outline
    count, area, length = FILLS[name]
    assert len(ring) == count
    assert [signed_area(ring), ring_length(ring)] == pytest.approx([area, length], rel=1e-13)


BITTEN = 1 - (np.arccos(0.5) - 0.5 * 0.75**0.5) / np.pi  # a disc cut at half its radius
DISC = '<circle cx="50" cy="50" r="30" {}/>'


@pytest.mark.parametrize(
    ("body", "area", "note"),
    [
        # a bite in the colour of the page, with and without a page
        (
            DISC.format("") + '<rect x="65" width="35" height="100" fill="#fefefe"/>',
            BITTEN,
            "19.5%",
        ),
        (
            '<rect width="100" height="100" fill="#123"/>'
            + DISC.format('fill="#fff"')
            + '<rect x="65" width="35" height="100" fill="#123"/>',
            BITTEN,
            "#112233 for background",
        ),
        # white on nothing is the shape itself, also with dark eyes
        (DISC.format('fill="#fff"') + '<circle cx="45" cy="40" r="5"/>', 1, "took shapes in #fff"),
        (DISC.format('fill="#fff"'), 1, "took shapes in #ffffff too"),
        # shadows are faint
        (DISC.format("") + '<rect y="70" width="99" height="9" opacity=".3"/>', 1, "1 faint shape"),
        (DISC.format('opacity=".3"'), 1, "took faint shapes"),
        (DISC.format('fill="none"'), 1, "nothing is painted"),
        (DISC.format("") + "<text>Hm</text><text>hm</text>", 1, "left out 2 texts of the drawing"),
        (DISC.format('style="filter:url(#blur)"'), 1, "left out 1 filter of the drawing"),
        # a frame around the page is no shape
        (DISC.format("") + f'<rect width="100" height="100" {LINE}/>', 1, "background rectangle"),
        (DISC.format('vector-effect="non-scaling-stroke" stroke="#000"'), (30.1 / 30) ** 2, ""),
    ],
)
def test_what_counts_as_shape(body: str, area: float, note: str) -> None:
    reading = read(body, 'width="500" height="500"')
    expected = area * np.pi * 30**2
    assert shapely.Polygon(reading.outline).area == pytest.approx(expected, rel=3e-3)
    assert any(note in said for said in reading.notes) or not note


def zigzag(count: int, step: float) -> str:
    steps = np.random.default_rng(0).normal(0, step, (count, 2)).round(2).tolist()
    return "M50 50l" + " ".join(f"{x},{y}" for x, y in steps)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (f'<path d="{zigzag(3000, 0.05)}" {LINE} stroke-width="50"/>', "crosses itself too often"),
        (f'<path d="M0 0H90" {LINE} stroke-dasharray=".0001"/>', "more than 200000 points"),
        (
            '<clipPath id="c"><rect width="9" height="9" clip-path="url(#c)"/></clipPath>'
            '<rect width="9" height="9" clip-path="url(#c)"/>',
            "in a circle",
        ),
        (
            '<marker id="c"><path d="M0 0L3 3 4 9" style="marker:url(#c)"/></marker>'
            '<path d="M0 0L3 3 4 9" style="marker:url(#c)"/>',
            "in a circle",
        ),
        (
            '<clipPath id="c"><path d="M0 0H1e300V9z"/></clipPath>'
            '<rect width="9" height="9" clip-path="url(#c)"/>',
            "beyond 1e\\+12 user units",
        ),
        (f'<g transform="scale(0 1)">{PEN}{LINE}/></g>', "no closed path"),
        ('<rect width="100" height="100"/><image href="x.png"/>', r"1 embedded image\(s\)"),
    ],
)
def test_drawings_that_are_refused(body: str, message: str) -> None:
    with pytest.raises(InputFileError, match=message):
        read(body)


def test_clips_that_multiply_are_read_once() -> None:
    """Each clip of twelve is used ten times by the one before."""
    clips = "".join(
        f'<clipPath id="c{k}">'
        + f'<rect width="50" height="50" clip-path="url(#c{k + 1})"/>' * 10
        + "</clipPath>"
        for k in range(12)
    )
    reading = read(clips + '<rect width="90" height="90" clip-path="url(#c0)"/>')
    assert shapely.Polygon(reading.outline).area == pytest.approx(2500)
