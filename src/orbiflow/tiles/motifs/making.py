"""The one drawing that every copy of a tile carries, and the pixels of a picture under it."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image

from orbiflow.drawing import Palette
from orbiflow.tiles.motifs.engraving import engraved, eye
from orbiflow.tiles.motifs.raster import Grid, Paint
from orbiflow.tiles.motifs.settings import MotifSettings
from orbiflow.tiles.motifs.source import Picture, carried_picture
from orbiflow.tiles.scene import Motif, Raster
from orbiflow.tiles.tile import EscherTile


def drawn_motif(
    tile: EscherTile,
    settings: MotifSettings,
    palette: Palette,
    drawing: Motif | None = None,
    *,
    hairlines: bool = False,
) -> Motif:
    """Return what is drawn on a tile, in its units: a drawing, engraved lines, then eyes.

    Engraved lines are regions that swell and taper, or `hairlines` along their middle.

    Raises:
        OrbiflowError: If there is a drawing or an eye but no map of the silhouette, or an eye lies
            outside the silhouette.
    """
    if drawing is not None or settings.eyes:
        tile.require_map()
    parts = () if drawing is None else drawing.parts
    around = [eye(tile, given, palette) for given in settings.eyes]
    if settings.strokes is not None:
        parts += engraved(tile, settings.strokes, around, hairlines=hairlines)
    return Motif(parts + tuple(part for one in around for part in one.parts))


def picture_paint(
    picture: Picture | None, tile: EscherTile, density: float, colours: int = 1
) -> Paint:
    """Paint a tile's raster of `density` texels along its unit with a picture alone."""
    polygon = tile.tile.polygon
    paint = Paint(Grid.over(polygon, density, colours))
    if picture is not None:
        paint.lay(*carried_picture(picture, tile, paint.grid))
        paint.bleed(paint.grid.inside(polygon))
    return paint


def carried_raster(picture: Picture, tile: EscherTile, density: float, colours: int = 1) -> Raster:
    """Return a picture carried onto a tile, in its units, with `density` pixels along one."""
    paint = picture_paint(picture, tile, density, colours)
    values, grid = paint.values, paint.grid
    alpha = 1 - values[..., 3:4]
    straight = values[..., :3] / np.maximum(alpha, 1e-6)
    both = np.concatenate([straight, alpha], axis=2)
    image = Image.fromarray((both * 255 + 0.5).clip(0, 255).astype(np.uint8), "RGBA")
    buffer = io.BytesIO()
    image.save(buffer, "PNG")
    return Raster(buffer.getvalue(), image.size, np.eye(2) / grid.density, grid.corner)
