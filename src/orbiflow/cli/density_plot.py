"""What `orbiflow density plot` does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

from orbiflow.cli.density_run import model_at, read_data, same_columns, say
from orbiflow.density.tables import read_table
from orbiflow.draw import write_atomic
from orbiflow.draw.density_page import density_page
from orbiflow.draw.density_square import density_png, flow_png, samples_png, space_title
from orbiflow.draw.folder import make_folder
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry.isometry import Array

SAMPLES = 3000


def run_plot(
    model: Path,
    out: Path,
    *,
    data: Path | None,
    columns: str | None,
    coastlines: Path | None,
    measure: str,
    seed: int,
) -> None:
    """Draw the square, the flow, samples and the surface.

    Raises:
        OrbiflowError: for anything that the user can mend.
    """
    torch.set_num_threads(1)
    density, extra = model_at(model)
    if density.space.dim != 2:
        raise OrbiflowError(
            f"pictures are of two-dimensional spaces, this {density.space.name} has "
            f"{density.space.dim} dimensions"
        )
    if coastlines is not None and density.space.name != "sphere":
        raise OrbiflowError(f"--coastlines belongs to the sphere, not the {density.space.name}")
    lines = None if coastlines is None else _lines(coastlines)
    drawn = density.sample((SAMPLES,), torch.Generator().manual_seed(seed))
    points = drawn
    if data is not None:
        table = read_data(data, columns or same_columns(data, extra), None)
        points = density.space.to_chart(table.values)
    folder = make_folder(out)
    title = f"Density on the {space_title(density.space)}"
    write_atomic(folder / "density.png", density_png(density, points, measure=measure))
    write_atomic(folder / "flow.png", flow_png(density))
    if data is not None:
        write_atomic(folder / "samples.png", samples_png(density, points, drawn))
    page = density_page(density, measure=measure, samples=points, coastlines=lines, title=title)
    write_atomic(folder / "surface.html", page)
    say(f"written to {folder}; open {folder / 'surface.html'} in a browser")


def _lines(path: Path) -> list[Array]:
    """Lines of latitude and longitude, parted by rows whose latitude is beyond 90."""
    values = read_table(path, columns=None, width=2).values
    breaks = np.flatnonzero(abs(values[:, 0]) > 90)
    parts = np.split(values, breaks)
    found = [part[abs(part[:, 0]) <= 90] for part in parts]
    return [part for part in found if len(part) > 1]
