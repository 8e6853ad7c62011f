"""SVG drawings: geometry in user units, fill rules, and drawings that cannot be read."""

from pathlib import Path

import pytest
from shapely.geometry import Point, Polygon, box

from orbiflow.errors import InputFileError
from orbiflow.tiles import Reading, hausdorff, read_outline
from orbiflow.tiles.silhouette.readers import svg
from refusals import refused

NEAR = 0.25
"""Of a page of 100: a pixel of what is traced."""

SQUARE = "M10 20 h30 v30 h-30 z"


def read(tmp_path: Path, body: str, attributes: str = 'viewBox="0 0 100 100"') -> Reading:
    path = tmp_path / "drawing.svg"
    path.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {attributes}>{body}</svg>')
    return read_outline(path)


@pytest.mark.parametrize(
    "body",
    [
        f'<path d="{SQUARE}"/>',
        '<path d="M10 20L40 20 40 50 10 50Z" fill="none"/>',
        '<rect x="10" y="20" width="30" height="30"/>',
        '<polyline points="10,20 40,20 40,50 10,50 10,20"/>',
        '<g transform="translate(0,50) scale(.1,-.1)"><path d="M100 0h300v300h-300z"/></g>',
        '<rect x="-50" y="10" width="30" height="30" transform="rotate(-90)"/>',
        "<style>.m{transform:translate(10px,20px)} .h{display:none}</style>"
        '<rect class="m" width="30" height="30"/><rect class="h" width="90" height="90"/>',
        '<rect width="90" height="90" style="display:none"/><path d="' + SQUARE + '"/>',
    ],
)
def test_a_square_however_it_is_drawn(tmp_path: Path, body: str) -> None:
    reading = read(tmp_path, body)
    assert reading.y_down
    assert reading.size == (100, 100)
    assert hausdorff(reading.outline, box(10, 20, 40, 50)) < NEAR


@pytest.mark.parametrize(
    "attributes",
    [
        'width="1536pt" height="703pt" viewBox="0 0 1536 703"',
        'width="50%" height="10mm" viewBox="0 0 1536 703"',
        'viewBox="0 0 1536 703" preserveAspectRatio="none" width="3" height="900"',
        'viewBox="-99 -50 1536 703"',
        'width="1536" height="703"',
        "",
    ],
)
def test_user_units_whatever_the_size_on_paper(tmp_path: Path, attributes: str) -> None:
    reading = read(tmp_path, f'<path d="{SQUARE}"/>', attributes)
    assert hausdorff(reading.outline, box(10, 20, 40, 50)) < NEAR
    assert reading.size == ((1536, 703) if attributes else None)


def test_curves_are_flattened_within_the_bound(tmp_path: Path) -> None:
    disc = Point(50, 50).buffer(30, quad_segs=2000)
    bodies = [
        '<circle cx="50" cy="50" r="30"/>',
        '<ellipse cx="50" cy="25" rx="30" ry="15" transform="scale(1 2)"/>',
        '<path d="M20 50A30 30 0 0 1 80 50 30 30 0 0 1 20 50z"/>',
        '<path d="M20 50A30 30 0 0180 50A30 30 0 0120 50z"/>',
    ]
    for body in bodies:
        outline = read(tmp_path, body).outline
        assert hausdorff(outline, disc) < 60 / 1000
        assert len(outline) < 200


def test_holes_and_components(tmp_path: Path) -> None:
    body = '<path d="M10 10h60v60h-60z M20 20v10h10v-10z M80 80h10v10h-10z"/>'
    reading = read(tmp_path, body)
    assert reading.notes == (
        "kept the largest of 2 components (97.3% of the filled area)",
        "filled 1 hole (2.8% of the area)",
    )
    assert hausdorff(reading.outline, box(10, 10, 70, 70)) < NEAR


def test_neighbours_that_all_but_share_an_edge_leave_no_crack(tmp_path: Path) -> None:
    body = '<path d="M10 10H50V50H10z"/><path d="M50.00000000001 5H90V60H50.00000000001z"/>'
    outline = read(tmp_path, body).outline
    assert Polygon(outline).area == pytest.approx(1600 + 2200, rel=2e-3)


def test_extreme_scales_are_refused(tmp_path: Path) -> None:
    with refused("drawing.svg", kind=InputFileError):
        read(tmp_path, f'<g transform="scale(1e-300,1)"><path d="{SQUARE}"/></g>')


def test_prefixed_and_encoded_documents(tmp_path: Path) -> None:
    path = tmp_path / "a.svg"
    text = (
        '<?xml version="1.0" encoding="{}"?><!-- é --><s:svg xmlns:s="http://www.w3.org/2000/svg">'
    )
    text += f'<s:path d="{SQUARE}"/></s:svg>'
    for encoding in ("utf-8", "utf-16", "iso-8859-1", "utf-8-sig"):
        path.write_bytes(text.format(encoding.removesuffix("-sig")).encode(encoding))
        assert hausdorff(read_outline(path).outline, box(10, 20, 40, 50)) < NEAR


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("", "no shape that encloses an area"),
        ('<path d="M0 0L10 0"/>', "no shape that encloses an area"),
        ('<image href="a.png" width="9" height="9"/>', "left out 1 image in another file"),
        ('<path d="M0 0L10 0 0 0z"/>', "no shape that encloses an area"),
        ('<circle r="0"/><rect width="0" height="4"/>', "no shape that encloses an area"),
        ('<g id="a"><use href="#a"/></g>', "no shape that encloses an area"),
        ('<use id="a" href="#b"/><use id="b" href="#a"/>', "no shape that encloses an area"),
        ("<g>" * 200 + "</g>" * 200, "line 1: elements nested more than 100 deep"),
        ("<g/>" * 20_001, "more than 20000 elements"),
        ("<path", "line 1: not well-formed XML"),
    ],
)
def test_drawings_that_cannot_be_read(tmp_path: Path, body: str, message: str) -> None:
    with pytest.raises(InputFileError, match=message) as caught:
        read(tmp_path, body)
    assert str(caught.value).startswith(str(tmp_path))


@pytest.mark.parametrize("value", ["0 0 0 9", "1 2 3", "a b c d", "0 0 nan 4", "0 0 -3 4"])
def test_bad_view_box(tmp_path: Path, value: str) -> None:
    with refused("<svg>", "viewBox", kind=InputFileError):
        read(tmp_path, f'<path d="{SQUARE}"/>', f'viewBox="{value}"')


def test_bad_size(tmp_path: Path) -> None:
    with refused("<svg>", "width", "wide", kind=InputFileError):
        read(tmp_path, f'<path d="{SQUARE}"/>', 'width="wide" height="3"')


def test_uses_that_multiply_are_refused(tmp_path: Path) -> None:
    levels = "".join(f'<g id="l{i + 1}">' + f'<use href="#l{i}"/>' * 10 + "</g>" for i in range(12))
    with refused("cannot be drawn", kind=InputFileError):
        read(tmp_path, f'<defs><path id="l0" d="{SQUARE}"/>{levels}</defs><use href="#l12"/>')


def test_what_is_too_intricate_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(svg, "MAX_CURVE_POINTS", 1000)
    with refused("drawing.svg", kind=InputFileError):
        read(tmp_path, f'<path d="M0 0{"h1v1" * 90}z"/>')
