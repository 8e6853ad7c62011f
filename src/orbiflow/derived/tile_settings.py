"""Settings of a search for tiles, and of exporting one."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from orbiflow.settings import (
    DefaultText,
    Group,
    Hidden,
    Needs,
    OnlyWith,
    Option,
    Parsed,
    Range,
    Repeated,
    SettingError,
    Settings,
)
from orbiflow.units import Colour, Length, LengthOrZero, PageSize, Size

LIKENESS = Group("Search for likeness")
OVERLAP = Group("Search for overlap")
OCCUPANCY = Group("Occupancy method")
READING = Group("Reading the silhouette")
PIECES = Group("Pieces")


def class_names(text: str) -> tuple[str, ...] | None:
    """Return the isohedral classes that a text names, None for all.

    >>> class_names("IH4, IH6"), class_names("all")
    (('IH4', 'IH6'), None)
    """
    if text.strip().lower() == "all":
        return None
    return tuple(filter(None, re.split(r"[,\s]+", text)))


class EscherizeSettings(Settings, group="Search"):
    """Which tiles are looked for, how, and for how long."""

    classes: Annotated[
        tuple[str, ...] | None,
        Parsed(class_names, "classes such as IH4,IH6, or all", "CLASSES"),
        DefaultText("all"),
    ] = None
    """Isohedral classes, such as IH4,IH6, or all."""

    effort: Annotated[Literal["fast", "normal", "best"], OnlyWith(method="descent")] = "normal"
    """How long the search takes: seconds, a quarter of a minute, or minutes."""

    objective: Annotated[Literal["likeness", "overlap", "both"], OnlyWith(method="descent")] = (
        "likeness"
    )
    """With likeness, the silhouette bends until it is a tile, and every limb is kept. With overlap,
    the tile covers the silhouette as it is. With both, the result is a short list of the best
    compromises."""

    method: Literal["descent", "occupancy"] = "descent"
    """The descent, or the paper's occupancy loss for comparison."""

    per_class: Annotated[int, Range(1)] = 1
    """Number of tiles of each class: the best, and others that differ from it."""

    emphasis: Annotated[Path | None, OnlyWith(method="descent")] = None
    """A mask, white where the silhouette must survive, such as a head or a tail."""

    strength: Annotated[float | None, Range(above=0), Needs("emphasis"), DefaultText("4")] = None
    """How many times more the white part of the mask counts."""

    min_neck: Annotated[
        float | None, Range(0, 0.2), OnlyWith(method="descent"), DefaultText("0.01")
    ] = None
    """Tiles with necks thinner than this rank lower; in square roots of the tile's area."""

    pin: Annotated[
        tuple[str, ...] | None,
        Repeated(),
        OnlyWith(method="descent", objective=("likeness", "both")),
        LIKENESS,
    ] = None
    """A part that keeps its shape while the rest bends: x,y or x,y,radius in the coordinates of the
    input, or a mask that is white where pinned. May be repeated."""

    pin_angle: Annotated[bool, Needs("pin"), LIKENESS] = False
    """Keep the angle of what is pinned, too."""

    max_frequency: Annotated[
        int | None,
        Range(0, 60),
        OnlyWith(objective=("overlap", "both")),
        OVERLAP,
        DefaultText("10, or 15 for effort best"),
    ] = None
    """Largest frequency of the deformation (Omega in the paper)."""

    turns: Annotated[
        int | None, Range(1), OnlyWith(method="occupancy"), OCCUPANCY, DefaultText("12")
    ] = None
    """Number of starting rotations."""

    iterations: Annotated[
        int | None, Range(1), OnlyWith(method="occupancy"), OCCUPANCY, DefaultText("200")
    ] = None
    """Number of steps of the fit."""

    threshold: Annotated[float | None, Range(0, 1), READING, DefaultText("found automatically")] = (
        None
    )
    """Level between shape and background."""

    invert: Annotated[bool | None, READING, DefaultText("found automatically")] = None
    """Whether the shape is the light part."""

    workers: Annotated[int | None, Range(1), DefaultText("one per core")] = None
    """Number of processes."""

    seed: int = 0
    """Seed of the random numbers: the same seed on the same machine gives the same tiles."""

    def defaults(self) -> Mapping[str, Any]:
        return {"objective": "overlap"} if self.method == "occupancy" else {}


