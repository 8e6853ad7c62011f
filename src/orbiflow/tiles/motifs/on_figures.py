"""What all figures of a tile carry, read and drawn once, whatever page or frame shows it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from typing import NamedTuple

from orbiflow.drawing import Palette
from orbiflow.tiles.motifs.carried import (
    CarriedPicture,
    Over,
    drawn_motif,
    paint_motif,
    picture_paint,
)
from orbiflow.tiles.motifs.raster import Paint
from orbiflow.tiles.motifs.settings import MotifSettings
from orbiflow.tiles.page import Motif
from orbiflow.tiles.tile import EscherTile

TEXELS_PER_PIXEL = 1.5
"""Texels of a figure's raster along a pixel of what is drawn."""


class FigurePictures(NamedTuple):
    """What lies on the figures of a tile.

    - `pictures`: The picture over the silhouette of each figure, or None.
    - `motifs`: What is drawn over these, in each figure's units.
    - `tint`: How much each copy's colour tints all that; 0 where nothing from a file lies there.
    - `notes`: What the user should know of it.
    """

    pictures: tuple[CarriedPicture | None, ...]
    motifs: tuple[Motif, ...]
    tint: float
    notes: tuple[str, ...]


def worn(
    tile: EscherTile,
    settings: MotifSettings,
    palette: Palette,
    overs: Sequence[Over | None],
    tint: float,
) -> FigurePictures:
    """Return what lies on a tile with a map; `overs` are as `read_over` returns them.

    Raises:
        OrbiflowError: If a picture or an eye is given but there is no map of the silhouette, or an eye
            lies outside it.
    """
    figures = [part.figure for part in tile.figures]
    known = [over or Over() for over, _ in zip_longest(overs, figures)]
    for over, figure in zip(known, figures, strict=True):
        if over.picture is not None:
            figure.require_map()
    motifs = tuple(
        drawn_motif(figure, settings.of_figure(number), palette, over.drawing)
        for number, (over, figure) in enumerate(zip(known, figures, strict=True))
    )
    return FigurePictures(
        tuple(over.picture for over in known),
        motifs,
        tint * any(over.picture or over.drawing for over in known),
        tuple(note for own in (*figures, *known) for note in own.notes),
    )


def figure_paint(
    picture: CarriedPicture | None, motif: Motif, figure: EscherTile, density: float, colours: int
) -> Paint:
    """Paint a figure's raster, of `density` texels along its unit, with all that lies on it."""
    paint = picture_paint(picture, figure, density, colours)
    if motif.parts:
        paint_motif(paint, motif)
        paint.bleed(paint.grid.inside(figure.tile.polygon))
    return paint
