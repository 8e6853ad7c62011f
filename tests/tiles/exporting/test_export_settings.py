"""Settings that cannot be met are refused by their names, presets give way, lengths have units."""

import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from exported import scenes, tile_of
from orbiflow.errors import SettingError
from orbiflow.settings import MILLIMETRES, PAGES, Length, LengthOrZero, PageSize, length
from orbiflow.settings.kinds import RefusedValue, kind_of
from orbiflow.settings.units import length_or_none, page_size, signed_length, size
from orbiflow.tiles import ExportSettings
from refusals import refused


@pytest.mark.parametrize(
    ("options", "about"),
    [
        *(({"tile_size": 0.0}, "tile_size"), ({"tile_size": float("nan")}, "tile_size")),
        *(({"area": (0.0, 100.0)}, "area 1"), ({"area": (100.0,)}, "area")),
        *(({"area": 300}, "area 300"), ({"area": "300x200"}, "area '300x200'")),
        *(({"area": (300, "200")}, "area 2"), ({"bed": {300, 200}}, "bed")),
        *(({"stroke": 5}, "stroke 5"), ({"palette": 5}, "palette 5")),
        *(({"bed": (100.0, -1.0)}, "bed 2"), ({"format": "bmp"}, "format svg bmp")),
        *(({"cut": "half"}, "cut template"), ({"cut": "pieces", "copies": 0}, "copies 1")),
        *(({"copies": 3}, "copies cut"), ({"kerf": 0.1}, "kerf cut")),
        *(
            ({"cut": "skeleton", "clearance": 0.1}, "clearance"),
            ({"cut": "pieces", "tray": 9}, "tray"),
        ),
        *(({"cut": "jigsaw", "bed": (99, 80)}, "bed"), ({"cut": "jigsaw", "clip": True}, "clip")),
        *(({"cut": "jigsaw", "kerf": 0.1}, "kerf"), ({"cut": "skeleton", "kerf": 0.1}, "kerf cut")),
        ({"cut": "pieces", "rotate": 30}, "rotate cut pieces"),
        *(({"cut": "pieces", "clip": True}, "clip"), ({"border": True}, "border cut")),
        ({"border": True, "cut": "skeleton"}, "border clip"),
        *(({"kerf": -1.0, "cut": "pieces"}, "kerf"), ({"tolerance": 10.0}, "tolerance 10 40 2")),
        *(({"palette": "neon"}, "palette neon"), ({"stroke": "red"}, "stroke")),
        *(({"warn_neck": -1.0}, "warn_neck"), ({"margin": 100.0}, "margin 100 300")),
        *(({"dpi": 0.5}, "dpi 10000"), ({"dpi": 600.0, "format": "svg"}, "dpi format")),
        ({"purpose": "oven"}, "purpose laser"),
        ({"purpose": "web", "colours": 3}, "'colours'"),
        ({"cut": "skeleton", "colour": "one"}, "colour cut"),
        ({"cut": "skeleton", "outline": "none"}, "cut skeleton"),
        ({"filled": False, "palette": "sea"}, "palette filled"),
    ],
)
def test_refused(options, about: str) -> None:
    with refused(*about.split(), kind=SettingError):
        ExportSettings(**options)


def test_pages_without_edge_are_filled_and_printed_pieces_keep_off_the_edge() -> None:
    assert ExportSettings(area=PAGES["phone"]).clip
    assert ExportSettings(area=(180, 90)).clip
    assert not ExportSettings(area=PAGES["phone"], clip=False).clip
    assert not ExportSettings(area=PAGES["phone"], cut="pieces").clip
    assert not ExportSettings(area=PAGES["a4"]).clip
    assert not ExportSettings(area=PAGES["phone"], purpose="stickers").clip
    assert ExportSettings(purpose="print", cut="pieces").margin == 5
    assert ExportSettings(purpose="print", cut="pieces", margin=0).margin == 0
    assert ExportSettings(purpose="print").margin == ExportSettings(cut="pieces").margin == 0


def test_beds_have_names_as_pages_have() -> None:
    named: dict[str, Any] = {"bed": "A4-landscape", "area": "A2"}
    assert ExportSettings(**named).bed == (297, 210)


def test_a_file_s_ending_goes_before_the_purpose_and_after_the_format() -> None:
    paper = ExportSettings(purpose="paper")
    assert paper.for_file(None).format == "pdf"
    assert paper.for_file(Path("a.SVG")).format == "svg"
    assert ExportSettings().for_file(Path("a")).format == "svg"
    assert ExportSettings(format="png").for_file(Path("a.eps")).format == "png"
    with refused("out", ".svg", "format", "png", kind=SettingError):
        ExportSettings(format="png").for_file(Path("a.svg"))
    with refused("out", ".eps", "format", kind=SettingError):
        paper.for_file(Path("a.eps"))
    with refused("dpi", "format", "svg", kind=SettingError):
        ExportSettings(dpi=600).for_file(Path("a.svg"))


