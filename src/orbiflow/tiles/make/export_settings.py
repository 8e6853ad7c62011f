"""How a tiling is exported; lengths in mm."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from orbiflow.errors import SettingError
from orbiflow.settings import (
    COLUMNS,
    PAGES,
    Colour,
    DefaultText,
    HelpHeading,
    Hidden,
    Length,
    LengthOrZero,
    OnlyWith,
    Option,
    PageLength,
    PageSize,
    Range,
    SignedLength,
    Unit,
)
from orbiflow.tiles.motifs import MotifSettings, TintSettings
from orbiflow.tiles.page import MARKS_EDGE, ColourRule, PageSettings, usual_tolerance
from orbiflow.tiles.write import DxfVersion, SceneFormat

PIECES = HelpHeading("Pieces")
FINE = 0.01  # in mm: a step of a machine
WRAPPED = ("mug", "phone")  # pages that things are wrapped in, and so without an edge
PRINTER_EDGE = 5.0  # width in mm of the page's edge that printers at home leave empty

Purpose = Literal[
    "laser",
    "print",
    "paper",
    "web",
    "plotter",
    "template",
    "lesson",
    "colouring",
    "stickers",
    "share",
]
"""What an export is for, by which many settings go."""

COLOURED = ("print", "paper", "web", "stickers", "share")  # what shows drawings in their colours
PRINTED = (
    "print",
    "paper",
    "template",
    "lesson",
    "colouring",
    "stickers",
)  # what is a PDF unless told


class ExportSettings(PageSettings, MotifSettings, TintSettings, group="Page and file"):
    """How a tiling is drawn in real size; lengths in mm.

    >>> ExportSettings(purpose="laser", kerf=0.1, cut="pieces").outline
    0.01
    """

    purpose: Annotated[Purpose | None, Option("--for")] = None
    """Settings that suit a purpose. Options given beside it override them."""

    format: Annotated[
        SceneFormat | None, DefaultText("the file's ending, or what suits the purpose")
    ] = None
    """Format of the file."""

    tile_size: PageLength = 40.0

    margin: LengthOrZero = 0.0
    """Width of the page's edge that stays empty; 5 mm for pieces that are printed."""

    cut: Literal["none", "skeleton", "pieces", "jigsaw", "template", "lesson"] = "none"
    """With none, every tile is drawn; with skeleton, each shared edge once; with pieces, tiles
    apart; with jigsaw, a rectangle cut into tiles, without slivers at its border; with template,
    one tile to draw on, as large as the page allows; with lesson, a page that shows how the tile comes
    of a shape with straight sides."""

    rotate: Annotated[
        float,
        Range(-360, 360),
        Unit("degrees"),
        OnlyWith(
            cut=("none", "skeleton", "jigsaw", "template"),
            because="pieces are turned to fill the page",
        ),
    ] = 0.0

    clip: Annotated[
        bool,
        Option("--clip", off="--whole"),
        OnlyWith(cut=("none", "skeleton"), because="pieces are whole"),
    ] = False

    colour: Annotated[ColourRule, OnlyWith(cut="none", because="lines have none")] = "neighbour"

    tint: Annotated[float, Range(0, 1), OnlyWith(cut="none", because="lines have none")] = 0.0

    border: Annotated[bool, OnlyWith(cut="skeleton", clip=True)] = False
    """Cut the page's border, too."""

    bed: Annotated[
        PageSize | None,
        OnlyWith(cut=("none", "skeleton", "pieces"), because="others are one sheet"),
    ] = None
    """Size of the machine's bed or the printer's paper, or a page's name; a larger page becomes
    several files, or sheets of paper in one PDF: of whole tiles if they are cut out, else of parts to
    put together."""

    overlap: Annotated[
        Length | None,
        OnlyWith(cut=("none", "skeleton"), because="others are not put together"),
        DefaultText("10mm; for paper down to 3mm where that saves sheets"),
    ] = None
    """Width of the strip that neighbouring parts of a page share, beside what printers leave empty."""

    calibrate: bool = False
    """Add a mark of 100 mm on a layer of its own."""

    tolerance: Annotated[
        Length | None, DefaultText("1/400 of the tile's size, at least 0.05mm")
    ] = None
    """Largest distance of curves from the tile's outline."""

    warn_neck: Annotated[LengthOrZero, DefaultText("1.5mm for lasers, else 0")] = 0.0
    """Say where the tile is thinner than this, such as 2mm; 0 says nothing."""

    dpi: Annotated[float, Range(1, 10_000), OnlyWith(format=("png", None))] = 300.0

    dxf: Annotated[DxfVersion, OnlyWith(format=("dxf", None))] = "r2010"
    """Version of DXF; r12 is read by old machines."""

    tabs: Annotated[
        int | None,
        Range(1, 100),
        OnlyWith(cut=("skeleton", "pieces"), because="tabs hold pieces in their sheet"),
    ] = None
    """Leave so many gaps in the outline of each piece, which hold it in the sheet."""

    tab_width: Annotated[Length, OnlyWith(cut=("skeleton", "pieces"))] = 0.5
    """Width of such a gap, as it is left."""

    power: Annotated[
        float | None, Range(0, 100), Unit("%"), OnlyWith(cut=("skeleton", "pieces", "jigsaw"))
    ] = None
    """Power of what is engraved and scored, which the names of its layers say."""

    offset: Annotated[
        SignedLength,
        OnlyWith(cut="pieces", because="an edge that two tiles share is drawn only once"),
        PIECES,
    ] = 0.0
    """Cut this far outside the tile: a quilt's seam allowance, a sticker's border; negative inside."""

    kerf: Annotated[
        LengthOrZero,
        OnlyWith(cut="pieces", because="an edge that two tiles share is cut only once"),
        PIECES,
    ] = 0.0
    """Width that the tool burns away."""

    clearance: Annotated[LengthOrZero, OnlyWith(cut=("pieces", "jigsaw")), PIECES] = 0.0
    """Gap between pieces put together, for a puzzle; around a jigsaw in its tray."""

    spacing: Annotated[LengthOrZero, OnlyWith(cut="pieces"), PIECES] = 1.0
    """Gap between the cuts of different pieces."""

    copies: Annotated[
        int | None, Range(1), OnlyWith(cut="pieces"), PIECES, DefaultText("what the page holds")
    ] = None
    """Number of pieces."""

    fit_test: Annotated[bool, OnlyWith(cut="pieces"), PIECES] = False
    """Instead two neighbours at five clearances, from half to twice what is asked for, or 0.1 mm."""

    marks: Annotated[bool, Option("--marks", off="--no-marks"), OnlyWith(cut="pieces"), PIECES] = (
        False
    )
    """Add the registration marks of cutters that cut what is printed, 10 mm from the page's edge."""

    tray: Annotated[Length | None, OnlyWith(cut="jigsaw"), PIECES] = None
    """Add two sheets with a jigsaw's tray, a frame with a rim this wide and a base."""

    filled: Annotated[bool, Hidden()] = True
    """Fill tiles with colours of the palette."""

    stroke: Annotated[Colour | None, Hidden(), DefaultText("what suits the cut")] = None
    """Colour of lines."""

    def defaults(self) -> Mapping[str, Any]:
        values = {**super().defaults(), **PURPOSES.get(self.purpose or "", {})}
        cut = self.cut if "cut" in self.fields_given else values.get("cut", "none")
        if cut not in ("none", "skeleton"):
            values.pop("clip", None)
        if cut == "none" and sorted(self.area or ()) in [sorted(PAGES[name]) for name in WRAPPED]:
            values.setdefault("clip", True)
        if cut == "pieces" and self.purpose in PRINTED:
            values.setdefault("margin", PRINTER_EDGE)
        return values

    def check(self) -> None:
        super().check()
        if 2 * self.margin >= min(self.page):
            width, height = self.page
            raise SettingError(
                f"{{margin}} of {self.margin:g} mm leaves nothing of a page of {width:g} x {height:g} "
                "mm; choose a smaller one"
            )
        if self.marks and self.margin < MARKS_EDGE:
            raise SettingError(
                f"{{marks}} lie {MARKS_EDGE:g} mm from the page's edge; choose a {{margin}} of at "
                f"least {MARKS_EDGE:g} mm, got {self.margin:g} mm"
            )
        if self.tolerance is not None and self.tolerance > self.tile_size / 20:
            raise SettingError(
                f"{{tolerance}} of {self.tolerance:g} mm would lose the shape of a tile of "
                f"{self.tile_size:g} mm; choose at most {self.tile_size / 20:g} mm"
            )
        if self.file_format == "html" and (self.cut != "none" or not self.filled):
            raise SettingError(
                "{format} html is a page with all tiles in their colours, which none can cut; choose "
                "another format"
            )
        if self.file_format == "html" and self.bed is not None:
            raise SettingError("{format} html has no edge; leave {bed} out")
        if self.overlap is not None and (self.bed is None or self.whole_sheets):
            raise SettingError(
                "{overlap} is of parts of a page that are put together, and there are none; "
                "leave {overlap} out, or give {bed}"
            )
        if self.outline == 0 and self.cut != "none":
            raise SettingError(f"{{outline}} none leaves {{cut}} {self.cut} without a line")
        has_palette = self.purpose == "stickers" or (self.cut == "none" and self.filled)
        if "palette" in self.fields_given and not has_palette:
            what = f"{{purpose}} {self.purpose} fills nothing" if self.purpose else "no {filled}"
            if "cut" in self.fields_given and self.cut != "none":
                what = f"{{cut}} {self.cut} fills nothing"
            raise SettingError(f"{{palette}} has no effect: {what}; leave {{palette}} out")

    @property
    def coloured(self) -> bool:
        """Whether what lies on the tiles has its colours, rather than those of a machine's layers."""
        return (self.cut == "none" and self.filled) or self.purpose in COLOURED

    @property
    def usual_format(self) -> str:
        """What suits the purpose, else svg."""
        if self.purpose == "share":
            return "html"
        return "pdf" if self.purpose in PRINTED else "svg"

    @property
    def page(self) -> tuple[float, float]:
        """Width and height in mm of what is drawn on; with whole tiles no larger than the bed."""
        if self.bed is None or not self.whole_sheets:
            return super().page
        area = self.area or (self.bed if self.cut == "pieces" else super().page)
        return min(area[0], self.bed[0]), min(area[1], self.bed[1])

    @property
    def whole_sheets(self) -> bool:
        """Whether each of several sheets holds whole tiles; else they are cut where sheets meet."""
        return self.cut == "pieces" or (self.cut == "skeleton" and not self.clip)

    @property
    def on_paper(self) -> bool:
        """Whether a page that is larger than the bed becomes sheets of a printer's paper."""
        return self.bed is not None and not self.whole_sheets and self.file_format == "pdf"

    @property
    def deviation(self) -> float:
        """The tolerance in mm."""
        return usual_tolerance(self.tile_size) if self.tolerance is None else self.tolerance

    @property
    def fine(self) -> float:
        """The tolerance in mm of what is flattened or fitted again: a part of the whole, and no more
        than a cutter's own."""
        return min(self.deviation / 4, FINE)


_SHEET = {"area": PAGES["a4"], "margin": 10.0, "stroke": "#000000", "outline": 0.8}
_LINES = {"cut": "skeleton", "clip": False, "filled": False}

PURPOSES: Mapping[str, Mapping[str, Any]] = {
    "laser": {**_LINES, "stroke": "#ff0000", "outline": 0.01, "warn_neck": 1.5},
    "plotter": {**_LINES, "stroke": "#000000", "outline": 0.3},
    "print": {"clip": True},
    "web": {"clip": True},
    "share": {"clip": True},
    "template": {**_SHEET, "cut": "template"},
    "lesson": {**_SHEET, "cut": "lesson"},
    "stickers": {
        "cut": "pieces",
        "area": PAGES["a4"],
        "margin": 10.0,
        "marks": True,
        "offset": 2.0,
    },
    "colouring": {**_LINES, **_SHEET, "tile_size": 60.0, "clip": True, "border": True},
    "paper": {
        "clip": True,
        "area": (COLUMNS["single"], round(COLUMNS["single"] / 1.5)),
        "tile_size": 17.0,
        "outline": 0.12,
    },
}
"""What each machine or medium wants; settings that are given go before."""
