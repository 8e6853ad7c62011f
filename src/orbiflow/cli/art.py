"""`orbiflow art`: the command's options."""

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
from orbiflow.jobs import ArtRequest


class Colour(StrEnum):
    """Of tiles."""

    ASPECT = "aspect"
    NEIGHBOUR = "neighbour"
    ONE = "one"


class Strokes(StrEnum):
    """Lines inside a tile."""

    HATCH = "hatch"
    ECHOES = "echoes"
    FEATHERS = "feathers"


def art(
    result: Result,
    out: Annotated[
        Path | None, file_option("A .png or .svg; default a PNG named after the tile.")
    ] = None,
    tile: Tile = "1",
    picture: Annotated[
        Path | None,
        option("Over the silhouette, in the same frame: PNG, JPEG, WebP or an SVG drawing."),
    ] = None,
    size: Annotated[
        str | None, option("The page: pixels, default 3000x2000, or such as 300x200mm.")
    ] = None,
    tile_size: Annotated[
        str | None,
        option("Longer side of the tile's smallest rectangle: pixels, or such as 40mm."),
    ] = None,
    repeat: Annotated[
        bool, typer.Option("--repeat", help="The cell that repeats without seams, instead.")
    ] = False,
    tolerance: Annotated[
        float | None, option("How much that cell may be stretched; default 0.02, which is 2 %.")
    ] = None,
    palette: Palette = None,
    colour: Annotated[
        Colour | None,
        option("Aspect: one a way that tiles lie. Neighbour: neighbours differ. Default that."),
    ] = None,
    outline: Annotated[
        str | None, option("Width of the lines between tiles: pixels, such as 0.3mm, or none.")
    ] = None,
    engrave: Annotated[
        bool, typer.Option("--engrave", help="Draw lines inside the tile, as on a woodcut.")
    ] = False,
    strokes: Annotated[
        Strokes | None, option("Engrave with hatching, echoes of the outline, or feathers.")
    ] = None,
    eye: Annotated[
        list[str] | None,
        typer.Option(
            "--eye",
            metavar="X,Y[,R]",
            help="An eye, in the silhouette's coordinates; may be given again.",
            show_default=False,
        ),
    ] = None,
    dpi: Annotated[float | None, option("Pixels an inch, default 300.")] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Draw a tile that is not certified.")
    ] = False,
) -> None:
    """Carry a picture of the silhouette onto its tile and repeat it over the plane.

    Without a picture tiles are coloured by a palette, and --engrave draws inside them.
    """
    request = ArtRequest(
        result=result,
        out=out,
        tile=tile,
        picture=picture,
        size=size,
        tile_size=tile_size,
        repeat=repeat,
        tolerance=tolerance,
        palette=palette,
        colour=colour.value if colour else None,
        outline=outline,
        engrave=engrave,
        strokes=strokes.value if strokes else None,
        eyes=tuple(eye or ()),
        dpi=dpi,
        force=force,
    )
    do(request)
