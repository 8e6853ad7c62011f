"""How a tiling is exported; lengths in mm."""

from __future__ import annotations

import re
from dataclasses import dataclass, fields
from typing import Any, Literal

import numpy as np

from orbiflow.arguments import number, whole
from orbiflow.drawing import (
    COLUMNS,
    DEFAULT_PALETTE,
    palette,
)
from orbiflow.errors import OrbiflowError

Format = Literal["svg", "pdf", "dxf", "png", "json"]
Cut = Literal["none", "skeleton", "pieces"]

FORMATS: tuple[Format, ...] = ("svg", "pdf", "dxf", "png", "json")
CUTS: tuple[Cut, ...] = ("none", "skeleton", "pieces")
PAGE = (300.0, 200.0)
"""The page in mm where none is asked for."""

LARGEST = 20_000.0
"""Longest side of a page, in mm."""


@dataclass(frozen=True)
class ExportSettings:
    """All lengths in mm.

    - `format`: of the file.
    - `tile_size`: longer side of the tile's smallest rectangle.
    - `area`: width and height of the page; None for the bed where there are pieces to fill it, else
      `PAGE`.
    - `cut`: "none" draws every tile, "skeleton" each shared edge once, "pieces" tiles apart.
    - `kerf`, `clearance`, `spacing`: of pieces: what the tool burns away, the gap between pieces put
      together, the least distance of their cuts on the sheet.
    - `copies`: how many pieces; None for as many as the page holds.
    - `clip`: cut tiles at the page's edge, or leave out those that are not whole.
    - `border`: draw the page's border where `clip` cuts lines.
    - `bed`: width and height of the machine; a larger page becomes several.
    - `calibrate`: add a mark 100 mm long.
    - `tolerance`: how far curves may be from the tile's polygon; None for 1/800 of the tile's size, at
      least 0.05.
    - `warn_neck`: width below which a neck is worth a note; None for never.
    - `filled`, `palette`: fills of `cut` "none".
    - `stroke`, `stroke_width`: of lines; None for what suits `cut`.
    - `dpi`: of a PNG.

    Raises:
        OrbiflowError: for a setting that cannot be used, by its name.

    >>> ExportSettings.preset("laser", kerf=0.1, cut="pieces").stroke_width
    0.01
    """

    format: Format = "svg"
    tile_size: float = 40.0
    area: tuple[float, float] | None = None
    cut: Cut = "none"
    kerf: float = 0.0
    clearance: float = 0.0
    spacing: float = 1.0
    copies: int | None = None
    clip: bool = False
    border: bool = False
    bed: tuple[float, float] | None = None
    calibrate: bool = False
    tolerance: float | None = None
    warn_neck: float | None = None
    filled: bool = True
    palette: str = DEFAULT_PALETTE
    stroke: str | None = None
    stroke_width: float | None = None
    dpi: float = 300.0

    def __post_init__(self) -> None:
        _one_of(self.format, FORMATS, "format")
        _one_of(self.cut, CUTS, "cut")
        for name in ("tile_size", "dpi"):
            number(getattr(self, name), name, 0, LARGEST, above=True)
        for name in ("kerf", "clearance", "spacing"):
            number(getattr(self, name), name, 0, LARGEST)
        for name in ("tolerance", "warn_neck", "stroke_width"):
            if getattr(self, name) is not None:
                number(getattr(self, name), name, 0, LARGEST, above=True)
        for name in ("area", "bed"):
            if getattr(self, name) is not None:
                self._check_sides(name)
        if self.copies is not None:
            whole(self.copies, "copies", 1)
        palette(self.palette)
        if self.stroke is not None and not re.fullmatch("#[0-9a-fA-F]{6}", str(self.stroke)):
            raise OrbiflowError(f"stroke must be a colour such as #ff0000, got {self.stroke!r}")
        if self.tolerance is not None and self.tolerance > self.tile_size / 20:
            raise OrbiflowError(
                f"a tolerance of {self.tolerance:g} mm would not leave the shape of a tile of "
                f"{self.tile_size:g} mm; choose at most {self.tile_size / 20:g} mm"
            )
        self._check_cut()

    def _check_sides(self, name: str) -> None:
        sides: Any = getattr(self, name)
        # neither text nor a set, which has no order
        if not isinstance(sides, tuple | list | np.ndarray) or len(sides) != 2:
            raise OrbiflowError(f"{name} must be a width and a height in mm, got {sides!r}")
        for side in sides:
            number(side, name, 0, LARGEST, above=True)

    def _check_cut(self) -> None:
        if self.cut == "skeleton" and self.kerf > 0:
            raise OrbiflowError(
                "an edge that two tiles share is cut once and cannot be moved by half a kerf for "
                "both: kerf belongs to cut pieces"
            )
        if self.cut != "pieces":
            for name in ("kerf", "clearance", "copies"):
                if getattr(self, name):
                    raise OrbiflowError(f"{name} belongs to cut pieces, not to cut {self.cut}")
        elif self.clip:
            raise OrbiflowError("clip belongs to cut none and cut skeleton: pieces are whole")
        if self.border and not (self.cut == "skeleton" and self.clip):
            raise OrbiflowError("border belongs to cut skeleton with clip")

    @classmethod
    def preset(cls, name: str, **settings: Any) -> ExportSettings:
        """The settings for "laser", "print", "paper", "web" or "plotter", with others over them.

        Raises:
            OrbiflowError: for another name or a setting that cannot be used.
        """
        chosen = preset_values(name)
        if settings.get("cut", chosen.get("cut")) == "pieces":
            chosen.pop("clip", None)
        known = {field.name for field in fields(cls)}
        for setting in settings:
            if setting not in known:
                raise OrbiflowError(f"there is no export setting {setting!r}; see ExportSettings")
        return cls(**{**chosen, **settings})

    @property
    def page(self) -> tuple[float, float]:
        """Width and height in mm of what is drawn on; for pieces no larger than the bed."""
        if self.cut != "pieces" or self.bed is None:
            return self.area or PAGE
        area = self.area or self.bed
        return min(area[0], self.bed[0]), min(area[1], self.bed[1])

    @property
    def deviation(self) -> float:
        """The tolerance in mm."""
        return max(0.05, self.tile_size / 800) if self.tolerance is None else self.tolerance


