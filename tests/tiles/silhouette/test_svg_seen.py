"""SVG drawings are read as they are seen: as resvg renders them, and as programs write them."""

import re
from pathlib import Path

import numpy as np
import pytest
import shapely

from orbiflow.errors import InputFileError
from orbiflow.tiles import Reading, Target, doubts, read_outline, signed_area
from orbiflow.tiles.silhouette import FileContent
from orbiflow.tiles.silhouette.readers import svg
from refusals import refused

DRAWINGS = Path(__file__).parent / "drawings"
ROOT = Path(__file__).parents[3]
SVG = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
LINE = 'fill="none" stroke="#000"'
PEN = '<path d="M20 70C20 20 60 10 80 40L50 60 70 80" '

FISH = '<path d="M10 50C30 15 60 20 75 45L95 30 90 70 75 55C60 80 30 85 10 50z"'
PREFIXES = {
    "xlink": "http://www.w3.org/1999/xlink",
    "inkscape": "http://www.inkscape.org/namespaces/inkscape",
    "sodipodi": "http://sodipodi.sourceforge.net/DTD/sodipodi-0.dtd",
    "serif": "http://www.serif.com/",
}
ENTRY = re.compile(
    r"(?P<name>[^|]+?)(?: = (?P<area>[\d. ]+?))?(?: ~ (?P<note>[^|]*))? \| (?P<body>.*)"
)
CATALOGUE = {
    found["name"]: found
    for line in (DRAWINGS / "catalogue.txt").read_text().splitlines()
    if line[:1] != "#" and (found := ENTRY.fullmatch(line))
}


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


FINE = (
    *("dots", "dash offset negative", "mask with a faint part that a filter makes white"),
    "bite without a page",
)
"""Drawings with details that are read at more pixels."""


@pytest.mark.parametrize("name", CATALOGUE)
def test_what_is_read_is_what_is_seen(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if name not in FINE:
        monkeypatch.setattr(svg, "LONG_PIXELS", 200)
        monkeypatch.setattr(svg, "SMALL_PIXELS", 80)
    reading = read_outline(FileContent(document(name).encode(), "drawing.svg"))
    wanted, note = CATALOGUE[name]["area"], CATALOGUE[name]["note"]
    assert any((note or "") in said for said in reading.notes) or note is None
    if wanted is None:
        return
    area, *centre = map(float, wanted.split())
    assert reading.seen is not None
    page = max(reading.size or (100, 100))
    assert reading.seen.area == pytest.approx(area, rel=0.02, abs=2e-4 * page**2)
    if centre:
        seen = [reading.seen.centroid.x, reading.seen.centroid.y]
        assert seen == pytest.approx(centre, abs=5e-3 * page)


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


def test_hairlines_keep_their_width(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(svg, "LONG_PIXELS", 1500)
    reading = read(f'<path d="M10 50H90" {LINE} stroke-width=".2"/>')
    assert shapely.Polygon(reading.outline).area == pytest.approx(80 * 0.2, rel=0.08)


# the area and the vertices of fills, from before drawings were rendered
FILLS = {
    "docs/gallery/silhouettes/alligator.svg": 7407.35,
    "docs/gallery/silhouettes/eagle.svg": 300.847,
    "docs/gallery/silhouettes/hedgehog.svg": 421.187,
    "docs/gallery/silhouettes/owl.svg": 529.135,
    "docs/gallery/silhouettes/rooster.svg": 433.061,
    "docs/gallery/silhouettes/snail.svg": 650.362,
    "docs/gallery/silhouettes/unicorn.svg": 493.624,
    "examples/silhouettes/barbet.svg": 235590.1,
}


@pytest.mark.parametrize("name", FILLS)
def test_drawings_of_fills_alone_keep_their_area(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(svg, "LONG_PIXELS", 750)
    ring = read_outline(ROOT / name).outline
    assert abs(signed_area(ring)) == pytest.approx(FILLS[name], rel=2e-3)


DISC = '<circle cx="50" cy="50" r="30" {}/>'


def test_a_page_with_a_hole_is_the_shape_and_said() -> None:
    reading = read(f'<path fill-rule="evenodd" d="M0 0H100V100H0z{FISH.split(chr(34))[1]}"/>')
    assert any("invert" in doubt for doubt in doubts(Target(**vars(reading))))
    assert shapely.Polygon(reading.outline).area == pytest.approx(1e4, rel=1e-3)


INNER = FISH + ' transform="translate(18 18) scale(.65)" fill="{}"/>'


CARD = '<rect x="{0}" y="{0}" width="{1}" height="{1}" rx="{2}" fill="#28c"/>'


@pytest.mark.parametrize("drawn", ["", INNER.format("#fff"), INNER.format("#e33")])
def test_a_card_within_the_page_is_the_shape_and_doubted(drawn: str) -> None:
    target = Target(**vars(read(CARD.format(5, 90, 9) + drawn)))
    assert target.area == pytest.approx(90**2, rel=0.03)
    (doubt,) = doubts(target)
    assert "card" in doubt


ROUND = '<circle cx="{}" cy="50" r="30" {}/>'


def test_faint_shapes_that_hardly_overlap_are_left_out_or_all_of_the_drawing() -> None:
    apart = ROUND.format(21, 'opacity=".3"') + ROUND.format(79, 'opacity=".3"')
    assert "took faint shapes, as there are no others" in read(apart).notes
    reading = read(DISC.format("") + '<rect x="2" width="9" height="9" opacity=".3"/>' + apart)
    assert "left out faint shapes" in reading.notes
    assert shapely.Polygon(reading.outline).area == pytest.approx(np.pi * 900, rel=5e-3)


def test_drawings_of_nothing_are_refused() -> None:
    with refused("drawing.svg", kind=InputFileError):
        read(f'<g transform="scale(0 1)">{PEN}{LINE}/></g>')
