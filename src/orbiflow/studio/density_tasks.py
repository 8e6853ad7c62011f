"""What the studio's workers do for densities: read a table, fit, draw, write what is taken away."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from orbiflow.errors import OrbiflowError, SettingError
from orbiflow.runtime import (
    NEVER,
    Call,
    Cancel,
    Outcome,
    Progress,
    Sink,
    as_part,
    find,
    ignore,
    make_folder,
    operation,
    write_atomic,
    write_json,
)
from orbiflow.settings import Count, OnlyWith, Range, Settings
from orbiflow.studio.brought_files import brought_file
from orbiflow.studio.settings import Job
from orbiflow.studio.taking import export_folder, files_of

if TYPE_CHECKING:
    from orbiflow.density import Density

TABLE, FIT, VIEW, SURFACE = "table.json", "model", "view.json", "surface.json"
MAX_SHOWN = 30
"""Columns of a table that are shown, and of which a density may be."""

MAX_ROWS, FIRST_ROWS = 200_000, 6
"""Rows that a table may have, and rows that are shown of it."""

MAX_NAME_LETTERS = 200
"""Letters of a column's name."""

SURFACE_CELLS = 120
FIT_SHARE = 0.9
"""Share of the work that is done when a density is fitted, and its pictures are to be made."""


class FitChoice(Settings, group="Density"):
    """What a density is fitted to."""

    space: Literal["torus", "sphere", "projective-plane", "klein-bottle"]
    """Where the rows live."""

    columns: tuple[str, ...]
    """Columns of the table, and what they are, such as phi=angle:degrees."""

    unit: Literal["radians", "degrees", "turns"] | None = None
    """Unit of angles that name none."""

    def check(self) -> None:
        """Check that there are columns, few enough to draw."""
        if not 0 < len(self.columns) <= MAX_SHOWN:
            raise SettingError(f"{{columns}} must be 1 to {MAX_SHOWN} names of columns")


@operation("studio table")
def table(job: Job, *, on_event: Sink = ignore, cancel: Cancel = NEVER) -> Outcome:
    """Look at the table of a project."""
    on_event(Progress(0.1, "reading the table"))
    view = table_view(brought_file(job.project, "table"))
    cancel.check()
    write_json(job.project / TABLE, view)
    return Outcome({"rows": view["rows"], "columns": len(view["columns"])})


@operation("studio density")
def density(
    job: Job, choice: FitChoice, *, on_event: Sink = ignore, cancel: Cancel = NEVER
) -> Outcome:
    """Fit a density to columns of a project's table, and draw it."""
    if not (job.project / TABLE).is_file():
        raise SettingError("this table was not read; upload another one")
    folder = make_folder(job.project / "fits" / str(job.task))
    data = brought_file(job.project, "table")
    options = {"data": data, "out": folder / FIT, "drop_missing": True, **choice.to_json()}
    call = find("density fit").call(options)
    fit_events = as_part(on_event, 0.0, FIT_SHARE)
    call.operation.function(**call.arguments, on_event=fit_events, cancel=cancel)
    cancel.check()
    view = _view(folder, data, as_part(on_event, FIT_SHARE, 1.0))
    cancel.check()
    write_json(folder / VIEW, view)
    for other in folder.parent.iterdir():
        if other.name != folder.name:
            shutil.rmtree(other, ignore_errors=True)
    return Outcome({"fit": job.task, "rows": view["rows"]})


def _view(folder: Path, data: Path, on_event: Sink) -> dict[str, Any]:
    """Return what a page shows of a fit, and write the files of its surface and its map."""
    from orbiflow.density import (
        PlotSettings,
        SavedDensity,
        TableSettings,
        flat_data,
        flat_frame,
        surface_data,
    )

    saved = SavedDensity.read(folder / FIT)
    fitted, names = saved.density, saved.columns
    space = fitted.space
    on_event(Progress(0.0, "drawing"))
    options = TableSettings(drop_missing=True)
    rows = saved.rows(data, options, ignore).values
    points = space.to_chart(rows)
    if space.is_planar:
        surface = surface_data(
            fitted, PlotSettings(names=names, dots=True), samples=points, resolution=SURFACE_CELLS,
            levels=True,
        )  # fmt: skip
        write_json(folder / SURFACE, surface)
    on_event(Progress(0.5, "drawing"))
    axes = tuple(range(min(2, space.dim)))
    write_json(map_file(folder, axes), flat_data(fitted, axes if space.dim > 1 else None))
    return {
        "space": space.name,
        "columns": list(names),
        "unit": space.unit,
        "roles": [str(role) for role in space.roles(space.dim)] if space.is_torus else [],
        "angles": space.dim if space.is_torus else 0,
        "surface": space.is_planar,
        "rows": len(rows),
        **flat_frame(fitted, names, points),
    }


