"""Settings that cannot be met are refused by their names, and presets give way to what is asked."""

from __future__ import annotations

import pytest

from exported import tile_of
from orbiflow.errors import OrbiflowError
from orbiflow.tiles import ExportSettings, scenes


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tile_size": 0.0}, "tile_size must be above 0"),
        ({"tile_size": float("nan")}, "tile_size must be"),
        ({"area": (0.0, 100.0)}, "area must be above 0"),
        ({"area": (100.0,)}, "area must be a width and a height"),
        ({"area": 300}, "area must be a width and a height in mm, got 300"),
        ({"area": "300x200mm"}, "area must be a width and a height in mm, got '300x200mm'"),
        ({"area": (300, "200")}, "area must be a number above 0"),
        ({"bed": {300, 200}}, "bed must be a width and a height in mm"),
        ({"stroke": 5}, "stroke must be a colour such as #ff0000, got 5"),
        ({"palette": 5}, "a palette must be a str, got 5; a name or colours"),
        ({"bed": (100.0, -1.0)}, "bed must be above 0"),
        ({"format": "bmp"}, "format must be one of svg, pdf, dxf, png, json, got 'bmp'"),
        ({"cut": "half"}, "cut must be one of none, skeleton, pieces"),
        ({"cut": "pieces", "copies": 0}, "copies must be at least 1"),
        ({"copies": 3}, "copies belongs to cut pieces, not to cut none"),
        ({"kerf": 0.1}, "kerf belongs to cut pieces"),
        ({"cut": "skeleton", "clearance": 0.1}, "clearance belongs to cut pieces"),
        ({"cut": "pieces", "clip": True}, "clip belongs to"),
        ({"border": True}, "border belongs to cut skeleton with clip"),
        ({"kerf": -1.0, "cut": "pieces"}, "kerf must be"),
        ({"tolerance": 10.0}, "would not leave the shape of a tile of 40 mm; choose at most 2 mm"),
        ({"palette": "neon"}, "unknown palette 'neon'"),
        ({"stroke": "red"}, "a colour such as #ff0000"),
        ({"warn_neck": 0.0}, "warn_neck must be above 0"),
    ],
)
def test_refused(options, message: str) -> None:
    with pytest.raises(OrbiflowError, match=message):
        ExportSettings(**options)


def test_presets() -> None:
    laser = ExportSettings.preset("laser")
    assert (laser.format, laser.cut, laser.clip) == ("svg", "skeleton", False)
    assert (laser.stroke, laser.stroke_width) == ("#ff0000", 0.01)
    assert ExportSettings.preset("print").format == "pdf"
    assert ExportSettings.preset("print").clip
    assert ExportSettings.preset("print", cut="pieces", clearance=0.2).clip is False
    assert ExportSettings.preset("web", clip=False).clip is False
    assert ExportSettings.preset("plotter").stroke == "#000000"
    with pytest.raises(OrbiflowError, match="unknown preset 'oven'"):
        ExportSettings.preset("oven")
    with pytest.raises(OrbiflowError, match="no export setting 'colour'"):
        ExportSettings.preset("web", colour=3)


def test_a_page_smaller_than_a_tile_says_what_is_needed() -> None:
    tile = tile_of("IH2")
    small = ExportSettings(area=(35.0, 20.0))
    with pytest.raises(OrbiflowError, match=r"it needs \d+\.\d x \d+\.\d mm; choose a larger"):
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
