"""Squirrels' tiles with their maps, pictures to carry onto them, and a run's folder that holds one."""

from __future__ import annotations

import json
from functools import lru_cache
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from orbiflow.tiles import ArtTile, CarriedTile, ExportTile, Frame, SavedModel
from orbiflow.tiles.art.pictures import Picture
from orbiflow.tiles.search.reports import group_json
from outlines import animal, bent_squirrel, flowless

EYE = (210.0, 190.0)
"""In the squirrel's head."""


@lru_cache(maxsize=32)
def squirrel(name: str) -> ArtTile:
    """A small search's tile of a class, in the input's coordinates."""
    target = animal("squirrel.dat")
    own = bent_squirrel(name)
    carried = CarriedTile.from_bent(own.bent, own.factor, own.shift, own.tile, target.frame)
    assert carried.bending is not None
    return ArtTile(ExportTile(carried.tile, target.y_down, f"squirrel-{name}"), carried)


def upside_down(tile: ArtTile) -> ArtTile:
    """The same with y up: what was at the top of a picture still is."""
    flip, frame = np.diag([1.0, -1.0]), tile.carried.frame
    turned = tile.carried.tile.transformed(flip, np.zeros(2))
    own = Frame(flip @ frame.linear, flip @ frame.offset, frame.kind)
    carried = CarriedTile(turned, own, tile.carried.bending)
    return ArtTile(ExportTile(turned, False, tile.given.name), carried)


def picture(image: Image.Image, tile: ArtTile) -> Picture:
    """An image over the silhouette."""
    return Picture(image.convert("RGBA"), tile.covered)


def size_of(tile: ArtTile, longer: int = 600) -> tuple[int, int]:
    """Of a picture of the silhouette, in pixels."""
    sides = tile.covered.high - tile.covered.low
    width, height = np.rint(sides * longer / sides.max()).astype(int)
    return int(width), int(height)


def flat(tile: ArtTile, colour: str) -> Picture:
    """One colour."""
    return picture(Image.new("RGB", size_of(tile), colour), tile)


def checkerboard(tile: ArtTile, cells: int = 10) -> Picture:
    """Black and white, so many squares along the longer side."""
    width, height = size_of(tile)
    rows, columns = np.indices((height, width)) * cells // max(width, height)
    return picture(Image.fromarray((((rows + columns) % 2) * 255).astype(np.uint8)), tile)


def face(tile: ArtTile) -> Picture:
    """White, with a red disc at the eye."""
    width, height = size_of(tile)
    image = Image.new("RGB", (width, height), "white")
    low, high = tile.covered.low, tile.covered.high
    x, y = (np.array(EYE) - low) / (high - low) * (width, height)
    ImageDraw.Draw(image).ellipse([x - 14, y - 14, x + 14, y + 14], fill="red")
    return picture(image, tile)


def write_run(folder: Path, name: str, *, model: bool = True) -> Path:
    """A run's folder with one tile."""
    target, own, tile = animal("squirrel.dat"), bent_squirrel(name), squirrel(name)
    polygon = tile.carried.tile.polygon
    document = {
        "schema_version": 1,
        "input": {**target.report()},
        "tiles": [
            {
                "class": name,
                "polygon": np.concatenate([polygon, polygon[:1]]).tolist(),
                "corners": list(tile.carried.tile.corners),
                "group": group_json(tile.carried.tile.group),
            }
        ],
    }
    (folder / name).mkdir(parents=True)
    (folder / "result.json").write_text(json.dumps(document))
    if model:
        fitted = flowless(name, own.bent, own.factor, own.shift)
        saved = SavedModel.of(fitted, target.frame, tile.carried.bending)
        (folder / name / "model.safetensors").write_bytes(saved.to_bytes())
    return folder
