"""SVG drawings that are hostile, or that only look as if they were, and what is told about them."""

import pytest
import shapely

from orbiflow.errors import InputFileError
from orbiflow.tiles import Reading, read_outline
from orbiflow.tiles.silhouette import FileContent
from orbiflow.tiles.silhouette.readers import svg_css, svg_drawing
from refusals import refused

SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100">'
SQUARE = '<path d="M10 10h50v50h-50z"/>'
SMALL = '<rect width="1" height="1"/>'
ILLUSTRATOR = """<?xml version="1.0" encoding="utf-8"?>
<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "http://www.w3.org/Graphics/SVG/1.1/DTD/svg11.dtd" [
  <!ENTITY ns_svg "http://www.w3.org/2000/svg">
  <!ENTITY ns_ai "http://ns.adobe.com/AdobeIllustrator/10.0/">
  <!ENTITY st0 "fill:none;stroke:#231F20;stroke-width:2">
]>
<svg xmlns="&ns_svg;" xmlns:i="&ns_ai;" viewBox="0 0 100 100"><switch>
<foreignObject requiredExtensions="&ns_ai;" width="1" height="1"><i:pgfRef/></foreignObject>
<g i:extraneous="self"><path style="&st0;" d="M10 10h50v50h-50z"/></g></switch></svg>"""


def read(text: str) -> Reading:
    return read_outline(FileContent(text.encode(), "drawing.svg"))


def body(text: str) -> Reading:
    return read(f"{SVG}{text}</svg>")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "<style>q g g g g g g g g path{x:y;fill:none}</style>" + "<g>" * 95 + "<path/>",
            "too long",
        ),
        ("<style>q ~ rect{fill:none}</style>" + SMALL * 900, "takes too long to apply"),
        ("<style>:nth-last-child(2 of rect){fill:none}</style>" + SMALL * 900, "too long"),
        ("<style>:has(:has(q)){fill:none}</style>" + "<g>" * 90 + SMALL * 500, "too long"),
        ("<style>rect:nth-of-type(3n){fill:none}</style>" + SMALL * 900, "too long"),
        (
            f"<style>{''.join(f'[a{k}]{{fill:red}}' for k in range(900))}</style>" + SMALL * 900,
            "too",
        ),
        ("<style>" + "a," * 6000 + "b{fill:none}</style>", "more than 5000 selectors"),
        ("<style>a{b:" + "(" * 9000 + "}</style>", "brackets nest too deeply"),
        ("<style>" + ":not(" * 90 + "q" + ")" * 90 + "{fill:none}</style>", "brackets nest"),
        ("<style>" + "/**/" * 60_000 + "</style>", "<style> of 240000 characters"),
        (
            "".join(f'<path style="fill:#000;-x:{"y" * 9000}{k}" d=""/>' for k in range(460)),
            "more than 4000000 characters of style",
        ),
        (
            '<g style="transform-box:fill-box;transform:rotate(1deg)">' * 90 + SQUARE,
            "draws more than 1000 elements",
        ),
        (
            '<mask id="a" mask="url(#a)"><rect width="9" height="9"/></mask>'
            '<rect width="9" height="9" mask="url(#a)"/>',
            "in a circle",
        ),
        ('<symbol id="a"><use href="#a"/></symbol><use href="#a"/>', "in a circle"),
        (f'<g transform="scale(1e999)">{SQUARE}</g>', "beyond 1e\\+12 user units"),
        (
            '<path stroke="#000" stroke-dasharray="1" pathLength="1e8" d="M0 10H90"/>',
            "more than 200000 points",
        ),
    ],
)
def test_what_would_take_too_long_is_refused(text: str, message: str, monkeypatch) -> None:
    monkeypatch.setattr(svg_css, "MAX_STEPS", 100_000)
    monkeypatch.setattr(svg_drawing, "MAX_DRAWN", 1000)
    closed = text + "</g>" * (text.count("<g>") + text.count("<g style") - text.count("</g>"))
    with pytest.raises(InputFileError, match=message):
        body(closed)