@operation("studio density map")
def density_map(
    job: Job,
    fit: Count,
    axes: tuple[Annotated[int, Range(0, MAX_SHOWN)], ...],
    *,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Find the density of two angles of a fit, whatever the others are, on a grid.

    Args:
        fit: The number of the fit.
        axes: The numbers of the angles, from 0.
    """
    folder = fit_folder(job.project, fit)
    on_event(Progress(0.1, "finding the density of these two angles"))

    from orbiflow.density import flat_data

    flat = flat_data(_model(folder), axes)
    cancel.check()
    write_json(map_file(folder, axes), flat)
    return Outcome({"fit": fit, "axes": list(axes)})


class TakeChoice(Settings, group="Take away"):
    """What is taken away of a density."""

    what: Literal["model", "samples", "figures", "regions"]
    """Model: the density itself. Samples: new rows. Figures: pictures. Regions: the smallest outlines
    that hold a mass."""

    count: Annotated[int, Range(1, 1_000_000), OnlyWith(what=("samples",))] = 1000
    """Number of samples."""

    format: Annotated[Literal["png", "svg", "pdf"], OnlyWith(what=("figures",))] = "png"
    """Format of the figures."""

    mass: Annotated[
        tuple[Annotated[float, Range(above=0, below=1)], ...], OnlyWith(what=("regions",))
    ] = (0.5, 0.9)
    """Masses of the regions."""

    def call(self, model: Path, data: Path, columns: list[str], out: Path) -> Call:
        """Return the call that writes samples, figures or regions into a folder."""
        if self.what == "samples":
            options: dict[str, Any] = {"out": out / "samples.csv", "count": self.count}
        elif self.what == "regions":
            options = {"out": out / "regions.json", "mass": self.mass}
        else:
            options = {"out": out, "format": self.format, "data": data, "columns": columns}
            options |= {"drop_missing": True, "dots": True}
        name = {"samples": "sample", "regions": "region", "figures": "plot"}[self.what]
        return find(f"density {name}").call({**options, "model": model})


@operation("studio density take")
def take(
    job: Job, fit: int, choice: TakeChoice, *, on_event: Sink = ignore, cancel: Cancel = NEVER
) -> Outcome:
    """Write what a user takes away of a density.

    Args:
        fit: The number of the fit.
    """
    source, out = fit_folder(job.project, fit), make_folder(export_folder(job.project, job.task))
    if choice.what == "model":
        for file in (source / FIT).iterdir():
            write_atomic(out / file.name, file.read_bytes())
    else:
        columns = json.loads((source / VIEW).read_text())["columns"]
        call = choice.call(source / FIT, brought_file(job.project, "table"), columns, out)
        call.operation.function(**call.arguments, on_event=as_part(on_event), cancel=cancel)
    files = files_of(out)
    return Outcome({"takeaway": job.task, "what": choice.what, "files": files, "preview": False})


def _model(folder: Path) -> Density:
    from orbiflow.density import read_density

    return read_density(folder / FIT / "density.safetensors")[0]


def fit_folder(project: Path, number: int | None = None) -> Path:
    """Return the folder of a fit that is complete, the newest if there is no number.

    Raises `OrbiflowError` if there is none.
    """
    done = [int(view.parent.name) for view in project.glob(f"fits/[0-9]*/{VIEW}")]
    if number is None and done:
        number = max(done)
    if number not in done:
        raise OrbiflowError("there is no such density (any more); fit one first")
    return project / "fits" / str(number)


def map_file(fit: Path, axes: tuple[int, ...]) -> Path:
    """Return the file of a fit with the density of two of its angles on a grid."""
    return fit / f"map-{'-'.join(map(str, axes))}.json"


def table_view(path: Path) -> dict[str, Any]:
    """Return what a page shows of a table before anything is fitted.

    Raises `OrbiflowError` if it is no table of numbers, or too large.
    """
    from orbiflow.density import TableError, read_table, table_overview

    try:
        table = read_table(path)
        seen = table_overview(table, MAX_SHOWN)
    except TableError as error:
        cause = str(error).removeprefix(f"{path}: ").partition(";")[0]
        raise OrbiflowError(
            f"this table cannot be read: {cause}; save it again as CSV, with a row for each thing and "
            "plain numbers in its columns: decimal points, and nothing between thousands"
        ) from None
    if (rows := len(table.cells(0))) > MAX_ROWS:
        raise OrbiflowError(
            f"this table has {rows} rows, and at most {MAX_ROWS} are taken here; draw a sample of them"
        )
    names = [column["name"] for column in seen["columns"]]
    if max(map(len, names)) > MAX_NAME_LETTERS:
        raise OrbiflowError(f"the name of a column has over {MAX_NAME_LETTERS} letters; shorten it")
    shown = [table.numbers(table.names.index(name))[:FIRST_ROWS].tolist() for name in names]
    first = list(zip(*shown, strict=True))
    return {
        "rows": rows,
        "more": [name[:MAX_NAME_LETTERS] for name in table.names if name not in names][:MAX_SHOWN],
        "first": [[None if math.isnan(v) else float(f"{v:.6g}") for v in row] for row in first],
        **seen,
    }
