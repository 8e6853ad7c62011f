"""Whether copies that carry a picture can be told apart: it must not be as dark as their outlines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.drawing import Palette, rgb
from orbiflow.errors import Advice
from orbiflow.tiles.motifs.carried import Over, carried_picture
from orbiflow.tiles.page import Motif, inside_ring
from orbiflow.tiles.silhouette import lab_of
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.write import texture

MIN_LIGHTNESS_DIFFERENCE = 20.0  # of 100, in CIE Lab: less is hard to tell apart in a line
MIN_SHARE_APART = 0.25  # of a tile: what of it must differ so much from the line around it
TEXELS_ACROSS = 100.0  # of a tile, in which it is judged


def are_told_apart(colours: Array, inside: NDArray[np.bool_], outline: str) -> bool:
    """Return whether a line around a picture shows between copies of it.

    Args:
        colours: The picture (H, W, 3), from 0 to 1.
        inside: Which of its pixels (H, W) are of the tile.
        outline: The colour of the line, as #rrggbb.
    """
    lightness, line = lab_of(colours[inside])[:, 0], float(lab_of(np.array(rgb(outline)) / 255)[0])
    differs = np.abs(lightness - line) >= MIN_LIGHTNESS_DIFFERENCE
    return bool(differs.size) and float(differs.mean()) >= MIN_SHARE_APART


def notes_on_dark_pictures(
    tile: EscherTile, overs: Sequence[Over | None], chosen: Palette
) -> tuple[str, ...]:
    """Return what to say of pictures whose copies cannot be told apart."""
    notes: list[str] = []
    for part, over in zip(tile.figures, overs, strict=False):
        if over is None or not (over.picture or over.drawing):
            continue
        figure = part.figure
        density = TEXELS_ACROSS / float(np.sqrt(abs(figure.tile.signed_area)))
        drawn, rasters = over.drawing or Motif(), ()
        if over.picture is not None:
            rasters = (carried_picture(over.picture, figure, density),)
        polygon = figure.tile.polygon
        seen = texture(Motif(drawn.parts, rasters), polygon, density, ink=chosen.ink(0))
        opacity, ground = seen.pixels[..., 3:] / 255, np.array(rgb(chosen.fill(0))) / 255
        colours = opacity * seen.pixels[..., :3] / 255 + (1 - opacity) * ground
        inside = inside_ring((polygon - seen.offset) / seen.linear[0, 0], *colours.shape[:2])
        if not are_told_apart(colours, inside, chosen.outline):
            notes.append(
                "the picture is as dark as the lines around tiles, and its copies can hardly be told "
                "apart: leave it out, or choose lines of another colour, such as {palette} "
                f"{','.join(colour.lstrip('#') for colour in chosen.colours[:3])},outline=ffffff"
            )
    return tuple(map(Advice, dict.fromkeys(notes)))
