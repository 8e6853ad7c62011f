"""`orbiflow density patches`: 3 x 3 image patches to angles on the Klein bottle."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from orbiflow.cli.density_options import Unit


def patches(
    data: Annotated[
        Path,
        typer.Argument(
            help="Table of 9 pixel values a row, from the top left, or 8 DCT coordinates.",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path, typer.Option("--out", "-o", help="CSV of theta, phi and distance.")
    ] = Path("angles.csv"),
    columns: Annotated[
        str | None,
        typer.Option(help="Names or numbers of the 9 or 8 columns.", show_default=False),
    ] = None,
    unit: Annotated[Unit, typer.Option(help="Of theta and phi.")] = Unit.RADIANS,
    farthest: Annotated[
        float | None,
        typer.Option(
            help="Leave out patches farther than this from the Klein bottle, 0 to 1.41.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Turn image patches into theta,phi on the Klein bottle, for `fit --space klein-bottle`.

    The distance is between patches of mean 0 and contrast 1.
    """
    import numpy as np

    from orbiflow.cli.density_run import read_data, say
    from orbiflow.density.spaces.patches import to_klein
    from orbiflow.density.tables import to_csv
    from orbiflow.errors import OrbiflowError
    from orbiflow.files import write_atomic

    if farthest is not None and not farthest >= 0:
        raise OrbiflowError(f"--farthest must be at least 0, got {farthest:g}")
    table = read_data(data, columns, None)
    angles, distances = to_klein(table.values, unit=unit.value)
    near = distances <= (np.inf if farthest is None else farthest)
    if not near.any():
        raise OrbiflowError(
            f"none of {len(near)} patches is within {farthest:g} of the Klein bottle; the nearest "
            f"is {distances.min():.3f} away"
            if len(near)
            else f"{data}: no patches"
        )
    found = np.column_stack([angles, distances])[near]
    write_atomic(out, to_csv(("theta", "phi", "distance"), found))
    left = "" if near.all() else f", {(~near).sum()} farther ones left out"
    say(
        f"{near.sum()} patches, half of them within {np.median(found[:, 2]):.3f} of the Klein "
        f"bottle{left}; written to {out}"
    )
