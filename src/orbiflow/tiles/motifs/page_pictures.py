"""A picture of a drawing as it is: its page in its colours, where nothing bends."""

from __future__ import annotations

import numpy as np
import shapely
from PIL import Image
from shapely.errors import GEOSException

from orbiflow.arrays import Array
from orbiflow.errors import InputFileError
from orbiflow.tiles.motifs.carried import parts_of
from orbiflow.tiles.silhouette import (
    Covered,
    Drawing,
    FileContent,
    Regions,
    TooManyPoints,
    TooTangled,
)
from orbiflow.tiles.write import PixelSheet, painted, shape_of

FLATNESS_PIXELS = 0.2  # greatest distance of flattened curves from the drawing's, in pixels
MAX_POINTS = 400_000


class _Laid:
    """The map from a drawing's user units to the pixels of its picture."""

    widest = 0.0  # every stroke is an area, so that its ends and corners are the drawing's

    def __init__(self, covered: Covered, size: tuple[int, int]) -> None:
        self.low, self.size = covered.low, float(max(size))
        self.pixels: Array = np.array(size) / (covered.high - covered.low)
        self.scale = float(np.sqrt(self.pixels.prod()))
        self.tolerance = FLATNESS_PIXELS / self.scale

    def __call__(self, points: Array, *, closed: bool) -> Array:
        del closed
        return (points - self.low) * self.pixels


def page_picture(content: FileContent, covered: Covered, size: tuple[int, int]) -> Image.Image:
    """Return what an SVG drawing shows of a rectangle of its user units, as RGBA pixels.

    It is drawn as on a tile: gradients in their mean colour, without pictures and texts, and on nothing
    unless the page has a colour.

    Args:
        content: The drawing's file.
        covered: The rectangle, with y down.
        size: The width and height of the picture.

    Raises:
        InputFileError: If the drawing is too intricate, or no drawing.
    """
    drawing, laid = Drawing(content), _Laid(covered, size)
    regions = Regions(drawing, lambda _: laid.tolerance, MAX_POINTS)
    try:
        parts = [part for shape in drawing.shapes for part in parts_of(shape, regions, laid)]
    except (TooManyPoints, TooTangled, GEOSException, shapely.GEOSException) as error:
        raise InputFileError(f"{content}: too intricate to be drawn; simplify it") from error
    sheet = PixelSheet(tuple(shape_of(part) for part in parts))
    return painted([sheet], size, ground=drawing.ground)
