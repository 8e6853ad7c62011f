"""Pictures of a density: the job of a `DensityPlotRequest`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from orbiflow.density import (
    PlotSettings,
    Space,
    is_one_file,
    known_names,
    plot_density,
)
from orbiflow.drawing import column_width
from orbiflow.jobs.asked import (
    given,
    read_as,
    samples_asked,
)
from orbiflow.jobs.density_data import read_data, same_columns
from orbiflow.jobs.density_models import check_fits, model_at
from orbiflow.jobs.density_requests import DensityPlotRequest
from orbiflow.jobs.place import check_place, keep_apart
from orbiflow.jobs.run import Sink
from orbiflow.runtime import (
    Cancel,
    Finished,
    Note,
    Progress,
    RecordError,
    Written,
    one_thread,
)


@one_thread()
def density_plot(request: DensityPlotRequest, tell: Sink, cancel: Cancel) -> Finished:
    """Draw maps or the square, the flow, samples and the surface; beyond two angles, all pairs.

    All pictures are drawn before the first is written; those of an earlier model go.

    Returns:
        `summary`: `folder` and the names of its `files`.

    Raises:
        OrbiflowError: for anything that the user can mend.
        Cancelled: if it was told to stop; nothing is written.
    """
    single = is_one_file(request.out)
    _check_format(request, single)
    reads = (request.model, request.data, request.coastlines)
    if single:
        check_place(request.out, *reads)
    else:  # pictures may stand beside their model
        keep_apart(request.out, *reads)
    density, extra = model_at(request.model)
    settings = _settings(request, density.space, extra.get("columns"))
    points = None
    if request.data is not None:
        own = request.header
        columns = request.columns or same_columns(request.data, extra, tell, has_header=own)
        table = read_data(
            request.data, columns, None, tell, has_header=own, drop_missing=request.drop_missing
        )
        check_fits(request.data, table, density.space, extra, tell)
        points = table.values

    def told(share: float, what: str) -> None:
        cancel.check()
        tell(Progress(share, what))

    plotted = plot_density(density, request.out, settings, data=points, told=told)
    for path in plotted.files:
        tell(Written(path))
    printed = single or settings.sheet.printed
    for caption in plotted.captions if printed else ():
        tell(Note(f"caption: {caption}"))
    for note in plotted.notes:
        tell(Note(note))
    tell(Note(_said(request.out, single, density.space)))
    folder = request.out.parent if single else request.out
    return Finished("done", {"folder": str(folder), "files": [path.name for path in plotted.files]})


def _said(out: Path, single: bool, space: Space) -> str:
    if space.dim != 2:
        where = out if single else f"the picture in {out}"
        return (
            f"density, flow and surface are drawn in two dimensions, this {space.name} has "
            f"{space.dim}: {where} shows samples, angle by angle"
        )
    if single:
        return f"written {out}, a page a figure; a folder gets the surface to turn, too"
    return f"written to {out}; open {out / 'surface.html'} in a browser"


def _check_format(request: DensityPlotRequest, single: bool) -> None:
    if single and request.format not in (None, "pdf"):
        raise RecordError(f"{{out}} ends in .pdf but {{format}} is {request.format}")


def _settings(request: DensityPlotRequest, space: Space, columns: list[str] | None) -> PlotSettings:
    """Mistakes by the names of the fields."""
    if request.coastlines is not None and space.name != "sphere":
        raise RecordError(f"{{coastlines}} belongs to the sphere, not the {space.name}")
    if not space.is_round:
        for name in ("projection", "radius"):
            if getattr(request, name) not in ("auto", None):
                raise RecordError(f"{{{name}}} belongs to maps, not to the {space.name}")
    wanted = (
        "format", "measure", "scale", "projection", "radius", "regions", "samples", "dots", "seed",
        "region_samples",
    )  # fmt: skip
    if request.regions and space.dim != 2:
        raise RecordError(
            f"{{regions}} are drawn in two dimensions, this {space.name} has {space.dim}: `orbiflow "
            "density region` finds their thresholds"
        )
    samples_asked(request, request.regions or (), "region_samples")
    asked: dict[str, Any] = given(request, wanted)
    if request.width is not None:
        asked["width"] = read_as("width", column_width, request.width)
        asked.setdefault("format", "pdf")
    return PlotSettings(
        names=known_names(space, columns),
        center=_center(space, request.center),
        coastlines=request.coastlines,
        **asked,
    )


def _center(space: Space, text: str | None) -> list[float] | None:
    """`center`: angles in the space's unit, where "pi" is half a turn in radians; or of a map."""
    if text is None:
        return None
    if not (space.is_torus or space.is_round):
        raise RecordError(f"{{center}} belongs to the torus and to maps, not to the {space.name}")
    signs = {} if space.is_round else {"pi": math.pi, "-pi": -math.pi}
    example = "40,140 (latitude, longitude) or 140" if space.is_round else "angles such as 0,0"
    try:
        values = [signs.get(part.strip()) or float(part) for part in text.split(",")]
    except ValueError as error:
        raise RecordError(f"{{center}} needs {example}, got {text!r}") from error
    finite = bool(np.isfinite(values).all())
    if space.is_round and not (len(values) in (1, 2) and finite):
        raise RecordError(f"{{center}} needs {example}, got {text!r}")
    if space.is_torus and not (len(values) == space.dim and finite):
        raise RecordError(f"{{center}} needs {space.dim} angles, one a column, got {text!r}")
    return values
