"""Artwork from start to end: what is on the tile, the page, and its pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orbiflow.arrays import Array
from orbiflow.drawing import palette
from orbiflow.runtime import Cancel
from orbiflow.tiles.art.drawings import paint_motif
from orbiflow.tiles.art.engraving import engraved, eyes
from orbiflow.tiles.art.page import ArtPage, art_page
from orbiflow.tiles.art.pictures import Picture, carried_picture
from orbiflow.tiles.art.raster import (
    Grid,
    Paint,
    render_page,
)
from orbiflow.tiles.art.settings import ArtSettings
from orbiflow.tiles.art.source import with_map
from orbiflow.tiles.exporting import (
    Curve,
    Motif,
    Part,
    Style,
)
from orbiflow.tiles.tile import EscherTile, TileSource

FINER = 1.5
"""Texels of the tile's raster a pixel."""

OUTLINE = 120
"""The usual outline is the tile's size through this."""


@dataclass(frozen=True, eq=False)
class Artwork:
    """All that a picture is made from.

    - `tile`: with its map.
    - `settings`: as they were given.
    - `page`: which copies, where.
    - `picture`: over the silhouette, or None.
    - `motif`: drawn over the picture, in the tile's units.
    - `notes`: what the user should know.
    """

    tile: EscherTile
    settings: ArtSettings
    page: ArtPage
    picture: Picture | None
    motif: Motif
    notes: tuple[str, ...]

    @property
    def outline(self) -> float:
        """Width in pixels."""
        width = self.settings.outline
        return max(1.0, self.page.tile_size / OUTLINE) if width is None else width

    def _repr_png_(self) -> bytes:
        """What a notebook shows."""
        from orbiflow.tiles.art.scene import png_of

        return png_of(render_artwork(self), self.settings.dpi)


def artwork(
    tile: TileSource,
    settings: ArtSettings | None = None,
    *,
    picture: Picture | None = None,
    drawing: Motif | None = None,
    notes: tuple[str, ...] = (),
) -> Artwork:
    """Prepare a picture of a tiling with something on its tiles.

    Args:
        tile: in memory, or a run's folder; see `with_map`.
        settings: see `ArtSettings`.
        picture: colours over the silhouette, see `read_picture`.
        drawing: carried already; `read_over` gives either, and `notes`.

    Raises:
        OrbiflowError: for a picture or an eye where there is no map of the silhouette, an eye outside
            it, too many tiles, and where no rectangle repeats.
    """
    settings, tile = settings or ArtSettings(), with_map(tile)
    if picture is not None or drawing is not None or settings.eyes:
        tile.require_map()
    page = art_page(tile, settings)
    parts: tuple[Part, ...] = () if drawing is None else drawing.parts
    around = eyes(tile, settings.eyes, palette(settings.palette))
    if settings.strokes is not None:
        parts += engraved(tile, settings.strokes, around)
    parts += tuple(part for eye in around for part in eye.parts)
    short = palette(settings.palette).shortage(page.count)
    said = (*tile.notes, *notes, *page.notes, *short)
    return Artwork(tile, settings, page, picture, Motif(parts), said)


def render_artwork(art: Artwork, *, cancel: Cancel | None = None) -> np.ndarray:
    """The picture (height, width, 3), 8 bits, antialiased.

    Raises:
        Cancelled: if it was told to stop.
    """
    return render_on(art, art.page, cancel=cancel)


def render_on(art: Artwork, page: ArtPage, *, cancel: Cancel | None = None) -> np.ndarray:
    """As `render_artwork`, of another part of the same plane."""
    settings, chosen = art.settings, palette(art.settings.palette)
    grid = raster_grid(art)
    coloured = painted(art, grid).coloured(chosen, art.page.count)
    return render_page(page, grid, coloured, chosen.paper, samples=settings.samples, cancel=cancel)


def raster_grid(art: Artwork) -> Grid:
    """The tile's raster, as fine as the page asks for."""
    return Grid.over(art.page.tile.polygon, FINER * art.page.scale, art.page.count)


def picture_paint(art: Artwork, grid: Grid) -> Paint:
    """The tile's raster with nothing but the picture."""
    paint = Paint(grid)
    if art.picture is None:
        return paint
    paint.lay(*carried_picture(art.picture, art.tile, grid))
    paint.bleed(grid.inside(art.page.tile.polygon))
    return paint


def painted(art: Artwork, grid: Grid) -> Paint:
    """The tile's raster."""
    polygon = art.page.tile.polygon
    paint = picture_paint(art, grid)
    if art.motif.parts:
        paint_motif(paint, art.motif)
        paint.bleed(grid.inside(polygon))
    if art.outline > 0:
        paint_motif(paint, outlined(polygon, art.outline / art.page.scale, art))
    return paint


def outlined(polygon: Array, width: float, art: Artwork) -> Motif:
    """The line around a tile, half of its width inside."""
    style = Style(None, palette(art.settings.palette).outline, width)
    return Motif((Part((Curve.polyline(polygon, closed=True),), style),))
