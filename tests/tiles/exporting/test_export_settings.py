"""Settings that cannot be met are refused by their names, and presets give way to what is asked."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from exported import tile_of
from orbiflow.errors import OrbiflowError, SettingError
from orbiflow.tiles import ExportSettings, scenes
from orbiflow.units import PAGES
from refusals import refused


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tile_size": 0.0}, "tile_size must be above 0"),
        ({"tile_size": float("nan")}, "tile_size must be"),
        ({"area": (0.0, 100.0)}, "area: entry 1: must be above 0"),
        ({"area": (100.0,)}, "area must be a size"),
        ({"area": 300}, "area must be a size .*got 300"),
        ({"area": "300x200"}, "area: '300x200' has no unit"),
        ({"area": (300, "200")}, "area: entry 2: must be a number above 0"),
        ({"bed": {300, 200}}, "bed must be a size"),
        ({"stroke": 5}, "stroke must be a colour .*got 5"),
        ({"palette": 5}, "palette must be a palette's name, .*got 5"),
        ({"bed": (100.0, -1.0)}, "bed: entry 2: must be above 0"),
        ({"format": "bmp"}, "format must be svg, pdf, dxf, png, json or html, got 'bmp'"),
        ({"cut": "half"}, "cut must be none, skeleton, pieces, jigsaw or template"),
        ({"cut": "pieces", "copies": 0}, "copies must be .*at least 1"),
        ({"copies": 3}, "copies applies only to cut pieces, not to none"),
        ({"kerf": 0.1}, "kerf applies only to cut pieces"),
        ({"cut": "skeleton", "clearance": 0.1}, "clearance applies only to cut pieces"),
        ({"cut": "pieces", "clip": True}, "clip applies only to"),
        ({"border": True}, "border applies only to cut skeleton"),
        ({"border": True, "cut": "skeleton"}, "border applies only to clip"),
        ({"kerf": -1.0, "cut": "pieces"}, "kerf must be"),
        ({"tolerance": 10.0}, "tolerance of 10 mm .*tile of 40 mm; choose at most 2 mm"),
        ({"palette": "neon"}, "palette: unknown palette 'neon'"),
        ({"stroke": "red"}, "stroke: .*a colour"),
        ({"warn_neck": -1.0}, "warn_neck must be .*from 0"),
        ({"margin": 100.0}, "margin of 100 mm leaves nothing of a page of 300 x 200 mm"),
        ({"dpi": 0.5}, "dpi must be .*from 1 to 10000"),
        ({"dpi": 600.0, "format": "svg"}, "dpi applies only to format png"),
        ({"purpose": "oven"}, "purpose must be laser"),
        ({"purpose": "web", "colours": 3}, "no setting 'colours'"),
        ({"cut": "skeleton", "colour": "one"}, "colour applies only to cut none"),
        ({"cut": "skeleton", "outline": "none"}, "leaves cut skeleton without a line"),
        ({"filled": False, "palette": "sea"}, "palette has no effect: .*filled"),
    ],
)
def test_refused(options, message: str) -> None:
    with pytest.raises(SettingError, match=message):
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


def test_purposes() -> None:
    laser = ExportSettings(purpose="laser")
    assert (laser.file_format, laser.cut, laser.clip) == ("svg", "skeleton", False)
    assert (laser.stroke, laser.outline) == ("#ff0000", 0.01)
    assert ExportSettings(purpose="print").file_format == "pdf"
    assert ExportSettings(purpose="print").clip
    assert ExportSettings(purpose="print", cut="pieces", clearance=0.2).clip is False
    assert ExportSettings(purpose="web", clip=False).clip is False
    assert ExportSettings(purpose="plotter").stroke == "#000000"


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