PRESETS: dict[str, dict[str, Any]] = {
    "laser": {
        "format": "svg",
        "cut": "skeleton",
        "clip": False,
        "filled": False,
        "stroke": "#ff0000",
        "stroke_width": 0.01,
    },
    "print": {"format": "pdf", "cut": "none", "clip": True, "filled": True},
    "paper": {
        "format": "pdf",
        "cut": "none",
        "clip": True,
        "filled": True,
        "area": (COLUMNS["single"], round(COLUMNS["single"] / 1.5)),
        "tile_size": 17.0,
        "stroke_width": 0.12,
    },
    "web": {"format": "svg", "cut": "none", "clip": True, "filled": True},
    "plotter": {
        "format": "svg",
        "cut": "skeleton",
        "clip": False,
        "filled": False,
        "stroke": "#000000",
        "stroke_width": 0.3,
    },
}
"""What each machine or medium wants; explicit settings go before."""


def preset_values(name: str) -> dict[str, Any]:
    """A preset as a new dictionary.

    Raises:
        OrbiflowError: for an unknown name.
    """
    if name not in PRESETS:
        raise OrbiflowError(f"unknown preset {name!r}; there are {', '.join(PRESETS)}")
    return dict(PRESETS[name])


def _one_of(value: str, known: tuple[str, ...], name: str) -> None:
    if value not in known:
        raise OrbiflowError(f"{name} must be one of {', '.join(known)}, got {value!r}")
