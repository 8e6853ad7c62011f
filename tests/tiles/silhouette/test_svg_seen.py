"""SVG drawings are read as they are seen: as resvg renders them, and as programs write them."""

import io
import re
from pathlib import Path

import numpy as np
import pytest
import resvg_py
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy.ndimage import maximum_filter, minimum_filter

from orbiflow.arrays import Array
from orbiflow.errors import InputFileError
from orbiflow.tiles import Reading, Target, doubts, read_outline, ring_length, signed_area
from orbiflow.tiles.silhouette import Drawing, FileContent

DRAWINGS = Path(__file__).parent / "drawings"
ROOT = Path(__file__).parents[3]
SVG = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
PIXELS = 240
LINE = 'fill="none" stroke="#000"'
PEN = '<path d="M20 70C20 20 60 10 80 40L50 60 70 80" '

FISH = '<path d="M10 50C30 15 60 20 75 45L95 30 90 70 75 55C60 80 30 85 10 50z"'
PREFIXES = {
    "xlink": "http://www.w3.org/1999/xlink",
    "inkscape": "http://www.inkscape.org/namespaces/inkscape",
    "sodipodi": "http://sodipodi.sourceforge.net/DTD/sodipodi-0.dtd",
    "serif": "http://www.serif.com/",
}
ENTRY = re.compile(r"(?P<name>[^|]+?)(?: (?P<kind>[=~]) (?P<wanted>[^|]*))? \| (?P<body>.*)")
CATALOGUE = {
    found["name"]: found
    for line in (DRAWINGS / "catalogue.txt").read_text().splitlines()
    if line[:1] != "#" and (found := ENTRY.fullmatch(line))
}
# what notes say of a drawing that is not read as it is written
WARNINGS = ("not understood", "refers to", "of the drawing", "of the style sheet", "animations")


def read(body: str, attributes: str = "") -> Reading:
    text = f'{SVG} viewBox="0 0 100 100" {attributes}>{body}</svg>'
    return read_outline(FileContent(text.encode(), "drawing.svg"))


def document(name: str) -> str:
    """Return the drawing of the catalogue as a whole document."""
    body = CATALOGUE[name]["body"].replace("{FISH}", FISH).replace("{LINE}", LINE)
    body = body.replace("{PEN}", PEN)
    if name.startswith(("no namespace", "prefixed")):
        return body
    prefixes = " ".join(f'xmlns:{key}="{value}"' for key, value in PREFIXES.items())
    start = f'<svg xmlns="http://www.w3.org/2000/svg" {prefixes}'
    if body.startswith("<svg ") and not body.startswith("<svg x="):
        repeated = [f'xmlns:{key}="{value}"' for key, value in PREFIXES.items()]
        for declared in repeated:
            body = body.replace(declared, "")
        return start + body[4:]
    return f'{start} viewBox="0 0 100 100">{body}</svg>'


def rendered(text: str, pixels: int) -> Array:
    """Return how light resvg's picture of a document on white paper is."""
    png = resvg_py.svg_to_bytes(
        svg_string=text,
        **{"width": pixels, "background": "#ffffff", "skip_system_fonts": True},
        **{"dpi": 96, "languages": ["en"]},
    )
    return np.asarray(Image.open(io.BytesIO(png)).convert("L")) / 255


def agreement(text: str, pixels: int = PIXELS) -> float:
    """Return how much of what is seen or rendered is both, borders of shapes apart."""
    light = rendered(text, pixels)
    content = FileContent(text.encode(), "drawing.svg")
    window = Drawing(content).window
    assert window is not None
    low, high = np.array(window[:2]), np.array(window[2:])
    y, x = ((np.arange(n) + 0.5) / n for n in light.shape)
    seen = read_outline(content).seen
    shapely.prepare(seen)
    grid = np.meshgrid(low[0] + x * (high - low)[0], low[1] + y * (high - low)[1])
    ours = shapely.contains_xy(seen, *grid)
    dark = light < 0.5
    inner = minimum_filter(dark, 3) == maximum_filter(dark, 3)
    clear = inner | (light < 0.03) | (light > 0.97)
    return float((ours & dark & clear).sum() / max(((ours | dark) & clear).sum(), 1))


