"""What `orbiflow density plot` does."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from orbiflow.cli.density_run import model_at, read_data, same_columns, say
from orbiflow.density.models.symmetric import SymmetricDensity
from orbiflow.density.spaces.flat import KleinBottle, Torus
from orbiflow.density.spaces.space import Space
from orbiflow.density.tables import read_table
from orbiflow.errors import OrbiflowError
from orbiflow.figures.density_axes import space_title, view_of
from orbiflow.figures.density_corner import MOST_COLUMNS, corner_png
from orbiflow.figures.density_flow import flow_png
from orbiflow.figures.density_page import density_page
from orbiflow.figures.density_square import density_png, samples_png
from orbiflow.files import make_folder, write_atomic
from orbiflow.symmetry.isometry import Array

SAMPLES = 3000


class Style(NamedTuple):
    """How pictures are drawn; see the options of `orbiflow density plot`."""

    measure: str
    scale: str
    dots: bool
    center: str | None
    coastlines: Path | None


def run_plot(
    model: Path, out: Path, *, data: Path | None, columns: str | None, style: Style, seed: int
) -> None:
    """Draw the square, the flow, samples and the surface; beyond two angles, all pairs of angles.

    Raises:
        OrbiflowError: for anything that the user can mend.
    """
    torch.set_num_threads(1)
    density, extra = model_at(model)
    space = density.space
    if style.coastlines is not None and space.name != "sphere":
        raise OrbiflowError(f"--coastlines belongs to the sphere, not the {space.name}")
    if space.dim > MOST_COLUMNS:
        raise OrbiflowError(
            f"this {space.name} has {space.dim} angles, pictures are of {MOST_COLUMNS} at most: "
            "draw columns of `orbiflow density sample` beside those of the data"
        )
    names, center = _names(space, extra.get("columns")), _center(space, style.center)
    view_of(space, names, center)  # mistakes before work
    lines = None if style.coastlines is None else _lines(style.coastlines)
    drawn = density.sample((SAMPLES,), torch.Generator().manual_seed(seed))
    points = None
    if data is not None:
        table = read_data(data, columns or same_columns(data, extra), None)
        points = space.to_chart(table.values)
    folder = make_folder(out)
    if space.dim != 2:
        picture = corner_png(density, points, drawn, names=names, center=center)
        write_atomic(folder / "samples.png", picture)
        say(
            f"density, flow and surface are drawn in two dimensions, this {space.name} has "
            f"{space.dim}: {folder / 'samples.png'} shows its samples angle by angle"
        )
        return
    _plane(density, points, drawn, folder, names, center, style, lines)
    say(f"written to {folder}; open {folder / 'surface.html'} in a browser")


def _plane(
    density: SymmetricDensity,
    points: Tensor | None,
    drawn: Tensor,
    folder: Path,
    names: list[str] | None,
    center: list[float] | None,
    style: Style,
    lines: list[Array] | None,
) -> None:
    """All pictures of a density in two dimensions."""
    shown = drawn if points is None else points
    square = density_png(
        density,
        shown if style.dots else None,
        measure=style.measure,
        scale=style.scale,
        names=names,
        center=center,
    )
    write_atomic(folder / "density.png", square)
    write_atomic(folder / "flow.png", flow_png(density, center=center))
    if points is not None:
        beside = samples_png(density, points, drawn, names=names, center=center)
        write_atomic(folder / "samples.png", beside)
    page = density_page(
        density,
        measure=style.measure,
        scale=style.scale,
        names=names,
        samples=shown,
        dots=style.dots,
        coastlines=lines,
        title=f"Density on the {space_title(density.space)}",
    )
    write_atomic(folder / "surface.html", page)


def _names(space: Space, columns: list[str] | None) -> list[str] | None:
    """The user's names of the angles, if they are known."""
    angles = isinstance(space, Torus | KleinBottle)
    return columns if angles and columns and len(columns) == len(space.columns) else None


def _center(space: Space, text: str | None) -> list[float] | None:
    """`--center` as angles in the space's unit; "pi" stands for half a turn in radians."""
    if text is None:
        return None
    if not isinstance(space, Torus):
        raise OrbiflowError(f"--center belongs to the torus, not the {space.name}")
    signs = {"pi": math.pi, "-pi": -math.pi}
    try:
        values = [signs.get(part.strip()) or float(part) for part in text.split(",")]
    except ValueError as error:
        raise OrbiflowError(f"--center needs angles such as 0,0, got {text!r}") from error
    if len(values) != space.dim or not np.isfinite(values).all():
        raise OrbiflowError(f"--center needs {space.dim} angles, one a column, got {text!r}")
    return values


def _lines(path: Path) -> list[Array]:
    """Lines of latitude and longitude, parted by rows whose latitude is beyond 90."""
    values = read_table(path, columns=None, width=2).values
    breaks = np.flatnonzero(abs(values[:, 0]) > 90)
    parts = np.split(values, breaks)
    found = [part[abs(part[:, 0]) <= 90] for part in parts]
    return [part for part in found if len(part) > 1]
