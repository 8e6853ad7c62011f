"""Whether copies that carry a picture can be told apart: it must not be as dark as their outlines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.drawing import Palette
from orbiflow.errors import Advice
from orbiflow.tiles.motifs.carried import Over
from orbiflow.tiles.motifs.on_figures import figure_paint
from orbiflow.tiles.motifs.raster import rgb_of
from orbiflow.tiles.page import Motif
from orbiflow.tiles.silhouette import lab_of
from orbiflow.tiles.tile import EscherTile

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
    lightness, line = lab_of(colours[inside])[:, 0], float(lab_of(rgb_of(outline))[0])
    differs = np.abs(lightness - line) >= MIN_LIGHTNESS_DIFFERENCE
    return bool(differs.size) and float(differs.mean()) >= MIN_SHARE_APART


def notes_on_dark_pictures(
    tile: EscherTile, overs: Sequence[Over | None], chosen: Palette
) -> tuple[str, ...]:
    """Return what to say of pictures whose copies cannot be told apart."""
    found: list[str] = []
    for part, over in zip(tile.figures, overs, strict=False):
        if over is None or not (over.picture or over.drawing):
            continue
        density = TEXELS_ACROSS / float(np.sqrt(abs(part.figure.tile.signed_area)))
        drawn = over.drawing or Motif()
        paint = figure_paint(over.picture, drawn, part.figure, density, 1)
        inside = paint.grid.inside(part.figure.tile.polygon)
        if not are_told_apart(paint.coloured(chosen, 1)[0], inside, chosen.outline):
            found.append(
                "the picture is as dark as the lines around tiles, and its copies can hardly be told "
                "apart: leave it out, or choose lines of another colour, such as {palette} "
                f"{','.join(own.lstrip('#') for own in chosen.colours[:3])},outline=ffffff"
            )
    return tuple(map(Advice, dict.fromkeys(found)))
