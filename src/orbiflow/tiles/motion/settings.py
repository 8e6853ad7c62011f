"""How a tile is animated."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from orbiflow.errors import SettingError
from orbiflow.settings import (
    DefaultText,
    Hidden,
    OnlyWith,
    Option,
    PageArea,
    PageLength,
    Range,
    Unit,
)
from orbiflow.tiles.motifs import MotifSettings, TintSettings
from orbiflow.tiles.page import PageSettings

MOST_FRAMES = 2400  # the largest number of pictures of a GIF or video
SIDES = 64, 8000  # the least and the largest side of a picture in pixels


class AnimationSettings(PageSettings, MotifSettings, TintSettings, group="Animation"):
    """How a tile is animated.

    >>> AnimationSettings(kind="grow", area="square").page
    (91.44, 91.44)
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

    area: Annotated[PageArea | None, DefaultText("800x534px")] = None

    tile_size: Annotated[PageLength | None, DefaultText("four to five tiles across")] = None

    clip: Annotated[
        bool,
        Option("--clip", off="--whole"),
        OnlyWith(kind=("bend", "grow"), because="a morph fills the page"),
    ] = True

    def defaults(self) -> Mapping[str, Any]:
        return {**super().defaults(), "area": "800x534px"}

    def check(self) -> None:
        super().check()
        sides = [round(side * self.pixels) for side in self.page]
        what = f"{sides[0]} x {sides[1]} pixels"
        if min(sides) < SIDES[0] or max(sides) > SIDES[1]:
            raise SettingError(
                f"{{area}} is {what}: choose sides from {SIDES[0]} to {SIDES[1]} pixels"
            )
        if self.format == "mp4" and any(side % 2 for side in sides):
            raise SettingError(f"{{area}} is {what}: choose even sides, which videos need")
        if self.format == "svg" and self.draws:
            raise SettingError(
                "an animated SVG shows tiles in plain colours; leave out {strokes} and {eyes}, or "
                "choose a .gif or .mp4"
            )
        if self.format not in ("svg", None) and self.seconds * self.fps > MOST_FRAMES:
            raise SettingError(
                f"{{seconds}} {self.seconds:g} at {{fps}} {self.fps:g} make more than {MOST_FRAMES} "
                "pictures; choose fewer of either"
            )
