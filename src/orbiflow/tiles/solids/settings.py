"""How a tile becomes a solid to print; lengths in mm."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from orbiflow.errors import SettingError
from orbiflow.settings import (
    LONGEST_SIDE,
    DefaultText,
    FileSettings,
    Length,
    LengthOrZero,
    Needs,
    OnlyWith,
    PageSize,
    Range,
    Unit,
)
from orbiflow.tiles.make import Orders
from orbiflow.tiles.motifs import MotifSettings

WITH_DRAWING = ("tile", "stamp", "mould", "puzzle")
FRAGILE = {"cutter": 5.0, "mould": 2.0}  # widths in mm of necks at which dough and casts break
_CUTTER, _MOULD, _PUZZLE = (OnlyWith(kind=name) for name in ("cutter", "mould", "puzzle"))

BALLS = ("ball", "ball-piece", "lamp")
FLAT_KINDS = ("tile", "cutter", "stamp", "mould", "puzzle")
_ROUND = OnlyWith(kind=BALLS)
_WALLED = OnlyWith(kind=("cutter", "stamp", "mould", "puzzle", "ball-piece", "lamp"))


class SolidSettings(MotifSettings, FileSettings, group="Solid"):
    """How a tile becomes a solid; lengths in mm.

    >>> SolidSettings(kind="cutter").wall
    1.2
    """

    kind: Literal["tile", "cutter", "stamp", "mould", "puzzle", "ball", "ball-piece", "lamp"] = (
        "tile"
    )
    """A tile; a cookie cutter; a stamp; a mould to cast tiles in; a puzzle of tiles in a tray; a ball
    with grooves between tiles, one of the pieces of a ball, or a lamp of their edges alone."""

    format: Annotated[Literal["stl", "3mf"] | None, DefaultText("stl; for a puzzle 3mf")] = None
    """Format of the file. In a 3MF each part of a puzzle is an object of its own."""

    tile_size: Annotated[
        Length, OnlyWith(kind=FLAT_KINDS), DefaultText("50 mm; cutter 80, puzzle 40 mm")
    ] = 50.0
    """Longer side of the tile's smallest rectangle."""

    diameter: Annotated[Length, _ROUND] = 80.0
    """Diameter of a ball or a lamp."""

    order: Annotated[Orders | None, _ROUND, DefaultText("what bends the tile least")] = None
    """How many tiles meet at the centres of rotation, 2,3,3, 2,3,4 or 2,3,5; or 12, 24 or 60 tiles."""

    magnet: Annotated[Length | None, OnlyWith(kind="ball-piece")] = None
    """Diameter of round magnets in the sides of a ball's pieces, two for each edge."""

    magnet_depth: Annotated[Length, Needs("magnet")] = 2.0
    """Height of these magnets."""

    height: Annotated[
        Length, OnlyWith(kind=FLAT_KINDS), DefaultText("4 mm; cutter 13, stamp 3, mould 8 mm")
    ] = 4.0
    """Height of a tile or piece; of a cutter above its rim; of a stamp's base; depth of a mould."""

    clearance: Annotated[
        LengthOrZero,
        OnlyWith(kind=("tile", "mould", "puzzle", "ball-piece")),
        DefaultText("0.2 mm; mould 0 mm"),
    ] = 0.2
    """Gap between tiles put together; with 0 a mould's mouth is the tile."""

    chamfer: Annotated[LengthOrZero, OnlyWith(kind=("tile", "puzzle"))] = 0.5
    """Bevel of the upper edge."""

    wall: Annotated[Length, _WALLED, DefaultText("4 mm; cutter 1.2, stamp 1, lamp 3 mm")] = 4.0
    """Thickness of the wall of a cutter, mould, tray, ball of pieces or lamp; width of a stamp's border
    and of a lamp's bands."""

    blade: Annotated[Length, _CUTTER] = 0.6
    """Thickness of a cutter's wall at its cutting edge; it thins over the last third."""

    foot: Annotated[Length, _CUTTER] = 5.0
    """Width of a cutter's rim for the hand."""

    floor: Annotated[Length, OnlyWith(kind=("cutter", "mould", "puzzle"))] = 2.0
    """Thickness of the floor of a mould or tray, and of a cutter's rim."""

    relief: Annotated[
        Length,
        OnlyWith(kind=(*WITH_DRAWING, "ball")),
        DefaultText("0.6 mm; stamp, mould 1.2, ball 1 mm"),
    ] = 0.6
    """How far lines stand out of a stamp or of a mould's floor, or are sunk in a tile or a piece; the
    depth of the grooves of a ball."""

    draft: Annotated[float, Range(0, 45), Unit("degrees"), _MOULD] = 5.0
    """Slope of a mould's walls, so that casts come out."""

    nozzle: Length = 0.4
    """Width of the printer's line. Thinner lines of a drawing are widened to it."""

    warn_neck: Annotated[
        LengthOrZero, DefaultText("where it would break; cutter 5, mould 2 mm")
    ] = 0.4
    """Say where the tile is thinner than this: less than a line, or than the slopes of both sides, at
    which dough tears or a cast breaks. 0 says nothing."""

    area: Annotated[PageSize, _PUZZLE, DefaultText("180x180mm")] = (180.0, 180.0)
    """Largest width and depth of the tray and of each plate, such as those of the printer's bed."""

    copies: Annotated[int | None, Range(1), _PUZZLE, DefaultText("what the area holds")] = None
    """Number of pieces; those in the middle are taken."""

    tray_border: Annotated[Literal["straight", "following"], _PUZZLE] = "straight"
    """With straight, the tray is a rectangle; with following, it follows the pieces."""

    assembled: Annotated[bool, _PUZZLE] = False
    """Leave the pieces in the tray, to look at; else they lie on plates as large as the area."""

    fit_test: Annotated[bool, _PUZZLE] = False
    """Instead two neighbours at five clearances, from half to twice what is asked for."""

    def defaults(self) -> Mapping[str, Any]:
        values = {**super().defaults(), **KINDS[self.kind]}
        used = {**vars(self), **{k: v for k, v in values.items() if k not in self.fields_given}}
        slope = used["height"] * self.slope if self.kind == "mould" else used["chamfer"]
        bevelled = 0.0 if self.kind in ("cutter", "stamp") else 2 * slope + used["clearance"]
        if self.kind in BALLS:
            return values
        least = max(self.nozzle, bevelled, FRAGILE.get(self.kind, 0.0))
        return {**values, "warn_neck": min(least, LONGEST_SIDE)}

    @property
    def usual_format(self) -> str:
        """3MF for a puzzle and for a tile with a drawing, else STL."""
        drawn = self.kind == "tile" and self.draws
        return "3mf" if self.kind == "puzzle" or drawn else "stl"

    @property
    def slope(self) -> float:
        """How much narrower in mm a mould is at a depth of 1 mm."""
        return math.tan(math.radians(self.draft))

    def check(self) -> None:
        super().check()
        for name in ("engrave", "strokes", "eyes"):
            if getattr(self, name) and self.kind not in WITH_DRAWING:
                raise SettingError(f"{{{name}}} has no place on a {self.kind}")
        inside = {"tile": ("chamfer", "relief"), "mould": ("relief",)}
        for part in inside.get("tile" if self.kind == "puzzle" else self.kind, ()):
            if getattr(self, part) > self.height:
                raise SettingError(f"{{{part}}} must be at most {{height}}, {self.height:g} mm")
        for part in ("relief",) if self.kind == "ball" else ("wall",) if self.kind in BALLS else ():
            if getattr(self, part) > self.diameter / 4:
                raise SettingError(f"{{{part}}} must be at most a quarter of {{diameter}}")
        if self.kind == "cutter" and not self.blade <= self.wall <= self.foot:
            raise SettingError("{blade} must be at most {wall}, and {wall} at most {foot}")
        if self.magnet is not None and self.magnet > self.wall - 2 * self.nozzle:
            raise SettingError(
                f"a {{magnet}} of {self.magnet:g} mm leaves no room in a {{wall}} of {self.wall:g} mm"
            )
        if self.kind == "puzzle" and not self.clearance:
            raise SettingError("{clearance} must be above 0 in a puzzle, or no piece comes out")

    def check_picture(self, picture: object) -> None:
        """Check that a picture, if there is one, has a place on the solid."""
        if picture is not None and self.kind not in WITH_DRAWING:
            what = f"a {self.kind} takes no {{picture}}"
            raise SettingError(f"{what}; leave it out, or make a tile, stamp, mould or puzzle")


KINDS: Mapping[str, Mapping[str, Any]] = {
    "tile": {},
    "cutter": {"tile_size": 80.0, "height": 13.0, "wall": 1.2},
    "stamp": {"height": 3.0, "wall": 1.0, "relief": 1.2},
    "mould": {"height": 8.0, "relief": 1.2, "clearance": 0.0},
    "puzzle": {"tile_size": 40.0},
    "ball": {"relief": 1.0},
    "ball-piece": {},
    "lamp": {"wall": 3.0},
}
"""What each kind is usually made with; settings that are given go before."""
