"""How artwork is made; lengths in pixels of the picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from orbiflow.arguments import number, whole
from orbiflow.drawing import palette
from orbiflow.errors import OrbiflowError

Colour = Literal["aspect", "neighbour", "one"]
Strokes = Literal["hatch", "echoes", "feathers"]

COLOURS: tuple[Colour, ...] = ("aspect", "neighbour", "one")
STROKES: tuple[Strokes, ...] = ("hatch", "echoes", "feathers")

MOST_PIXELS = 100_000_000
LONGEST = 30_000
"""Of a picture, in all and along a side."""

SMALLEST_TILE = 8.0
"""In pixels: smaller ones show nothing."""


@dataclass(frozen=True)
class ArtSettings:
    """All lengths in pixels.

    - `size`: width and height of the picture.
    - `tile_size`: longer side of the tile's smallest rectangle; None for about 25 tiles on the page.
    - `repeat`: make the cell that repeats without seams; `size` is then its own.
    - `tolerance`: how much that cell may be stretched to be a rectangle, 0.02 for 2 %.
    - `palette`, `colour`: tiles coloured by aspect, so that neighbours differ, or all alike.
    - `outline`: width of the lines between tiles; None for 1/120 of the tile's size, 0 for none.
    - `engrave`: the lines drawn inside the tile, None for none.
    - `eyes`: (x, y) or (x, y, radius) in the silhouette's coordinates.
    - `dpi`: pixels an inch, for files that say their size.
    - `samples`: along each side of a pixel.

    Raises:
        OrbiflowError: for a setting that cannot be used, by its name.
    """

    size: tuple[int, int] = (3000, 2000)
    tile_size: float | None = None
    repeat: bool = False
    tolerance: float = 0.02
    palette: str = "earth"
    colour: Colour = "neighbour"
    outline: float | None = None
    engrave: Strokes | None = None
    eyes: tuple[tuple[float, ...], ...] = ()
    dpi: float = 300.0
    samples: int = 3

    def __post_init__(self) -> None:
        check_size(*self.size)
        if self.tile_size is not None:
            number(self.tile_size, "tile_size", SMALLEST_TILE, 2 * LONGEST)
        number(self.tolerance, "tolerance", 0, 0.2)
        palette(self.palette)
        if self.colour not in COLOURS:
            raise OrbiflowError(f"colour must be one of {', '.join(COLOURS)}, got {self.colour!r}")
        if self.engrave is not None and self.engrave not in STROKES:
            raise OrbiflowError(
                f"engrave must be one of {', '.join(STROKES)}, got {self.engrave!r}"
            )
        if self.outline is not None:
            number(self.outline, "outline", 0, 1000)
        for eye in self.eyes:
            if len(eye) not in (2, 3):
                raise OrbiflowError(f"an eye is x, y or x, y, radius, got {eye!r}")
            for part, name in zip(eye, ("x", "y", "radius"), strict=False):
                number(part, f"an eye's {name}", *((0,) if name == "radius" else ()))
        number(self.dpi, "dpi", 1, 10_000)
        whole(self.samples, "samples", 1, 8)


def check_size(width: int, height: int) -> None:
    """Nothing, if a picture may be as large.

    Raises:
        OrbiflowError: if it has no pixel or too many.
    """
    for side in (width, height):
        whole(side, "a picture's side in pixels", 1, LONGEST)
    if width * height > MOST_PIXELS:
        raise OrbiflowError(
            f"a picture of {width} x {height} pixels is too large; at most "
            f"{MOST_PIXELS // 10**6} megapixels are made"
        )
