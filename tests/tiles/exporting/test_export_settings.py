"""Settings that cannot be met are refused by their names, and presets give way to what is asked."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from exported import tile_of
from orbiflow.errors import OrbiflowError, SettingError
from orbiflow.settings import PAGES
from orbiflow.tiles import ExportSettings, scenes
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
        ({"cut": "skeleton", "clearance": 0.1}, "clearance cut"),
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
    with refused("35 x 20 mm", "38.7 x 33.5 mm"):
        scenes(tile, small)
    message = ""
    try:
        scenes(tile, small)
    except OrbiflowError as error:
        message = str(error)
    width, height = (
        float(side) for side in message.split("needs ")[1].split(" mm")[0].split(" x ")
    )
    (scene,), _ = scenes(tile, ExportSettings(area=(width + 0.1, height + 0.1)))
    assert len(scene.tiles) >= 1


def test_necks_are_named_with_their_place() -> None:
    _, notes = scenes(tile_of("IH2"), ExportSettings(warn_neck=60.0))
    assert notes[0].startswith("the tile is thinner than 60 mm: ")
    assert "mm from its left and" in notes[0]
    assert scenes(tile_of("IH2"), ExportSettings(warn_neck=0.1))[1] == ()
