"""Artwork as a file."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image

from orbiflow.cancel import Cancel
from orbiflow.export.art.art_scene import art_scene
from orbiflow.export.art.making import Artwork, render_artwork
from orbiflow.export.svg_writer import write_svg


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


def png_of(pixels: np.ndarray, dpi: float) -> bytes:
    """Pixels (height, width, 3) as a PNG that says how large they are."""
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG", dpi=(dpi, dpi), compress_level=5)
    return buffer.getvalue()
