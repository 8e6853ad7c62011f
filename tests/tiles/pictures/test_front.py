"""The picture of a choice between deformation and overlap."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.tiles import EscherTile, Tile, isohedral_class
from orbiflow.tiles.pictures import front_png
from orbiflow.tiles.pictures.front import COLOURS, PALE, _apart

HOUSE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 3.0], [0.0, 2.0]])


def share(image: Array, colour: str) -> float:
    rgb = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    return float((np.abs(image.astype(int) - rgb).max(axis=-1) <= 2).mean())


def found(deformation: float, iou: float, objective: str, front: bool = True) -> EscherTile:
    tile = EscherTile(Tile(HOUSE, isohedral_class("IH4").group(), "IH4"), front=front)
    metrics = replace(tile.metrics, iou=iou)
    return tile.changed(deformation=deformation, metrics=metrics, objective=objective)


def test_listed_tiles_are_coloured_and_others_pale() -> None:
    chosen = [found(0.1, 0.7, "likeness"), found(0.3, 0.9, "overlap")]
    data = front_png(chosen, [found(0.2, 0.75, "likeness", front=False)], width_px=800)
    image = np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))
    assert image.shape == (560, 800, 3)
    areas = [share(image, colour) for colour in (*COLOURS.values(), PALE)]
    assert areas[0] > 2 * areas[2]
    assert areas[1] > 2 * areas[2]
    assert areas[2] > 1e-4
    # the better overlap is higher up, and further to the right
    middles = []
    for colour in COLOURS.values():
        rgb = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
        below = np.abs(image[60:].astype(int) - rgb).max(axis=-1) <= 2
        middles.append(np.argwhere(below).mean(axis=0))
    assert middles[1][0] < middles[0][0]
    assert middles[1][1] > middles[0][1]


@pytest.mark.parametrize("count", [1, 12])
def test_equal_points_make_room(count: int) -> None:
    data = front_png([found(0.2, 0.8, "likeness")] * count, width_px=600)
    assert Image.open(io.BytesIO(data)).size == (600, 420)
    corner = np.array([0.0, 0.0]), np.array([600.0, 420.0])
    places = _apart(np.full((count, 2), 200.0), 50.0, corner)
    far = np.linalg.norm(places[:, None] - places[None], axis=2) + 1e3 * np.eye(count)
    assert far.min() > 35


def test_nothing_to_draw() -> None:
    with pytest.raises(OrbiflowError, match="at least one tile"):
        front_png([])
