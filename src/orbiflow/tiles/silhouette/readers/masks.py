"""Masks, pictures whose light or opaque part is selected."""

from dataclasses import dataclass

import numpy as np
from PIL import Image

from orbiflow.arrays import Array
from orbiflow.errors import InputFileError
from orbiflow.tiles.silhouette.readers.pictures import (
    MIN_CONTRAST,
    averaged,
    deep_channel,
    open_image,
    upright,
)
from orbiflow.tiles.silhouette.readers.reading import Source

_PAINT = "paint what must survive white and the rest black"


@dataclass(frozen=True)
class MaskReading:
    """A mask as found in a file.

    - `levels`: Levels (H, W), 0 to 1, each a mean of `reduced` x `reduced` pixels of the file.
    - `size`: The width and height in pixels of the file.
    - `notes`: What was decided for the user, in plain words.
    """

    levels: Array
    size: tuple[int, int]
    reduced: int
    notes: tuple[str, ...]


def read_mask(path: Source) -> MaskReading:
    """Read a mask from a PNG, JPEG or WebP image, turned as its EXIF orientation asks.

    The level is the opacity where some of the mask is more transparent than the rest, else the
    luminance. Raises `InputFileError` for a file over 64 MB or 40 megapixels, one that is no image
    or is damaged, and a mask that is all of one level.
    """
    return open_image(path, _decode)


def _decode(path: Source, image: Image.Image) -> MaskReading:
    turned, notes = upright(image)
    band, band_notes = _channel(path, turned)
    levels, reduced = averaged(band)
    low, high = float(levels.min()), float(levels.max())
    if high < MIN_CONTRAST:
        raise InputFileError(f"{path}: the mask is all black and emphasises nothing; {_PAINT}")
    if high - low < MIN_CONTRAST:
        raise InputFileError(
            f"{path}: the mask is uniform, its levels are {low:.2f} to {high:.2f} of white, and "
            f"emphasises nothing above the rest; {_PAINT}"
        )
    return MaskReading(levels, turned.size, reduced, (*notes, *band_notes))


def _channel(path: Source, image: Image.Image) -> tuple[Image.Image, list[str]]:
    """Return the channel that emphasises: mode "L" (0 to 255) or "F" (0 to 1)."""
    if image.mode.startswith(("I", "F")):
        return deep_channel(path, image), []
    if not image.has_transparency_data:
        return image.convert("L"), []
    rgba = image.convert("RGBA")
    alpha = rgba.getchannel("A")
    values = np.asarray(alpha)
    low, high = int(values.min()), int(values.max())
    if high - low >= MIN_CONTRAST * 255:
        return alpha, ["took the mask's alpha channel: opaque is emphasised, whatever its colour"]
    if high < MIN_CONTRAST * 255:
        raise InputFileError(
            f"{path}: the mask is wholly transparent and emphasises nothing; paint what must "
            "survive opaque"
        )
    return rgba.convert("RGB").convert("L"), []