@pytest.mark.parametrize("name", [name for name in CATALOGUE if not CATALOGUE[name]["kind"]])
def test_what_is_read_is_what_a_renderer_draws(name: str) -> None:
    assert agreement(document(name)) > 0.98
    notes = read_outline(FileContent(document(name).encode(), "drawing.svg")).notes
    odd = [note for note in notes if any(word in note for word in WARNINGS)]
    assert not odd or "invalid" in name or "negative" in name


@pytest.mark.parametrize("name", [name for name in CATALOGUE if CATALOGUE[name]["kind"] == "~"])
def test_what_is_not_read_is_noted(name: str) -> None:
    reading = read_outline(FileContent(document(name).encode(), "drawing.svg"))
    assert any(CATALOGUE[name]["wanted"] in note for note in reading.notes)


@pytest.mark.parametrize("name", [name for name in CATALOGUE if CATALOGUE[name]["kind"] == "="])
def test_what_is_read_is_what_the_specifications_say(name: str) -> None:
    reading = read_outline(FileContent(document(name).encode(), "drawing.svg"))
    area, *centre = map(float, CATALOGUE[name]["wanted"].split())
    assert reading.seen is not None
    assert reading.seen.area == pytest.approx(area, rel=5e-3)
    if centre:
        assert [reading.seen.centroid.x, reading.seen.centroid.y] == pytest.approx(centre, abs=0.1)


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
    assert agreement(f'{SVG} viewBox="0 0 100 100">{body}</svg>', 200) > 0.98


TENTHS = st.integers(0, 10).map(lambda k: k / 10)


@given(
    ends=st.tuples(TENTHS, TENTHS, TENTHS, TENTHS),
    stops=st.lists(st.tuples(TENTHS, st.sampled_from([0, 1])), min_size=2, max_size=5),
    spread=st.sampled_from(["pad", "repeat", "reflect"]),
    radial=st.booleans(),
    turn=st.integers(-40, 40),
)
@settings(max_examples=15, deadline=None)
def test_any_gradient_that_fades_is_what_a_renderer_draws(
    ends: tuple[float, ...], stops: list[tuple[float, int]], spread: str, radial: bool, turn: int
) -> None:
    x1, y1, x2, y2 = ends
    assume(np.hypot(x2 - x1, y2 - y1) > 0.25)
    kind, vector = "linear", f'x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}"'
    if radial:
        kind, vector = "radial", f'cx="{x1}" cy="{y1}" r="{np.hypot(x2 - x1, y2 - y1):.3f}"'
    inner = "".join(
        f'<stop offset="{at}" stop-color="#000" stop-opacity="{opacity}"/>'
        for at, opacity in sorted(stops, key=lambda stop: stop[0])
    )
    text = (
        f'{SVG} viewBox="0 0 100 100"><{kind}Gradient id="g" spreadMethod="{spread}" {vector} '
        f'gradientTransform="rotate({turn} .5 .5)">{inner}</{kind}Gradient>'
        '<rect x="5" y="5" width="90" height="70" fill="url(#g)"/>'
        '<circle cx="50" cy="87" r="11"/></svg>'
    )
    assert agreement(text, 200) > 0.97


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


def test_a_page_with_a_hole_is_the_shape_and_said() -> None:
    for hole, is_said in ((FISH.split('"')[1], True), ("M40 40H50V50H40z", False)):
        reading = read(f'<path fill-rule="evenodd" d="M0 0H100V100H0z{hole}"/>')
        said = [note for note in reading.notes if "hole" in note and "invert" in note]
        assert bool(said) is is_said
        assert shapely.Polygon(reading.outline).area == pytest.approx(1e4)


INNER = FISH + ' transform="translate(18 18) scale(.65)" fill="{}"/>'


@pytest.mark.parametrize(
    ("drawn", "is_said"),
    [
        (INNER.format("#fd0"), True),
        (INNER.format("#fff"), True),
        (INNER.format("#028"), False),
        ('<circle cx="40" cy="40" r="6" fill="#fd0"/>', False),
        ("", False),
    ],
)
def test_a_badge_is_the_shape_and_said(drawn: str, is_said: bool) -> None:
    reading = read('<circle cx="50" cy="50" r="48" fill="#028"/>' + drawn)
    assert any("disc with a drawing" in note for note in reading.notes) is is_said
    assert shapely.Polygon(reading.outline).area == pytest.approx(np.pi * 48**2, rel=3e-3)