class ExportSettings(Settings, group="Page and file"):
    """How a tiling is drawn in real size."""

    purpose: Annotated[
        Literal["laser", "print", "paper", "web", "plotter"] | None, Option("--for")
    ] = None
    """Settings that suit a purpose; other options go before them."""

    format: Annotated[
        Literal["svg", "pdf", "dxf", "png", "json"] | None,
        DefaultText("the file's ending, or what suits the purpose"),
    ] = None
    """Format of the file."""

    tile_size: Length = 40.0
    """Longer side of the tile's smallest rectangle."""

    area: Annotated[PageSize | None, DefaultText("300x200mm")] = None
    """Width and height of the page; also single or double, a journal's columns."""

    cut: Literal["none", "skeleton", "pieces"] = "none"
    """With none, every tile is drawn; with skeleton, each shared edge once; with pieces, tiles
    apart."""

    clip: Annotated[
        bool,
        Option("--clip", off="--whole"),
        OnlyWith(cut=("none", "skeleton"), because="pieces are whole"),
    ] = False
    """Cut tiles at the page's edge, or leave out those that are not whole."""

    border: Annotated[bool, OnlyWith(cut="skeleton", clip=True)] = False
    """Cut the page's border, too."""

    bed: Size | None = None
    """Size of the machine's bed; a larger page becomes several files."""

    calibrate: bool = False
    """Add a mark of 100 mm on a layer of its own."""

    tolerance: Annotated[
        Length | None, DefaultText("1/800 of the tile's size, at least 0.05mm")
    ] = None
    """Largest distance of curves from the tile's outline."""

    warn_neck: Length | None = None
    """Say where the tile is thinner than this, such as 2mm."""

    palette: Annotated[
        str, OnlyWith(cut="none", because="only filled tiles have colours"), DefaultText("delft")
    ] = "delft"
    """Name of a palette, or colours such as e76f51,2a9d8f,outline=1b2f38."""

    dpi: Annotated[float, Range(1, 10_000), OnlyWith(format=("png", None))] = 300.0
    """Dots per inch of a PNG."""

    kerf: Annotated[
        LengthOrZero,
        OnlyWith(cut="pieces", because="an edge that two tiles share is cut only once"),
        PIECES,
    ] = 0.0
    """Width that the tool burns away."""

    clearance: Annotated[LengthOrZero, OnlyWith(cut="pieces"), PIECES] = 0.0
    """Gap between pieces put together, for a puzzle."""

    spacing: Annotated[LengthOrZero, PIECES] = 1.0
    """Gap between the cuts of different pieces."""

    copies: Annotated[
        int | None, Range(1), OnlyWith(cut="pieces"), PIECES, DefaultText("what the page holds")
    ] = None
    """Number of pieces."""

    filled: Annotated[bool, Hidden()] = True
    """Fill tiles with colours of the palette."""

    stroke: Annotated[Colour | None, Hidden()] = None
    """Colour of lines."""

    stroke_width: Annotated[Length | None, Hidden()] = None
    """Width of lines."""

    def defaults(self) -> Mapping[str, Any]:
        preset = {name: value for name, value in self.preset.items() if name != "format"}
        if "cut" in self.fields_given and self.cut == "pieces":
            preset.pop("clip", None)
        return preset

    @property
    def preset(self) -> Mapping[str, Any]:
        """The defaults of the purpose."""
        return PRESETS[self.purpose] if self.purpose else {}

    def check(self) -> None:
        if self.tolerance is not None and self.tolerance > self.tile_size / 20:
            raise SettingError(
                f"{{tolerance}} of {self.tolerance:g} mm would lose the shape of a tile of "
                f"{self.tile_size:g} mm; choose at most {self.tile_size / 20:g} mm"
            )
        if "palette" in self.fields_given and not self.filled:
            raise SettingError(
                f"{{palette}} has no effect: {{purpose}} {self.purpose} fills nothing"
            )

    def for_file(self, out: Path | None) -> ExportSettings:
        """Return these settings with the format that a file's ending decides."""
        ending = out.suffix.lower().lstrip(".") if out else ""
        formats = ("svg", "pdf", "dxf", "png", "json")
        if self.format is None and ending and ending not in formats:
            raise SettingError(
                f"{{out}} ends in .{ending}; give {{format}}, or end it in .{', .'.join(formats)}"
            )
        if self.format is not None and ending in formats and self.format != ending:
            raise SettingError(
                f"{{out}} ends in .{ending} but {{format}} is {self.format}; make them the same"
            )
        return self.replace(format=self.format or ending or self.preset.get("format", "svg"))


PRESETS: Mapping[str, Mapping[str, Any]] = {
    "laser": {
        "format": "svg",
        "cut": "skeleton",
        "clip": False,
        "filled": False,
        "stroke": "#ff0000",
        "stroke_width": 0.01,
    },
    "print": {"format": "pdf", "cut": "none", "clip": True},
    "paper": {
        "format": "pdf",
        "cut": "none",
        "clip": True,
        "area": (85.0, 57.0),
        "tile_size": 17.0,
        "stroke_width": 0.12,
    },
    "web": {"format": "svg", "cut": "none", "clip": True},
    "plotter": {
        "format": "svg",
        "cut": "skeleton",
        "clip": False,
        "filled": False,
        "stroke": "#000000",
        "stroke_width": 0.3,
    },
}
"""What each machine or medium wants; settings that are given go before."""