def test_a_page_smaller_than_a_tile_says_what_is_needed() -> None:
    tile = tile_of("IH2")
    small = ExportSettings(area=(35.0, 20.0))
    with refused("35 x 20 mm", "38.7 x 33.5 mm") as caught:
        scenes(tile, small)
    needed = str(caught.value).split("needs ")[1].split(" mm")[0]
    width, height = map(float, needed.split(" x "))
    (scene,), _ = scenes(tile, ExportSettings(area=(width + 0.1, height + 0.1)))
    assert len(scene.tiles) >= 1


def test_necks_are_named_with_their_place() -> None:
    _, notes = scenes(tile_of("IH2"), ExportSettings(warn_neck=60.0))
    assert notes[0].startswith("the tile is thinner than 60 mm: ")
    assert "mm from its left and" in notes[0]
    assert scenes(tile_of("IH2"), ExportSettings(warn_neck=0.1))[1] == ()


@given(st.floats(1e-3, 1e3), st.sampled_from(list(MILLIMETRES)))
def test_what_is_written_is_read(number: float, unit: str) -> None:
    assert math.isclose(length(f" {number!r} {unit.upper()} "), number * MILLIMETRES[unit])
    width, height = size(f"{number!r}{unit}x2cm")
    assert math.isclose(width, number * MILLIMETRES[unit])
    assert height == 20


@pytest.mark.parametrize(
    ("text", "about"),
    [
        *(("40", "40mm"), ("40px", "'px'"), ("mm", "40mm"), ("", "length"), ("-3mm", "-3mm")),
        *(("1e9mm", "100 m"), ("1e999mm", "100 m"), ("nanmm", "nanmm"), ("40mm cm", "40mm cm")),
    ],
)
def test_no_lengths(text: str, about: str) -> None:
    with refused(about):
        length(text)


@pytest.mark.parametrize("text", ["0", "0.0 mm"])
def test_zero_where_it_is_one(text: str) -> None:
    assert length(text) == kind_of(LengthOrZero).read(text) == 0
    with refused(0, 20000, kind=RefusedValue):
        kind_of(Length).read(text)


@pytest.mark.parametrize(
    ("text", "about"),
    [
        *(("300x200", "300x200mm"), ("300mm", "300x200mm"), ("300x200x10mm", "300x200mm")),
        *(("-3x200mm", "300x200mm"), ("300x200ft", "'ft'")),
    ],
)
def test_no_sizes(text: str, about: str) -> None:
    with refused(about):
        size(text)


def test_no_size_is_without_area() -> None:
    with refused("entry 1", "0.0", kind=RefusedValue):
        kind_of(PageSize).read("0x200mm")


@pytest.mark.parametrize(
    ("text", "page"),
    [
        *(("A4", (210, 297)), ("a4-Landscape", (297, 210)), ("mug", (228.6, 88.9))),
        *(("mug-portrait", (88.9, 228.6)), ("tabloid", (279.4, 431.8)), ("double", (180, 120))),
        ("1in x 5cm", (25.4, 50)),
    ],
)
def test_pages_by_name(text: str, page: tuple[float, float]) -> None:
    assert page_size(text) == pytest.approx(page)


@pytest.mark.parametrize("text", ["A9", "A4-upright", "paper", ""])
def test_pages_that_nobody_knows(text: str) -> None:
    with refused(text, "a4", "letter", "-landscape"):
        page_size(text)


def test_posts_are_pixels_whatever_the_resolution() -> None:
    for dpi in (72, 600):
        assert page_size("Square", dpi) == pytest.approx((1080 * 25.4 / dpi, 1080 * 25.4 / dpi))
    with refused("page"):
        page_size("square")


@given(st.floats(0.01, 1e3), st.floats(1, 1e4))
def test_pixels_have_a_size_where_their_number_in_an_inch_is_known(number, dpi) -> None:
    assert math.isclose(length(f"{number!r}px", dpi), number * 25.4 / dpi)
    assert size(f"{number!r}x3px", dpi)[1] == pytest.approx(3 * 25.4 / dpi)
    assert length_or_none("None", dpi) == 0
    with refused("px", "mm", "pt"):
        length(f"{number!r}px")
    with refused("mm", "in", "px"):
        length(f"{number!r}", dpi)


@given(st.floats(0.01, 1e3))
def test_a_sign_before_a_length(number: float) -> None:
    assert signed_length(f" -{number!r}mm") == -signed_length(f"{number!r}mm") == -number
    with refused("length"):
        signed_length(f"--{number!r}mm")
