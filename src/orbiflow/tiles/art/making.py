"""Artwork: what is on the tile and the page, the pixels that show it, and its file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from orbiflow import __version__
from orbiflow.arguments import as_path
from orbiflow.drawing import palette, png_bytes
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import Cancel, Progress, Sink, ignore, write_atomic
from orbiflow.tiles.art.page import HIDDEN, ArtPage, art_page
from orbiflow.tiles.art.rendering import render_page
from orbiflow.tiles.art.settings import ArtSettings
from orbiflow.tiles.exporting import MOTIF, SYMBOL, tile_layers
from orbiflow.tiles.motifs import (
    Over,
    Paint,
    Picture,
    carried_raster,
    drawn_motif,
    paint_motif,
    picture_paint,
    read_over,
    with_map,
)
from orbiflow.tiles.scene import (
    INCH,
    Box,
    Curve,
    Layer,
    Motif,
    Part,
    Scene,
    Style,
    Uses,
    rectangle,
    write_svg,
)
from orbiflow.tiles.silhouette import Target
from orbiflow.tiles.tile import EscherTile, TileSource

TEXELS_PER_PIXEL = 1.5  # texels of the tile's raster along a pixel of the page
TILE_PER_OUTLINE = 120  # the tile's size over the outline's usual width


@dataclass(frozen=True, eq=False)
class Artwork:
    """Everything that a picture is made from.

    - `tile`: The tile with its map.
    - `settings`: The settings as they were given.
    - `page`: The copies of the tile and where they are.
    - `picture`: The picture over the silhouette, or None.
    - `motif`: What is drawn over the picture, in the tile's units.
    - `notes`: What the user should know.
    """

    tile: EscherTile
    settings: ArtSettings
    page: ArtPage
    picture: Picture | None
    motif: Motif
    notes: tuple[str, ...]

    @property
    def outline(self) -> float:
        """The outline's width in pixels."""
        width = self.settings.outline
        return max(1.0, self.page.tile_size / TILE_PER_OUTLINE) if width is None else width

    @property
    def density(self) -> float:
        """The texels of the tile's raster along its unit."""
        return TEXELS_PER_PIXEL * self.page.scale

    def _repr_png_(self) -> bytes:
        """Return what a notebook shows."""
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
        tile: A tile in memory, or a run's folder; see `with_map`.
        settings: How it is drawn.
        picture, drawing: What lies over the silhouette, as `read_over` returns it.
        notes: What the user should know of picture or drawing.

    Raises:
        OrbiflowError: If a picture or an eye is given but there is no map of the silhouette, an eye
            lies outside it, there are too many tiles, or no rectangle repeats.
    """
    settings, tile = settings or ArtSettings(), with_map(tile)
    if picture is not None:
        tile.require_map()
    page, chosen = art_page(tile, settings), palette(settings.palette)
    motif = drawn_motif(tile, settings, chosen, drawing)
    said = (*tile.notes, *notes, *page.notes, *chosen.shortage(page.count))
    return Artwork(tile, settings, page, picture, motif, said)


def render_artwork(art: Artwork, *, cancel: Cancel | None = None) -> np.ndarray:
    """Render the picture (height, width, 3) in 8 bits, antialiased."""
    page, chosen, samples = art.page, palette(art.settings.palette), art.settings.samples
    paint = painted(art)
    coloured = paint.coloured(chosen, page.count)
    return render_page(page, paint.grid, coloured, chosen.paper, samples=samples, cancel=cancel)


def painted(art: Artwork) -> Paint:
    """Paint the tile's raster with all that is on the tile."""
    polygon = art.page.tile.polygon
    paint = picture_paint(art.picture, art.tile, art.density, art.page.count)
    if art.motif.parts:
        paint_motif(paint, art.motif)
        paint.bleed(paint.grid.inside(polygon))
    if art.outline > 0:
        # half of its width inside
        colour, width = palette(art.settings.palette).outline, art.outline / art.page.scale
        line = Part((Curve.polyline(polygon, closed=True),), Style(None, colour, width))
        paint_motif(paint, Motif((line,)))
    return paint


