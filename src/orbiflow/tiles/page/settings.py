"""What all pages of copies have in common; lengths in mm."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from orbiflow.drawing import DEFAULT_PALETTE, PaletteName
from orbiflow.settings import (
    MILLIMETRES,
    DefaultText,
    FileSettings,
    LineWidth,
    Option,
    PageArea,
    PageLength,
    Range,
    Unit,
)

USUAL_WIDTH = 0.25  # width in mm of the lines around tiles
MARKS_EDGE = 10.0  # distance in mm of registration marks from the page's edge

ColourRule = Literal["neighbour", "aspect", "one"]
"""Which tiles have the same colour."""


def usual_tolerance(tile_size: float) -> float:
    """Return the usual distance in mm of curves from the outline of a tile of this size."""
    return max(0.05, tile_size / 400)


class PageSettings(FileSettings):
    """A page with copies of a tile; lengths in mm, or in pixels of so many to an inch.

    What is made of such a page derives its settings from these.
    """

    area: Annotated[PageArea | None, DefaultText("300x200mm")] = None
    """Width and height of the page, or its name: A4, A4-landscape, letter, mug, phone; single or
    double, a journal's columns; square or story, a post's 1080 x 1080 or 1920 pixels."""

    tile_size: PageLength | None = None
    """Longer side of the tile's smallest rectangle."""

    rotate: Annotated[float, Range(-360, 360), Unit("degrees")] = 0.0
    """Turn the tiling on the page by this angle, counterclockwise."""

    clip: Annotated[bool, Option("--clip", off="--whole")] = True
    """Cut tiles at the page's edge, or leave out those that are not whole."""

    palette: PaletteName = DEFAULT_PALETTE
    """Colours of the tiles."""

    colour: ColourRule = "neighbour"
    """With neighbour, neighbours differ; with aspect, there is one colour for each way that tiles lie;
    with one, all are alike."""

    outline: Annotated[LineWidth | None, DefaultText("what suits the page")] = None
    """Width of the lines between tiles."""

    dpi: Annotated[float, Range(1, 10_000)] = 300.0
    """Pixels per inch."""

    @property
    def pixels(self) -> float:
        """Pixels in a millimetre."""
        return self.dpi / MILLIMETRES["in"]

    @property
    def page(self) -> tuple[float, float]:
        """Width and height in mm of what is drawn on."""
        return self.area or (300.0, 200.0)

    def in_pixels(self) -> Self:
        """Return the same settings where a millimetre is a pixel."""
        by = self.pixels
        lengths = {"tile_size": self.tile_size, "outline": self.outline}
        scaled = {name: by * value for name, value in lengths.items() if value is not None}
        width, height = self.page
        return self.replace(area=(by * width, by * height), dpi=MILLIMETRES["in"], **scaled)
