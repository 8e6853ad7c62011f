"""How artwork is made; lengths in pixels of the picture."""

from __future__ import annotations

from typing import Annotated, Literal

from orbiflow.drawing import PaletteName
from orbiflow.settings import (
    DefaultText,
    FileSettings,
    Hidden,
    NotWith,
    OnlyWith,
    Option,
    Parsed,
    Range,
    SettingError,
    Unit,
)
from orbiflow.tiles.motifs import MotifSettings
from orbiflow.units import pixel_size, pixels

MOST_PIXELS = 100_000_000  # the largest number of pixels of a picture
LONGEST = 30_000  # the longest side of a picture in pixels
SMALLEST_TILE = 8.0  # the size of a tile in pixels below which it shows nothing


def line_width(text: str, dpi: float) -> float:
    """Return the width of a line in pixels; 0 for "none"."""
    return 0.0 if text.strip().lower() == "none" else pixels(text, dpi)


class ArtSettings(FileSettings, MotifSettings, group="Picture"):
    """How a picture of a tiling is made; numbers of a length are pixels."""

    format: Annotated[Literal["png", "svg"] | None, Hidden()] = None
    """Format of the file. Default: its ending, or png."""

    size: Annotated[
        tuple[Annotated[float, Range(1, LONGEST)], Annotated[float, Range(1, LONGEST)]],
        Parsed(pixel_size, "a size such as 3000x2000 or 300x200mm", "SIZE", needs="dpi"),
        NotWith("repeat", because="the cell that repeats has its own size"),
        DefaultText("3000x2000"),
    ] = (3000, 2000)
    """Width and height of the picture: pixels such as 3000x2000, or lengths such as 300x200mm."""

    tile_size: Annotated[
        float | None,
        Parsed(pixels, "pixels such as 400, or a length such as 40mm", "LENGTH", needs="dpi"),
        Range(SMALLEST_TILE, 2 * LONGEST),
        Unit("pixels"),
        DefaultText("about 25 tiles on the page"),
    ] = None
    """Longer side of the tile's smallest rectangle: pixels, or a length such as 40mm."""

    rotate: Annotated[
        float, Range(-360, 360), Unit("degrees"), NotWith("repeat", because="it turns as it must")
    ] = 0.0
    """Turn the tiling on the page by this angle, counterclockwise."""

    clip: Annotated[bool, Option("--clip", off="--whole"), NotWith("repeat")] = True
    """Cut tiles at the page's edge, or leave out those that are not whole."""

    repeat: Literal["basic", "brick", "half-drop"] | None = None
    """Make the cell that repeats without seams, instead of a page: row on row, with each row moved by
    half a width, or with each column moved by half a height."""

    tolerance: Annotated[float, Range(0, 0.2), OnlyWith(repeat=("basic", "brick", "half-drop"))] = (
        0.02
    )
    """How much that cell may be stretched to be a rectangle; 0.02 is 2 %."""

    palette: PaletteName = "earth"
    """Colours of the tiles."""

    colour: Literal["aspect", "neighbour", "one"] = "neighbour"
    """With aspect, one colour for each way that tiles lie; with neighbour, neighbours differ; with
    one, all are alike."""

    outline: Annotated[
        float | None,
        Parsed(
            line_width, "pixels such as 3, a length such as 0.3mm, or none", "LENGTH", needs="dpi"
        ),
        Range(0, 1000),
        Unit("pixels"),
        DefaultText("1/120 of the tile's size"),
    ] = None
    """Width of the lines between tiles: pixels, a length such as 0.3mm, or none."""

    dpi: Annotated[float, Range(1, 10_000)] = 300.0
    """Pixels per inch."""

    samples: Annotated[int, Range(1, 8), Hidden()] = 3
    """Number of samples along each side of a pixel."""

    def check(self) -> None:
        super().check()
        check_size(*self.size)


def check_size(*sides: float) -> None:
    """Check that a picture of this width and height is not too large."""
    width, height = map(round, sides)
    if max(width, height) > LONGEST or width * height > MOST_PIXELS:
        raise SettingError(
            f"a picture of {width} x {height} pixels is too large ({{size}}); at most "
            f"{MOST_PIXELS // 10**6} megapixels are made, {LONGEST} along a side"
        )