def art_scene(art: Artwork) -> Scene:
    """Return the page in millimetres, as `render_artwork` draws it, with pixels carried already."""
    page, chosen = art.page, palette(art.settings.palette)
    unit = INCH / art.settings.dpi  # a pixel in mm
    linear, offset = unit * page.linear, unit * page.offset
    tile = page.tile
    # relative to the tile's own middle, so that rounding transforms moves points least
    middle = tile.center
    symbol = Curve.polyline(tile.polygon - middle, closed=True)
    rasters = ()
    if art.picture is not None:
        rasters = (carried_raster(art.picture, art.tile, art.density, page.count),)
    motif = Motif(art.motif.parts, rasters, SYMBOL).moved(np.eye(2), -middle)
    shown = page.colours != HIDDEN
    copies = page.copies.select(shown)
    turned = linear @ tile.group.linear_parts
    places = copies.translations @ linear.T + offset + (turned @ middle)[copies.cosets]
    # symbols in mm, for which the writer's decimals are meant
    scale = unit * page.scale
    turned = turned / scale
    symbols = {SYMBOL: symbol.moved(scale * np.eye(2), np.zeros(2))}
    motifs = {MOTIF: motif.moved(scale * np.eye(2), np.zeros(2))}
    box = Box(0.0, 0.0, unit * page.size[0], unit * page.size[1])
    layers = [Layer("paper", "paper", Style(fill=chosen.paper), (rectangle(box),))]
    drawn = bool(motif.parts or motif.rasters)
    line = Style(None, chosen.outline, unit * art.outline)
    uses, seam = Uses(SYMBOL, turned, copies.cosets, places), 0.3 * unit
    layers += tile_layers(
        uses, page.colours[shown], chosen, line, clipped=True, seam=seam, drawn=drawn
    )
    notes = (f"Artwork of {tile.isohedral_class or 'a tile'}, made with orbiflow {__version__}.",)
    return Scene(
        box.width,
        box.height,
        tuple(layers),
        symbols,
        window=box,
        title=art.tile.name,
        notes=notes,
        motifs=motifs if drawn else {},
    )


def write_artwork(art: Artwork, ending: str, *, cancel: Cancel | None = None) -> bytes | str:
    """Return the content of a file with this ending, .svg, or .png for pixels."""
    if ending.lower() == ".svg":
        return write_svg(art_scene(art))
    return png_of(render_artwork(art, cancel=cancel), art.settings.dpi)


def draw_art(
    tile: TileSource,
    out: str | Path,
    settings: ArtSettings | None = None,
    *,
    picture: str | Path | None = None,
    target: Target | None = None,
    force: bool = False,
    on_event: Sink = ignore,
    cancel: Cancel | None = None,
) -> Artwork:
    """Write a picture of a tiling with something on its tiles, and return what was drawn.

    Args:
        tile, settings, force, on_event, cancel: As for `export`; the tile needs a map for a picture.
        out: The file, .png or .svg.
        picture: The file of a picture or drawing over the silhouette.
        target: The target of a search in memory that left no map, such as one for overlap.

    Raises:
        InputFileError: If the picture cannot be read.
        OrbiflowError: For another ending, as `artwork`, and as `export`.
    """
    out, cancel = as_path(out, "the file to draw to"), cancel or Cancel()
    if out.suffix.lower() not in (".png", ".svg"):
        raise OrbiflowError(f"artwork is written to a .png or .svg, got {out.name!r}")
    source = with_map(tile, target)
    source.require_certified(
        force=force, otherwise="so it is not exported; --force exports it, marked so"
    )
    on_event(Progress(0.0, "laying out"))
    over = Over() if picture is None else read_over(picture, source)
    made = artwork(source, settings, picture=over.picture, drawing=over.drawing, notes=over.notes)
    cancel.check()
    on_event(Progress(0.2, "drawing"))
    content = write_artwork(made, out.suffix, cancel=cancel)
    cancel.check()
    write_atomic(out, content)
    return made


def png_of(pixels: np.ndarray, dpi: float) -> bytes:
    """Return pixels (height, width, 3) as a PNG that gives their resolution."""
    return png_bytes(Image.fromarray(pixels), dpi=(dpi, dpi), compress_level=5)
