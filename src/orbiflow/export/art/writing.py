"""Artwork as a file."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from PIL import Image

from orbiflow.arguments import path as as_path
from orbiflow.cancel import Cancel
from orbiflow.errors import OrbiflowError
from orbiflow.export.art.art_scene import art_scene
from orbiflow.export.art.making import Artwork, artwork, render_artwork
from orbiflow.export.art.over import Over, read_over
from orbiflow.export.art.settings import ArtSettings
from orbiflow.export.art.source import ArtTile
from orbiflow.export.exporting import require_certified
from orbiflow.export.result_file import TileSource
from orbiflow.export.svg_writer import write_svg
from orbiflow.files import write_atomic
from orbiflow.silhouette.target import Target


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
    tile: ArtTile | TileSource,
    out: str | Path,
    settings: ArtSettings | None = None,
    *,
    picture: str | Path | None = None,
    target: Target | None = None,
    force: bool = False,
) -> Path:
    """Write a picture of a tiling with something on its tiles.

    Args:
        tile: in memory, or a run's folder; see `ArtTile.of`.
        out: the file, .png or .svg.
        settings: see `ArtSettings`.
        picture: file of a picture or drawing over the silhouette.
        target: of a search in memory that left no map, such as one for overlap.
        force: take a tile that is not certified.

    Raises:
        CertificationError: for a tile that is not certified.
        InputFileError: for a picture that cannot be read.
        OrbiflowError: for another ending, and as `artwork`.
        OutputError: if the file cannot be written.
    """
    out = as_path(out, "the file to draw to")
    if out.suffix.lower() not in (".png", ".svg"):
        raise OrbiflowError(f"artwork is written to a .png or .svg, got {out.name!r}")
    source = ArtTile.of(tile, target)
    require_certified(source.given, force=force)
    over = Over() if picture is None else read_over(picture, source)
    made = artwork(source, settings, picture=over.picture, drawing=over.drawing, notes=over.notes)
    return write_atomic(out, write_artwork(made, out.suffix))


def png_of(pixels: np.ndarray, dpi: float) -> bytes:
    """Pixels (height, width, 3) as a PNG that says how large they are."""
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG", dpi=(dpi, dpi), compress_level=5)
    return buffer.getvalue()