@pytest.mark.parametrize(
    "text",
    [
        # values that would grow without end, or refer to each other in a circle
        f'<g style="{";".join(f"--a{k}:var(--a{k + 1})var(--a{k + 1})" for k in range(30))}">'
        f'<path style="fill:var(--a0)" d="M10 10h50v50h-50z"/></g>',
        '<g style="--a:var(--b);--b:var(--a)"><path style="fill:var(--a)" d="M10 10h50v50h-50z"/></g>',
        f'<path style="fill:{"var(--a," * 40}red{")" * 40}" d="M10 10h50v50h-50z"/>',
        f'<path style="fill:{"(" * 9000}" d="M10 10h50v50h-50z"/>',
        f"<style>{'g ' * 450}path{{fill:none}}</style>{SQUARE}",
        "<style>}}}}{{;;@@@ <!-- --> !important{} a{:;:::!important;fill:!important} \\ url( </style>"
        + SQUARE,
        "<style>@namespace;@namespace a b c;@media;@import;@;[*|a]{fill:none}*|*{fill:red}</style>"
        + SQUARE,
        f'<linearGradient id="a" href="#b"/><linearGradient id="b" href="#a"/>{SQUARE}',
        f'{SQUARE}<rect fill="rgb(1e999 0 0)"/><rect fill="color()"/><rect fill="lab(nan% 1e300 0)"/>',
        f'<linearGradient id="g" gradientTransform="scale(0)"><stop/><stop/></linearGradient>{SQUARE}'
        '<rect width="9" height="9" fill="url(#g)"/>',
        f'<g style="font-size:1e308em"><g style="font-size:1e308em">{SQUARE}</g></g>',
    ],
)
def test_what_makes_no_sense_is_passed_over(text: str) -> None:
    assert shapely.Polygon(body(text).outline).area == pytest.approx(2500)


def test_plain_entities_are_read_as_illustrator_writes_them() -> None:
    reading = read(ILLUSTRATOR)
    assert shapely.Polygon(reading.outline).area == pytest.approx(52**2)
    assert reading.notes == ("filled 1 hole (85.2% of the area)",)


@pytest.mark.parametrize(
    ("entity", "text"),
    [
        ('<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">', ""),
        ('<!ENTITY a SYSTEM "file:///etc/hostname">', "&a;"),
        ('<!ENTITY a "<path/>">', "&a;"),
        (f'<!ENTITY a "{"x" * 9000}">', "&a;" * 9000),
        ("".join(f'<!ENTITY a{k} "x">' for k in range(200)), ""),
        ('<!ENTITY % a "x">', ""),
    ],
)
def test_entities_that_can_grow_or_reach_out_are_refused(entity: str, text: str) -> None:
    with refused("drawing.svg", "entity", kind=InputFileError):
        read(f"<!DOCTYPE svg [{entity}]>{SVG}{text}{SQUARE}</svg>")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('<svg xmlns="http://www.w3.org/1999/xhtml"/>', "the namespace of <svg> is"),
        ('<html xmlns="http://www.w3.org/1999/xhtml"/>', "the XML is a <html>"),
        (
            f'{SVG}<rect x="200" y="5" width="20" height="20"/></svg>',
            "nothing lies on the page 0 0 100",
        ),
        (f'{SVG}<rect width="9vw" height="20"/></svg>', "width '9vw' is not a length"),
    ],
)
def test_the_cause_of_a_refusal(text: str, message: str) -> None:
    with pytest.raises(InputFileError, match=message):
        read(text)


def test_style_sheets_in_other_files_are_noted() -> None:
    reading = read(f'<?xml-stylesheet href="a.css"?>{SVG}{SQUARE}</svg>')
    assert reading.notes == ("style sheets in other files are not read",)


def test_notes_are_not_without_end() -> None:
    odd = "".join(f'<use href="#nothing{k}"/>' for k in range(40))
    notes = body(odd + SQUARE).notes
    assert len(notes) == 13
    assert notes[-1] == "and 28 more notes of this kind"


def test_what_reaches_hardly_beyond_the_page_is_kept_whole() -> None:
    reading = body('<rect x="-.05" width="60" height="50"/>')
    assert shapely.Polygon(reading.outline).area == pytest.approx(3000)
    assert reading.notes == ()


def test_what_is_left_out_is_counted_once() -> None:
    group = '<g style="transform:scale(.5);transform-box:fill-box"><text>Hm</text>{}</g>'
    reading = body(group.format(SQUARE + '<use href="#nothing"/>'))
    assert reading.notes == (
        "left out 1 text of the drawing",
        "<use> refers to '#nothing', which is not there",
    )
