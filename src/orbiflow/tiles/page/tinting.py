"""What lies on a tile seen through the tile's colour, as through glass."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from orbiflow.arrays import Array
from orbiflow.drawing import rgb
from orbiflow.tiles.page.scene import INK, Motif, PathPart, Raster, Warped

Picture = TypeVar("Picture", bound=Raster | Warped)


def glass(colour: str, tint: float) -> Array:
    """Return the shares (3,) of red, green and blue that a colour lets through at a tint of 0 to 1.

    >>> glass("#ff8000", 0.5).round(2).tolist()
    [1.0, 0.75, 0.5]
    """
    return 1 - tint * (1 - np.array(rgb(colour)) / 255)


def tinted(motif: Motif, through: Array) -> Motif:
    """Return a motif as seen through `glass`; what is drawn in a layer's ink stays."""

    def seen(colour: str | None) -> str | None:
        if colour is None or colour == INK:
            return colour
        return "#" + "".join(f"{round(v):02x}" for v in np.array(rgb(colour)) * through)

    def part(path: PathPart) -> PathPart:
        style = path.style._replace(fill=seen(path.style.fill), stroke=seen(path.style.stroke))
        return path._replace(style=style)

    parts = tuple(map(part, motif.parts))
    rasters = tuple(tinted_picture(raster, through) for raster in motif.rasters)
    return replace(motif, parts=parts, rasters=rasters)


def tinted_picture(picture: Picture, through: Array) -> Picture:
    """Return a picture of pixels as seen through `glass`."""
    seen = picture.pixels * np.array([*through, 1.0], dtype=np.float32) + np.float32(0.5)
    return picture._replace(pixels=seen.astype(np.uint8))
