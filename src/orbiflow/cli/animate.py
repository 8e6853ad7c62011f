"""`orbiflow animate`: the command's options."""

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
)
from orbiflow.cli.work import do
from orbiflow.jobs import AnimateRequest


class Kind(StrEnum):
    """What moves."""

    MORPH = "morph"
    BEND = "bend"
    GROW = "grow"


def animate(
    result: Result,
    out: Annotated[
        Path | None,
        file_option(
            "The file: .gif, .svg, or .mp4, which needs ffmpeg; default a GIF named after the tile."
        ),
    ] = None,
    tile: Tile = "1",
    kind: Annotated[
        Kind,
        typer.Option(
            help="Morph: a tiling with straight edges becomes the tile's. Bend: the silhouette bends "
            "into the tile, and its tiling grows. Grow: the tiling grows around one tile."
        ),
    ] = Kind.MORPH,
    seconds: Annotated[
        float | None, typer.Option(help="Of the loop, default 6.", show_default=False)
    ] = None,
    fps: Annotated[
        float | None, typer.Option(help="Pictures a second, default 24.", show_default=False)
    ] = None,
    size: Annotated[
        int | None, typer.Option(help="Width in pixels, default 800.", show_default=False)
    ] = None,
    palette: Palette = None,
    force: Annotated[
        bool, typer.Option("--force", help="Animate a tile that is not certified.")
    ] = False,
) -> None:
    """Write an animation: a tiling becoming animals, a silhouette bending, a tiling that grows.

    It loops, there and back. In a morph every picture is an exact tiling.
    """
    request = AnimateRequest(
        result=result,
        out=out,
        tile=tile,
        animation=kind.value,
        seconds=seconds,
        fps=fps,
        size=size,
        palette=palette,
        force=force,
    )
    do(request)
