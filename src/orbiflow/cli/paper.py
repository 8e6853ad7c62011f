"""`orbiflow paper`: the command's options."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from orbiflow.cli.work import do
from orbiflow.jobs import PaperRequest


def paper(
    out: Annotated[
        Path, typer.Option("--out", "-o", help="Folder for the page and its pictures.")
    ] = Path("paper"),
    fast: Annotated[
        bool, typer.Option("--fast", help="A preview: every exhibit, with less work in each.")
    ] = False,
    only: Annotated[
        str | None,
        typer.Option(help="Exhibits, such as figure-9,table-3; default all.", show_default=False),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(help="Processes; default one a core.", show_default=False)
    ] = None,
) -> None:
    """Reproduce the paper: every figure and table, drawn anew beside what the paper states.

    One page, OUT/index.html; each picture as PNG and PDF, all numbers in OUT/paper.json.
    """
    names = None if only is None else tuple(only.split(","))
    do(PaperRequest(out=out, fast=fast, only=names, workers=workers))
