"""SVG drawings that are hostile, or that only look as if they were, and what is told about them."""

import base64
import io
from pathlib import Path

import pytest
import shapely
from PIL import Image

from orbiflow.errors import InputFileError
from orbiflow.tiles import Reading, read_outline
from orbiflow.tiles.silhouette import FileContent
from orbiflow.tiles.silhouette.readers import svg, svg_process
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


@pytest.fixture(name="_rendered_here", scope="module", autouse=True)
def rendered_in_a_process_fixture() -> None:
    """Here drawings are rendered in the process that bounds them, as for users."""


def read(text: str) -> Reading:
    return read_outline(FileContent(text.encode(), "drawing.svg"))


def body(text: str) -> Reading:
    return read(f"{SVG}{text}</svg>")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<style>q ~ rect{fill:none}</style>" + SMALL * 5000, "takes too long to apply"),
        ("<style>:nth-last-child(2 of rect){fill:none}</style>" + SMALL * 5000, "too long"),
        ("<style>:has(:has(q)){fill:none}</style>" + SMALL * 5000, "too long"),
        ("<style>" + "a," * 5_000 + "b{fill:none}</style>" + SMALL * 4_100, "too long"),
        ("<style>a{b:" + "(" * 9000 + "}</style>", "too long or nested"),
        ("<style>" + ":not(" * 90 + "q" + ")" * 90 + "{fill:none}</style>", "too long or nested"),
        ("<style>" + "/**/" * 60_000 + "</style>", "too long or nested"),
    ],
)
def test_what_would_take_too_long_is_refused(text: str, message: str) -> None:
    with pytest.raises(InputFileError, match=message):
        body(text)


def bomb(side: int) -> str:
    """A picture of one colour, whose data are a thousandth of its pixels."""
    file = io.BytesIO()
    Image.new("1", (side, side)).save(file, "png")
    return "data:image/png;base64," + base64.b64encode(file.getvalue()).decode()


def linking(*links: str, keys: tuple[str, ...] = ("href", "xlink:href")) -> str:
    """A drawing with links of every kind to pictures beside what it shows."""
    text = "".join(
        f'<image {key}="{link}" x="60" width="40" height="40"/>'
        f'<filter id="f"><feImage {key}="{link}"/></filter>'
        f"<style>@import '{link}';rect{{fill:url({link})}}</style>"
        for link in links
        for key in keys
    )
    return f'{SVG[:-1]} xmlns:xlink="http://www.w3.org/1999/xlink">{text}{SQUARE}</svg>'


def test_nothing_but_the_drawing_is_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    secret = tmp_path / "secret.png"
    Image.new("RGB", (60, 60)).save(secret)
    monkeypatch.chdir(tmp_path)
    inner = b'<svg xmlns="http://www.w3.org/2000/svg"><image href="secret.png" width="9"/></svg>'
    data = "data:image/svg+xml;base64," + base64.b64encode(inner).decode()
    web = "http://127.0.0.1:9/secret.png"
    reading = read(linking(str(secret), secret.name, secret.as_uri(), web, data))
    assert reading.seen is not None
    assert reading.seen.area == pytest.approx(2500, rel=5e-3)
    assert any("left out" in note for note in reading.notes)


@pytest.mark.parametrize("link", [bomb(20_000), "data:image/png;base64,iVBORw0KGgoAAAA"])
def test_pictures_that_are_none_are_refused_or_left_out(link: str) -> None:
    try:
        reading = read(linking(link, keys=("href",)))
    except InputFileError:
        return
    assert reading.seen is not None
    assert reading.seen.area == pytest.approx(2500, rel=5e-3)


@pytest.mark.parametrize(
    "text",
    [
        '<filter id="f"><feTurbulence baseFrequency=".5" numOctaves="99999999"/></filter>'
        f'<g filter="url(#f)">{SQUARE}</g>',
        '<pattern id="p" width="1e9" height="1e9" patternUnits="userSpaceOnUse">'
        '<rect width="1e9" height="1"/></pattern><rect width="90" height="90" fill="url(#p)"/>',
        f'<path d="M0 0L1e9 1e9" stroke="#000" stroke-width="1e8"/>{SQUARE}',
        "".join(f'<g id="a{k}"><use href="#a{k + 1}"/></g>' for k in range(300)),
    ],
    ids=["hangs", "takes all memory", "falls", "nests"],
)
def test_what_the_renderer_cannot_stand_ends_in_an_error(
    text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(svg, "LONG_PIXELS", 1500)
    monkeypatch.setattr(svg, "SMALL_PIXELS", 200)
    with monkeypatch.context() as hasty, refused("drawing.svg", kind=InputFileError):
        hasty.setattr(svg_process, "MAX_WAIT", 1.0)
        body(text)
    assert shapely.Polygon(body(SQUARE).outline).area == pytest.approx(2500, rel=5e-3)


def test_pictures_in_the_drawing_are_seen() -> None:
    data = bomb(30)
    reading = body(f'<image href="{data}" x="20" y="20" width="60" height="60"/>')
    assert shapely.Polygon(reading.outline).area == pytest.approx(3600, rel=5e-3)


def test_texts_are_seen_and_a_font_that_stood_in_is_said() -> None:
    reading = body('<text x="10" y="80" font-size="90" font-family="No Such Font">O</text>')
    assert shapely.Polygon(reading.outline).area == pytest.approx(4500, rel=0.3)
    assert any("'No Such Font' is not on this machine" in note for note in reading.notes)


@pytest.mark.parametrize(
    "text",
    [
        # values that would grow without end, or refer to each other in a circle
        f'<g style="{";".join(f"--a{k}:var(--a{k + 1})var(--a{k + 1})" for k in range(30))}">'
        f'<path style="fill:var(--a0)" d="M10 10h50v50h-50z"/></g>',
        f'<path style="fill:{"var(--a," * 40}red{")" * 40}" d="M10 10h50v50h-50z"/>',
        f'<path style="fill:{"(" * 9000}" d="M10 10h50v50h-50z"/>',
        f"<style>{'g ' * 450}path{{fill:none}}</style>{SQUARE}",
    ],
)
def test_what_makes_no_sense_is_passed_over(text: str) -> None:
    assert shapely.Polygon(body(text).outline).area == pytest.approx(2500, rel=5e-3)


def test_plain_entities_are_read_as_illustrator_writes_them() -> None:
    reading = read(ILLUSTRATOR)
    assert shapely.Polygon(reading.outline).area == pytest.approx(52**2, rel=2e-2)
    assert [note[:13] for note in reading.notes] == ["filled 1 hole"]


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
    assert shapely.Polygon(reading.outline).area == pytest.approx(3000, rel=5e-3)
    assert reading.notes == ()