CARD = '<rect x="{0}" y="{0}" width="{1}" height="{1}" rx="{2}" fill="#28c"/>'


@pytest.mark.parametrize(("at", "corner"), [(0, 0), (0, 22), (-5, 0)])
def test_a_background_of_any_colour_is_left_out(at: int, corner: int) -> None:
    reading = read(CARD.format(at, 100 - 2 * at, corner) + FISH + ' fill="#e33"/>')
    area = shapely.Polygon(read(FISH + "/>").outline).area
    assert shapely.Polygon(reading.outline).area == pytest.approx(area, rel=1e-6)
    assert any("background" in note for note in reading.notes)


@pytest.mark.parametrize("drawn", ["", FISH + ' fill="#fff"/>', FISH + ' fill="#e33"/>'])
def test_a_card_within_the_page_is_the_shape_and_doubted(drawn: str) -> None:
    target = Target(**vars(read(CARD.format(5, 90, 9) + drawn)))
    assert target.area == pytest.approx(90**2, rel=0.03)
    (doubt,) = doubts(target)
    assert "card" in doubt


ROUND = '<circle cx="{}" cy="50" r="30" {}/>'
WHITE = '<rect width="100" height="100" fill="#fff"/>'
TWO = ROUND.format(40, 'opacity=".3"') + ROUND.format(50, 'opacity=".3"')
IN_GROUP = ROUND.format(40, "") + ROUND.format(60, "")
FAINT = {
    "two that are seen where they overlap": TWO,
    "three": ROUND.format(30, 'fill-opacity=".3"') + TWO,
    "colours": TWO.replace("/>", ' fill="#100"/>', 1),
    "a group is one": f'<g opacity=".3">{IN_GROUP}</g>' + ROUND.format(50, 'opacity=".3"'),
    "groups in a group": f'<g opacity=".9"><g opacity=".4">{IN_GROUP}</g>{TWO}</g>',
    "a half-transparent group": '<g opacity=".6">' + TWO.replace(".3", ".45") + f"</g>{TWO}",
    "what is hidden between": f'{TWO}<rect width="50" height="100" fill="#fff"/>{TWO}',
    "fill and stroke are one": f'<g stroke="#000" stroke-width="9" opacity=".4">{TWO}</g>{TWO}',
    "beside an opaque one": f'<rect x="45" y="5" width="9" height="60"/>{TWO}',
}


@pytest.mark.parametrize("name", FAINT)
def test_faint_shapes_are_seen_where_they_lie_on_one_another(name: str) -> None:
    body = f"{WHITE}{FAINT[name]}"
    assert agreement(f'{SVG} viewBox="0 0 100 100">{body}</svg>') > 0.98
    assert not any("took faint" in note for note in read(body).notes)


def test_faint_shapes_that_hardly_overlap_are_left_out_or_all_of_the_drawing() -> None:
    apart = ROUND.format(21, 'opacity=".3"') + ROUND.format(79, 'opacity=".3"')
    assert "took faint shapes, as there are no others" in read(apart).notes
    reading = read(DISC.format("") + '<rect x="2" width="9" height="9" opacity=".3"/>' + apart)
    assert any("left out 3 faint shapes" in note for note in reading.notes)
    assert shapely.Polygon(reading.outline).area == pytest.approx(np.pi * 900, rel=3e-3)


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
        (
            '<filter id="f"><feFlood/></filter><mask id="m"><g filter="url(#f)">'
            + DISC.format("")
            + '</g></mask><rect width="90" height="90" mask="url(#m)"/>',
            "no closed path: .*; left out 1 filter of the drawing",
        ),
        (
            f'<clipPath id="c"><switch>{DISC.format("")}</switch></clipPath>'
            '<rect width="90" height="90" clip-path="url(#c)"/>',
            "no closed path: .*; a <switch> in a <clipPath> clips nothing",
        ),
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
