"""Pictures of a density: the job of a `DensityPlotRequest`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from orbiflow.cancel import Cancel
from orbiflow.density.models.symmetric import SymmetricDensity
from orbiflow.density.spaces.space import Space
from orbiflow.density.tables import read_table
from orbiflow.errors import OrbiflowError
from orbiflow.figures.density_axes import space_title, view_of
from orbiflow.figures.density_corner import MOST_COLUMNS, corner_png
from orbiflow.figures.density_flow import flow_png
from orbiflow.figures.density_page import density_page
from orbiflow.figures.density_square import density_png, samples_png
from orbiflow.files import make_folder, write_set
from orbiflow.jobs.density_data import PICTURES, model_at, read_data, same_columns
from orbiflow.jobs.events import Finished, Note, Progress, Written
from orbiflow.jobs.records import RecordError
from orbiflow.jobs.requests import DensityPlotRequest
from orbiflow.jobs.run import Sink
from orbiflow.symmetry.isometry import Array
from orbiflow.threads import one_thread

SAMPLES = 3000


class _Drawing(NamedTuple):
    """What is drawn, and how."""

    density: SymmetricDensity
    request: DensityPlotRequest
    names: list[str] | None
    center: list[float] | None
    points: Tensor | None
    drawn: Tensor
    lines: list[Array] | None


@one_thread()
def density_plot(request: DensityPlotRequest, tell: Sink, cancel: Cancel) -> Finished:
    """Draw the square, the flow, samples and the surface; beyond two angles, all pairs of angles.

    All pictures are drawn before the first is written; those of an earlier model go.

    Returns:
        `summary`: `folder` and the names of its `files`.

    Raises:
        OrbiflowError: for anything that the user can mend.
        Cancelled: if it was told to stop; nothing is written.
    """
    drawing = _read(request, tell)
    space, out = drawing.density.space, request.out
    make_folder(out)
    pictures: dict[str, str | bytes] = {}
    makers = _plane(drawing) if space.dim == 2 else {"samples.png": _corner}
    for k, (name, make) in enumerate(makers.items()):
        cancel.check()
        tell(Progress(k / len(makers), f"drawing {name}"))
        pictures[name] = make(drawing)
    for path in write_set(out, PICTURES, pictures):
        tell(Written(path))
    if space.dim == 2:
        tell(Note(f"written to {out}; open {out / 'surface.html'} in a browser"))
    else:
        tell(
            Note(
                f"density, flow and surface are drawn in two dimensions, this {space.name} has "
                f"{space.dim}: {out / 'samples.png'} shows its samples angle by angle"
            )
        )
    return Finished("done", {"folder": str(out), "files": list(pictures)})


def _read(request: DensityPlotRequest, tell: Sink) -> _Drawing:
    """Everything that the pictures show; mistakes before work."""
    density, extra = model_at(request.model)
    space = density.space
    if request.coastlines is not None and space.name != "sphere":
        raise RecordError(f"{{coastlines}} belongs to the sphere, not the {space.name}")
    if space.dim > MOST_COLUMNS:
        raise OrbiflowError(
            f"this {space.name} has {space.dim} angles, pictures are of {MOST_COLUMNS} at most: "
            "draw columns of `orbiflow density sample` beside those of the data"
        )
    names, center = _names(space, extra.get("columns")), _center(space, request.center)
    view_of(space, names, center)
    lines = None if request.coastlines is None else _lines(request.coastlines)
    drawn = density.sample((SAMPLES,), torch.Generator().manual_seed(request.seed))
    points = None
    if request.data is not None:
        columns = request.columns or same_columns(request.data, extra)
        points = space.to_chart(read_data(request.data, columns, None, tell).values)
    return _Drawing(density, request, names, center, points, drawn, lines)


def _plane(drawing: _Drawing) -> dict[str, Any]:
    """What makes each picture of a density in two dimensions."""
    makers = {"density.png": _square, "flow.png": _flow}
    if drawing.points is not None:
        makers["samples.png"] = _samples
    return {**makers, "surface.html": _page}


def _shown(drawing: _Drawing) -> Tensor:
    return drawing.drawn if drawing.points is None else drawing.points


def _square(drawing: _Drawing) -> bytes:
    return density_png(
        drawing.density,
        _shown(drawing) if drawing.request.dots else None,
        measure=drawing.request.measure,
        scale=drawing.request.scale,
        names=drawing.names,
        center=drawing.center,
    )


def _flow(drawing: _Drawing) -> bytes:
    return flow_png(drawing.density, center=drawing.center)


def _samples(drawing: _Drawing) -> bytes:
    assert drawing.points is not None
    return samples_png(
        drawing.density, drawing.points, drawing.drawn, names=drawing.names, center=drawing.center
    )


def _corner(drawing: _Drawing) -> bytes:
    return corner_png(
        drawing.density, drawing.points, drawing.drawn, names=drawing.names, center=drawing.center
    )


def _page(drawing: _Drawing) -> str:
    return density_page(
        drawing.density,
        measure=drawing.request.measure,
        scale=drawing.request.scale,
        names=drawing.names,
        samples=_shown(drawing),
        dots=drawing.request.dots,
        coastlines=drawing.lines,
        title=f"Density on the {space_title(drawing.density.space)}",
    )


def _names(space: Space, columns: list[str] | None) -> list[str] | None:
    """The user's names of the angles, if they are known."""
    angles = space.unit is not None
    return columns if angles and columns and len(columns) == len(space.columns) else None


def _center(space: Space, text: str | None) -> list[float] | None:
    """`center` as angles in the space's unit; "pi" stands for half a turn in radians."""
    if text is None:
        return None
    if not space.is_torus:
        raise RecordError(f"{{center}} belongs to the torus, not the {space.name}")
    signs = {"pi": math.pi, "-pi": -math.pi}
    try:
        values = [signs.get(part.strip()) or float(part) for part in text.split(",")]
    except ValueError as error:
        raise RecordError(f"{{center}} needs angles such as 0,0, got {text!r}") from error
    if len(values) != space.dim or not np.isfinite(values).all():
        raise RecordError(f"{{center}} needs {space.dim} angles, one a column, got {text!r}")
    return values


def _lines(path: Path) -> list[Array]:
    """Lines of latitude and longitude, parted by rows whose latitude is beyond 90."""
    values = read_table(path, columns=None, width=2).values
    breaks = np.flatnonzero(abs(values[:, 0]) > 90)
    parts = np.split(values, breaks)
    found = [part[abs(part[:, 0]) <= 90] for part in parts]
    return [part for part in found if len(part) > 1]
