"""`orbiflow export`: the command's options."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from orbiflow.cli.tile_options import (
    Palette,
    Result,
    Tile,
    file_option,
    option,
)
from orbiflow.cli.work import do
from orbiflow.jobs import ExportRequest


class Format(StrEnum):
    """Of the file."""

    SVG = "svg"
    PDF = "pdf"
    DXF = "dxf"
    PNG = "png"
    JSON = "json"


class Cut(StrEnum):
    """What is drawn."""

    NONE = "none"
    SKELETON = "skeleton"
    PIECES = "pieces"


class Purpose(StrEnum):
    """What the file is for."""

    LASER = "laser"
    PRINT = "print"
    PAPER = "paper"
    WEB = "web"
    PLOTTER = "plotter"


def export(
    result: Result,
    out: Annotated[
        Path | None,
        file_option("The file; default one named after the tile."),
    ] = None,
    tile: Tile = "1",
    purpose: Annotated[
        Purpose | None,
        typer.Option("--for", help="Settings that suit it; options go before.", show_default=False),
    ] = None,
    file_format: Annotated[
        Format | None,
        typer.Option("--format", help="Default: the file's ending, or svg.", show_default=False),
    ] = None,
    tile_size: Annotated[
        str | None, option("Longer side of the tile's smallest rectangle; default 40mm.")
    ] = None,
    area: Annotated[
        str | None,
        option("The page; default 300x200mm. Also single or double, a journal's columns."),
    ] = None,
    cut: Annotated[
        Cut | None,
        option("None: every tile drawn. Skeleton: shared edges once. Pieces: tiles apart."),
    ] = None,
    kerf: Annotated[str | None, option("Pieces: width that the tool burns away.")] = None,
    spacing: Annotated[str | None, option("Pieces: gap between cuts, default 1mm.")] = None,
    clearance: Annotated[
        str | None, option("Pieces: gap between pieces put together, for a puzzle.")
    ] = None,
    copies: Annotated[int | None, option("Pieces: how many; default what the page holds.")] = None,
    clip: Annotated[
        bool | None,
        typer.Option(
            "--clip/--whole",
            help="Cut tiles at the page's edge, or leave those out.",
            show_default=False,
        ),
    ] = None,
    border: Annotated[
        bool, typer.Option("--border", help="Skeleton with --clip: cut the page's border, too.")
    ] = False,
    bed: Annotated[
        str | None, option("The machine's size, such as 300x200mm: several files if need be.")
    ] = None,
    calibrate: Annotated[
        bool, typer.Option("--calibrate", help="Add a mark of 100 mm on a layer of its own.")
    ] = False,
    tolerance: Annotated[
        str | None,
        option("How far curves may be from the tile; default 1/800 of its size, 0.05mm at least."),
    ] = None,
    warn_neck: Annotated[
        str | None, option("Say where the tile is thinner than this, such as 2mm.")
    ] = None,
    palette: Palette = None,
    dpi: Annotated[float | None, option("PNG: dots per inch, default 300.")] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Export a tile that is not certified, marked so.")
    ] = False,
) -> None:
    """Write a tiling in real size: to print, to cut with a laser, to draw, to put on a page.

    Lengths are numbers with a unit: mm, cm, in or pt.
    """
    request = ExportRequest(
        result=result,
        out=out,
        tile=tile,
        purpose=purpose.value if purpose else None,
        format=file_format.value if file_format else None,
        tile_size=tile_size,
        area=area,
        cut=cut.value if cut else None,
        kerf=kerf,
        clearance=clearance,
        spacing=spacing,
        copies=copies,
        clip=clip,
        border=border,
        bed=bed,
        calibrate=calibrate,
        tolerance=tolerance,
        warn_neck=warn_neck,
        palette=palette,
        dpi=dpi,
        force=force,
    )
    do(request)
