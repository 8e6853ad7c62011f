"""Argument and options that the commands on a tile of a run share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from orbiflow.drawing import PALETTES

Result = Annotated[
    Path,
    typer.Argument(
        help="A search's folder, or its result.json.", show_default=False, metavar="RESULT"
    ),
]
Tile = Annotated[str, typer.Option(help="A class, such as IH4, or a rank; 1 is best.")]
Palette = Annotated[
    str | None,
    typer.Option(
        help=f"Of tiles: {', '.join(PALETTES)}; or your own, as e76f51,2a9d8f,outline=1b2f38.",
        show_default=False,
    ),
]


def file_option(text: str) -> typer.models.OptionInfo:
    """The file that a command writes."""
    return typer.Option("--out", "-o", help=text, show_default=False)


def option(text: str) -> typer.models.OptionInfo:
    """An option whose default goes without saying."""
    return typer.Option(help=text, show_default=False)
