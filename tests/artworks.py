"""Squirrels' tiles with their maps, pictures to carry onto them, and a run's folder that holds one."""

import json
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from orbiflow.drawing import palette
from orbiflow.tiles import ArtSettings, EscherTile, Frame, Made, TileMap, Uses, as_map
from orbiflow.tiles.motifs import CarriedPicture, Over, motifs_on
from orbiflow.tiles.page import Motif
from orbiflow.tiles.result_file import group_json
from orbiflow.tiles.search.bent_map import map_of_bent
from outlines import animal, bent_squirrel, flowless

EYE = (210.0, 190.0)
"""In the squirrel's head."""


@lru_cache(maxsize=32)
def squirrel(name: str) -> EscherTile:
    """A small search's tile of a class, in the input's coordinates."""
    target = animal("squirrel.dat")
    own = bent_squirrel(name)
    frame = target.frame
    placed = own.tile.transformed(frame.linear, frame.offset)
    maps = TileMap(frame=frame, bending=map_of_bent(own.bent, own.factor, own.shift, own.tile))
    return EscherTile(placed, y_down=target.y_down, name=f"squirrel-{name}", map_source=maps)


def pixels_of(made: Made) -> np.ndarray:
    """Artwork as pixels (height, width, 3)."""
    return np.asarray(made.image())


def motif_on(tile: EscherTile, settings: ArtSettings, *overs: Over) -> Motif:
    """What lies on a tile of one figure, in its units."""
    chosen = palette(settings.palette)
    return motifs_on(tile, settings, chosen, overs, tint=0.0, density=1.0).motifs[0]


def copies_of(made: Made) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Where artwork of one figure has copies: linear parts and offsets in mm from the symbol, the
    rings, and the number of each one's colour."""
    scene, linear, offsets, colours = made.scenes[0], [], [], []
    filled = [own for own in scene.layers if own.role == "tiles" and own.style.fill]
    for layer in filled:
        for uses in layer.items:
            assert isinstance(uses, Uses)
            linear.append(uses.linear[uses.which])
            offsets.append(uses.offsets)
            colours.append(np.full(len(uses), int(layer.name.removeprefix("colour ")) - 1))
    parts, places = np.concatenate(linear), np.concatenate(offsets)
    symbol = scene.symbols["tile"].pieces[:, 0]
    rings = np.einsum("mij,nj->mni", parts, symbol) + places[:, None]
    return parts, places, rings, np.concatenate(colours)


def art_settings(**options: Any) -> ArtSettings:
    """Settings of artwork, with lengths as people write them."""
    return ArtSettings(**options)


def upside_down(tile: EscherTile) -> EscherTile:
    """The same with y up: what was at the top of a picture still is."""
    bending, frame = tile.require_map()
    flip = np.diag([1.0, -1.0])
    turned = tile.tile.transformed(flip, np.zeros(2))
    own = Frame(flip @ frame.linear, flip @ frame.offset, frame.kind)
    return tile.changed(tile=turned, y_down=False, map_source=TileMap(frame=own, bending=bending))


def picture(image: Image.Image, tile: EscherTile) -> CarriedPicture:
    """An image over the silhouette."""
    return CarriedPicture(image.convert("RGBA"), tile.covered)


def size_of(tile: EscherTile, longer: int = 600) -> tuple[int, int]:
    """Of a picture of the silhouette, in pixels."""
    sides = tile.covered.high - tile.covered.low
    width, height = np.rint(sides * longer / sides.max()).astype(int)
    return int(width), int(height)


def flat(tile: EscherTile, colour: str) -> CarriedPicture:
    """One colour."""
    return picture(Image.new("RGB", size_of(tile), colour), tile)


def checkerboard(tile: EscherTile, cells: int = 10) -> CarriedPicture:
    """Black and white, so many squares along the longer side."""
    width, height = size_of(tile)
    rows, columns = np.indices((height, width)) * cells // max(width, height)
    return picture(Image.fromarray((((rows + columns) % 2) * 255).astype(np.uint8)), tile)


def face(tile: EscherTile) -> CarriedPicture:
    """White, with a red disc at the eye."""
    width, height = size_of(tile)
    image = Image.new("RGB", (width, height), "white")
    low, high = tile.covered[:2]
    x, y = (np.array(EYE) - low) / (high - low) * (width, height)
    ImageDraw.Draw(image).ellipse([x - 14, y - 14, x + 14, y + 14], fill="red")
    return picture(image, tile)


def write_run(folder: Path, name: str, *, model: bool = True) -> Path:
    """A run's folder with one tile."""
    target, own, tile = animal("squirrel.dat"), bent_squirrel(name), squirrel(name)
    polygon = tile.tile.polygon
    document = {
        "schema_version": 2,
        "input": {**target.report()},
        "tiles": [
            {
                "class": name,
                "polygon": np.concatenate([polygon, polygon[:1]]).tolist(),
                "corners": list(tile.tile.corners),
                "group": group_json(tile.tile.group),
            }
        ],
    }
    (folder / name).mkdir(parents=True)
    (folder / "result.json").write_text(json.dumps(document))
    if model:
        fitted = flowless(name, own.bent, own.factor, own.shift)
        saved = as_map(fitted, target.frame, tile.bending)
        (folder / name / "model.safetensors").write_bytes(saved.to_bytes())
    return folder
