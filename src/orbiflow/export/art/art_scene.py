"""Artwork as a scene: the drawing once, a use of it for each copy, a layer a colour."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image

from orbiflow import __version__
from orbiflow.export.art.making import Artwork, picture_paint, raster_grid
from orbiflow.export.curves import Curve
from orbiflow.export.drawing import INCH
from orbiflow.export.scene import Box, Layer, Motif, Raster, Scene, Style, Uses
from orbiflow.export.tiling_scene import rectangle
from orbiflow.figures.palette import palette

TILE, MOTIF = "tile", "motif"


def art_scene(art: Artwork) -> Scene:
    """The page in millimetres, as `render_artwork` draws it.

    A picture of pixels becomes one inside the drawing, carried already.
    """
    page, chosen = art.page, palette(art.settings.palette)
    unit = INCH / art.settings.dpi  # a pixel in mm
    linear, offset = unit * page.linear, unit * page.offset
    tile = page.tile
    # about the tile's own middle: transforms are then rounded least
    middle = tile.center
    symbol = Curve.polyline(tile.polygon - middle, closed=True)
    motif = Motif(art.motif.parts, _rasters(art), TILE).moved(np.eye(2), -middle)
    copies = page.copies
    turned = linear @ tile.group.linear_parts
    places = copies.translations @ linear.T + offset + (turned @ middle)[copies.cosets]
    # symbols in mm, so that decimals suit them
    scale = unit * page.scale
    turned = turned / scale
    symbols = {TILE: symbol.moved(scale * np.eye(2), np.zeros(2))}
    motifs = {MOTIF: motif.moved(scale * np.eye(2), np.zeros(2))}
    box = Box(0.0, 0.0, unit * page.width, unit * page.height)
    width = unit * art.outline
    layers = [Layer("paper", "paper", Style(fill=chosen.paper), (rectangle(box),))]
    drawn = bool(motif.parts or motif.rasters)
    for colour in sorted(set(page.colours.tolist())):
        own = page.colours == colour
        fill, name = chosen.fill(colour), f"colour {colour + 1}"
        # a hair of the tile's own colour closes the seams that viewers leave between neighbours
        style = Style(fill, fill, 0.3 * unit)
        uses = Uses(TILE, turned, copies.cosets[own], places[own])
        layers.append(Layer(name, "tiles", style, (uses,), clipped=True))
        if drawn:
            uses = Uses(MOTIF, turned, copies.cosets[own], places[own])
            name, ink = f"drawing on {name}", chosen.ink(colour)
            layers.append(Layer(name, "tiles", Style(), (uses,), clipped=True, ink=ink))
    if art.outline > 0:
        style = Style(None, chosen.outline, width)
        uses = Uses(TILE, turned, copies.cosets, places)
        layers.append(Layer("outlines", "tiles", style, (uses,), clipped=True))
    notes = (f"Artwork of {tile.isohedral_class or 'a tile'}, made with orbiflow {__version__}.",)
    return Scene(
        box.width,
        box.height,
        tuple(layers),
        symbols,
        window=box,
        title=art.tile.given.name,
        notes=notes,
        motifs=motifs if drawn else {},
    )


def _rasters(art: Artwork) -> tuple[Raster, ...]:
    if art.picture is None:
        return ()
    grid = raster_grid(art)
    values = picture_paint(art, grid).values
    alpha = 1 - values[..., 3:4]
    straight = values[..., :3] / np.maximum(alpha, 1e-6)
    both = np.concatenate([straight, alpha], axis=2)
    image = Image.fromarray((both * 255 + 0.5).clip(0, 255).astype(np.uint8), "RGBA")
    buffer = io.BytesIO()
    image.save(buffer, "PNG")
    linear = np.eye(2) / grid.density
    return (Raster(buffer.getvalue(), image.size, linear, grid.corner),)
