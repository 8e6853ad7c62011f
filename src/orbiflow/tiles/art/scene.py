"""Artwork as a scene: the drawing once, a use of it for each copy, a layer a colour."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from PIL import Image

from orbiflow import __version__
from orbiflow.arguments import path as as_path
from orbiflow.drawing import palette
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import Cancel, Progress, Sink, ignore, write_atomic
from orbiflow.tiles.art.drawings import Over, read_over
from orbiflow.tiles.art.making import (
    Artwork,
    artwork,
    picture_paint,
    raster_grid,
    render_artwork,
)
from orbiflow.tiles.art.settings import ArtSettings
from orbiflow.tiles.art.source import with_map
from orbiflow.tiles.exporting import (
    INCH,
    Box,
    Curve,
    Layer,
    Motif,
    Raster,
    Scene,
    Style,
    Uses,
    rectangle,
    write_svg,
)
from orbiflow.tiles.silhouette import Target
from orbiflow.tiles.tile import TileSource

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
        title=art.tile.name,
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


def write_artwork(art: Artwork, ending: str, *, cancel: Cancel | None = None) -> bytes | str:
    """The contents of a file.

    Args:
        art: see `artwork`.
        ending: ".svg", or ".png" for pixels.

    Raises:
        Cancelled: if it was told to stop.
    """
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
        tile: A tile in memory, or a run's folder; see `with_map`.
        out: The file, .png or .svg.
        settings: How it is drawn.
        picture: The file of a picture or drawing over the silhouette.
        target: The target of a search in memory that left no map, such as one for overlap.
        force: Take a tile that is not certified.
        on_event: Called with the `Progress`.
        cancel: Stops the work; nothing is then written.

    Raises:
        CertificationError: If the tile is not certified.
        InputFileError: If the picture cannot be read.
        OrbiflowError: For another ending, and as `artwork`.
        OutputError: If the file cannot be written.
        Cancelled: If it was cancelled.
    """
    out, cancel = as_path(out, "the file to draw to"), cancel or Cancel()
    if out.suffix.lower() not in (".png", ".svg"):
        raise OrbiflowError(f"artwork is written to a .png or .svg, got {out.name!r}")
    source = with_map(tile, target)
    source.require_certified(
        force=force, otherwise="so it is not exported; --force exports it, marked so"
    )
    on_event(Progress(0.0, "laying out"))
    if picture is not None:
        source.require_map()
    over = Over() if picture is None else read_over(picture, source)
    made = artwork(source, settings, picture=over.picture, drawing=over.drawing, notes=over.notes)
    cancel.check()
    on_event(Progress(0.2, "drawing"))
    content = write_artwork(made, out.suffix, cancel=cancel)
    cancel.check()
    write_atomic(out, content)
    return made


def png_of(pixels: np.ndarray, dpi: float) -> bytes:
    """Pixels (height, width, 3) as a PNG that says how large they are."""
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG", dpi=(dpi, dpi), compress_level=5)
    return buffer.getvalue()
