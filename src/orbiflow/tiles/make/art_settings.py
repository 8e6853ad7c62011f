"""How artwork is made: a page of copies as pixels, or as curves in an SVG."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, TypeAlias

from orbiflow.drawing import PaletteName
from orbiflow.errors import OrbiflowError, SettingError
from orbiflow.settings import (
    DefaultText,
    Hidden,
    LineWidth,
    NotWith,
    OnlyWith,
    Option,
    PageArea,
    PageLength,
    Parsed,
    Range,
    Unit,
)
from orbiflow.tiles.motifs import MotifSettings, TintSettings
from orbiflow.tiles.page import PageSettings

MOST_ORDER, MOST_ARMS = 12, 60  # of a centre of rotation, and steps along a lattice vector
LONGEST_BAND = 12  # heights: beyond 15 places can no longer be told apart
MOST_PIXELS = 100_000_000  # the largest number of pixels of a picture
LONGEST = 30_000  # the longest side of a picture in pixels
SMALLEST_TILE = 8.0  # the size of a tile in pixels below which it shows nothing


World = Literal["sphere", "disc", "half-plane", "band", "spiral", "cylinder"]
CURVED = {"sphere": 1, "disc": -1, "half-plane": -1, "band": -1}
"""The worlds that are curved as a sphere, 1, or hyperbolic, -1."""
TURNED = ("sphere", "disc", "half-plane", "band", "spiral", None)
COPIES = {"12": (2, 3, 3), "24": (2, 3, 4), "60": (2, 3, 5)}


def order_numbers(text: str) -> tuple[int, ...]:
    """Return the orders of centres of rotation.

    >>> order_numbers("60"), order_numbers("3, 3,4"), order_numbers("3")
    ((2, 3, 5), (3, 3, 4), (3,))
    """
    if text.strip() in COPIES:
        return COPIES[text.strip()]
    return _whole_numbers(
        text, (1, 2, 3, 4), "up to four whole numbers from 2 to 12, such as 2,3,5, or 12, 24 or 60"
    )


def arm_numbers(text: str) -> tuple[int, ...]:
    """Return the steps of a spiral along two lattice vectors."""
    return _whole_numbers(text, (2,), "two whole numbers, such as 3,5")


def _whole_numbers(text: str, counts: Sequence[int], what: str) -> tuple[int, ...]:
    try:
        numbers = tuple(int(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) not in counts:
        raise OrbiflowError(f"{text!a:.60} is not {what}")
    return numbers


Orders: TypeAlias = Annotated[
    tuple[int, ...], Parsed(order_numbers, "orders or a number of copies", "ORDERS")
]
Arms: TypeAlias = Annotated[tuple[int, int], Parsed(arm_numbers, "two whole numbers", "M,N")]


class ArtSettings(PageSettings, MotifSettings, TintSettings, group="Picture"):
    """How a picture of a tiling is made.

    >>> ArtSettings(area="600x400px", dpi=100).area
    (152.4, 101.6)
    """

    format: Annotated[Literal["png", "svg", "pdf", "html"] | None, Hidden()] = None
    """Format of the file. Default: its ending, or png. A sphere or a disc as html is turned by hand."""

    area: Annotated[
        PageArea | None,
        NotWith("repeat", because="the cell that repeats has its own size"),
        DefaultText("3000x2000px"),
    ] = None

    tile_size: Annotated[
        PageLength | None,
        OnlyWith(world=("cylinder", None), because="copies elsewhere have sizes of their own"),
        DefaultText("about 25 tiles on the page"),
    ] = None

    rotate: Annotated[
        float,
        Range(-360, 360),
        Unit("degrees"),
        NotWith("repeat", because="it turns as it must"),
        OnlyWith(world=TURNED, because="its page turns as it must"),
    ] = 0.0

    clip: Annotated[
        bool,
        Option("--clip", off="--whole"),
        NotWith("repeat", "world", "metamorphosis", because="it is of alike tiles on a page"),
    ] = True

    palette: PaletteName = "earth"

    outline: Annotated[LineWidth | None, DefaultText("1/120 of the tile's size")] = None

    repeat: Literal["basic", "brick", "half-drop"] | None = None
    """Make the cell that repeats without seams, instead of a page: row on row, with each row moved by
    half a width, or with each column moved by half a height."""

    stretch: Annotated[float, Range(0, 0.2), OnlyWith(repeat=("basic", "brick", "half-drop"))] = (
        0.02
    )
    """How much that cell may be stretched to be a rectangle; 0.02 is 2 %."""

    world: Annotated[World | None, NotWith("repeat", because="a cell repeats in the plane")] = None
    """Carry the tiling to another world: a sphere; the hyperbolic plane as a disc, a half-plane or a
    band; a spiral; a cylinder, whose page meets itself when it is wrapped. The sphere needs copies
    turned by thirds, quarters or sixths."""

    order: Annotated[
        Orders | None,
        OnlyWith(world=("sphere", "disc", "half-plane", "band")),
        DefaultText("what bends the tile least"),
    ] = None
    """How many copies meet at centres of rotation: three numbers for p3, p4 and p6, such as 2,3,5 or
    3,3,4, four for p2, two for pgg, one for p1 and pg; or a sphere's number of copies: 12, 24, 60."""

    arms: Annotated[
        Arms | None, OnlyWith(world=("spiral", "cylinder")), DefaultText("about nine tiles around")
    ] = None
    """Of a spiral or cylinder: the steps along both lattice vectors that make one turn."""

    metamorphosis: Annotated[
        Literal["right", "down", "middle"] | None,
        NotWith("repeat", "world", because="it fills a sheet of the plane"),
    ] = None
    """Let the class's polygons become the tile: from left to right, from top to bottom, or from the
    edges to the middle of the page."""

    stages: Annotated[
        int, Range(1, 9), OnlyWith(metamorphosis=("right", "down", "middle"), because="it changes")
    ] = 1
    """How many changes there are across the page: with 2, the tile becomes polygons again."""

    def defaults(self) -> Mapping[str, Any]:
        square = self.world in ("sphere", "disc", "spiral")
        return {**super().defaults(), "area": "2400x2400px" if square else "3000x2000px"}

    def check(self) -> None:
        super().check()
        width, height = self.page
        check_size(width * self.pixels, height * self.pixels)
        if self.format == "html" and self.world not in ("sphere", "disc"):
            raise SettingError(
                "a web page shows a sphere or a disc: give {world}, or a .png or .svg file"
            )
        if self.order is not None and not 2 <= min(self.order) <= max(self.order) <= MOST_ORDER:
            raise SettingError(f"{{order}} has whole numbers from 2 to {MOST_ORDER}")
        if self.arms is not None and (max(map(abs, self.arms)) > MOST_ARMS or not any(self.arms)):
            raise SettingError(f"{{arms}} has whole numbers up to {MOST_ARMS}, not both 0")
        self._check_world()
        if self.tile_size is not None and self.tile_size * self.pixels < SMALLEST_TILE - 1e-9:
            raise SettingError(
                f"a tile of {self.tile_size * self.pixels:.1f} pixels shows nothing ({{tile_size}}); "
                f"choose at least {SMALLEST_TILE:g}px"
            )

    def _check_world(self) -> None:
        """Check that nothing is asked for that another world, or a sheet that changes, has not."""
        if self.world == "band" and self.page[0] > LONGEST_BAND * self.page[1]:
            raise SettingError(
                f"a band can be {LONGEST_BAND} times as long as high: choose another {{area}}"
            )
        if self.world is not None and self.colour == "aspect":
            raise SettingError("{colour} is neighbour or one in another {world}")


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
