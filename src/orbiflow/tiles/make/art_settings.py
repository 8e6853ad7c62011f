"""How artwork is made: a page of copies as pixels, or as curves in an SVG."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from orbiflow.drawing import PaletteName
from orbiflow.settings import (
    DefaultText,
    Hidden,
    NotWith,
    OnlyWith,
    Option,
    Range,
    SettingError,
    Unit,
)
from orbiflow.tiles.motifs import MotifSettings, TintSettings
from orbiflow.tiles.page import PageSettings
from orbiflow.units import LineWidth, PageArea, PageLength

MOST_PIXELS = 100_000_000  # the largest number of pixels of a picture
LONGEST = 30_000  # the longest side of a picture in pixels
SMALLEST_TILE = 8.0  # the size of a tile in pixels below which it shows nothing


class ArtSettings(PageSettings, MotifSettings, TintSettings, group="Picture"):
    """How a picture of a tiling is made.

    >>> ArtSettings(area="600x400px", dpi=100).area
    (152.4, 101.6)
    """

    format: Annotated[Literal["png", "svg"] | None, Hidden()] = None
    """Format of the file. Default: its ending, or png."""

    area: Annotated[
        PageArea | None,
        NotWith("repeat", because="the cell that repeats has its own size"),
        DefaultText("3000x2000px"),
    ] = None

    tile_size: Annotated[PageLength | None, DefaultText("about 25 tiles on the page")] = None

    rotate: Annotated[
        float, Range(-360, 360), Unit("degrees"), NotWith("repeat", because="it turns as it must")
    ] = 0.0

    clip: Annotated[bool, Option("--clip", off="--whole"), NotWith("repeat")] = True

    palette: PaletteName = "earth"

    outline: Annotated[LineWidth | None, DefaultText("1/120 of the tile's size")] = None

    repeat: Literal["basic", "brick", "half-drop"] | None = None
    """Make the cell that repeats without seams, instead of a page: row on row, with each row moved by
    half a width, or with each column moved by half a height."""

    stretch: Annotated[float, Range(0, 0.2), OnlyWith(repeat=("basic", "brick", "half-drop"))] = (
        0.02
    )
    """How much that cell may be stretched to be a rectangle; 0.02 is 2 %."""

    samples: Annotated[int, Range(1, 8), Hidden()] = 3
    """Number of samples along each side of a pixel."""

    def defaults(self) -> Mapping[str, Any]:
        return {**super().defaults(), "area": "3000x2000px"}

    def check(self) -> None:
        super().check()
        width, height = self.page
        check_size(width * self.pixels, height * self.pixels)
        if self.tile_size is not None and self.tile_size * self.pixels < SMALLEST_TILE - 1e-9:
            raise SettingError(
                f"a tile of {self.tile_size * self.pixels:.1f} pixels shows nothing ({{tile_size}}); "
                f"choose at least {SMALLEST_TILE:g}px"
            )


def check_size(*sides: float) -> None:
    """Check that a picture of this width and height in pixels can be made."""
    width, height = map(round, sides)
    if max(width, height) > LONGEST or width * height > MOST_PIXELS:
        raise SettingError(
            f"a picture of {width} x {height} pixels is too large ({{area}}); at most "
            f"{MOST_PIXELS // 10**6} megapixels are made, {LONGEST} along a side"
        )
    if min(width, height) < 1:
        raise SettingError(f"a picture of {width} x {height} pixels shows nothing ({{area}})")
