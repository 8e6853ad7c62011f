"""How a tile is animated."""

from __future__ import annotations

from typing import Annotated, Literal

from orbiflow.drawing import DEFAULT_PALETTE, PaletteName
from orbiflow.settings import FileSettings, Hidden, OnlyWith, Range, SettingError, Unit
from orbiflow.units import POSTS

MOST_FRAMES = 2400  # the largest number of pictures of a GIF or video


class AnimationSettings(FileSettings, group="Animation"):
    """How a tile is animated.

    >>> AnimationSettings(kind="grow", seconds=3).size
    800
    """

    format: Annotated[Literal["gif", "mp4", "svg"] | None, Hidden()] = None
    """Format of the file. Default: its ending, or gif."""

    kind: Literal["morph", "bend", "grow"] = "morph"
    """With morph, a tiling with straight edges becomes the tile's; with bend, the silhouette bends
    into the tile and its tiling grows; with grow, the tiling grows around one tile."""

    seconds: Annotated[float, Range(0.5, 120), Unit("s")] = 6.0
    """Length of the loop, there and back."""

    fps: Annotated[
        float, Range(1, 60), OnlyWith(format=("gif", "mp4", None), because="an SVG moves evenly")
    ] = 24.0
    """Pictures per second of a GIF or video."""

    size: Annotated[int, Range(64, 4000), Unit("pixels")] = 800
    """Width, an even number."""

    shape: Literal["wide", "square", "story"] = "wide"
    """With wide, the height is two thirds of the width; square and story are 1:1 and 9:16."""

    palette: PaletteName = DEFAULT_PALETTE
    """Colours of the tiles."""

    @property
    def aspect(self) -> float:
        """The width over the height."""
        width, height = POSTS.get(self.shape, (3, 2))
        return width / height

    def check(self) -> None:
        if self.size % 2:
            raise SettingError(f"{{size}} must be even, which videos need, got {self.size}")
        if self.format not in ("svg", None) and self.seconds * self.fps > MOST_FRAMES:
            raise SettingError(
                f"{{seconds}} {self.seconds:g} at {{fps}} {self.fps:g} make more than {MOST_FRAMES} "
                "pictures; choose fewer of either"
            )
