"""Artwork as a file."""

from __future__ import annotations

import io

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
    image = Image.fromarray(render_artwork(art, cancel=cancel))
    buffer = io.BytesIO()
    dpi = art.settings.dpi
    image.save(buffer, "PNG", dpi=(dpi, dpi), compress_level=5)
    return buffer.getvalue()
