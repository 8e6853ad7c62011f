"""What is drawn on a tile: lines inside it, and eyes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self, TypeAlias

from orbiflow.errors import OrbiflowError, SettingError
from orbiflow.settings import HelpHeading, Option, Parsed, Range, Repeated, Settings

Strokes: TypeAlias = Literal["hatch", "echoes", "feathers"]


def eye_numbers(text: str) -> tuple[float, ...]:
    """Return the numbers of an eye.

    >>> eye_numbers("120, 80,6")
    (120.0, 80.0, 6.0)
    """
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise OrbiflowError(f"{text!a:.60} is not x,y or x,y,radius") from None


Eye: TypeAlias = Annotated[tuple[float, ...], Parsed(eye_numbers, "x,y or x,y,radius", "X,Y[,R]")]
ON_TILE = HelpHeading("On the tile")


class TintSettings(Settings):
    """How tiles tint what lies on them."""

    tint: Annotated[float, Range(0, 1), ON_TILE] = 0.0
    """How much the colour of each tile tints the picture on it: 0 not at all, 1 as coloured glass."""


class MotifSettings(Settings):
    """What is drawn on a tile, over its picture if it has one."""

    engrave: Annotated[bool, ON_TILE] = False
    """Draw lines inside the tile, as on a woodcut: hatching, unless other strokes are chosen."""

    strokes: Annotated[Strokes | None, ON_TILE] = None
    """Engrave with hatching, echoes of the outline, or feathers."""

    eyes: Annotated[tuple[Eye, ...], Repeated(), Option("--eye"), ON_TILE] = ()
    """An eye, in the silhouette's coordinates. May be repeated."""

    second_eyes: Annotated[tuple[Eye, ...], Repeated(), Option("--second-eye"), ON_TILE] = ()
    """An eye of the second figure, in its own silhouette's coordinates. May be repeated."""

    @property
    def draws(self) -> bool:
        """Whether something is drawn on the tile."""
        return bool(self.strokes or self.eyes or self.second_eyes)

    def of_figure(self, number: int) -> Self:
        """Return the settings of one of a tile's figures, counted from 0."""
        return self.replace(eyes=self.second_eyes, second_eyes=()) if number else self

    def defaults(self) -> Mapping[str, Any]:
        return {"strokes": "hatch"} if self.engrave else {}

    def check(self) -> None:
        eyes = {"eyes": self.eyes, "second_eyes": self.second_eyes}
        for name, number, place in (
            (key, k, place) for key, places in eyes.items() for k, place in enumerate(places, 1)
        ):
            if len(place) not in (2, 3) or min(place[2:], default=0) < 0:
                raise SettingError(
                    f"{{{name}}}: entry {number} must be x,y or x,y,radius in the silhouette's "
                    "coordinates, with a radius of 0 or more, got "
                    f"{','.join(f'{part:g}' for part in place)}"
                )
