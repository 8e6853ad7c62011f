"""`orbiflow classes`: the command's options."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def classes(
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Also draw them into this PNG file.")
    ] = None,
) -> None:
    """List the nine isohedral classes: edges, rotation centres, glide lines.

    Between them they give every shape that tiles the plane isohedrally. Edges are numbered in order
    around the tile; "0=3" is moved by a translation, "0~5" by a glide reflection, "0>4" by a
    rotation, "2o" turns about its own midpoint.
    """
    from orbiflow.cli.classes_run import run

    run(out)
