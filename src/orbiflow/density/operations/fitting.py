"""Fitting a density to a table, or to every table of a folder: the commands fit and batch."""

from __future__ import annotations

import json
import time
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from orbiflow import runtime
from orbiflow.batch import BatchKind, Column, ContactSheet, Summary, WorkSettings, run_files
from orbiflow.density import comparing, fitting, inference, models, pictures, spaces, tables
from orbiflow.density.data import asked_roles
from orbiflow.density.fitting import DensitySettings
from orbiflow.density.run_folder import write_files, written_files
from orbiflow.density.tables import RowSettings, SpaceSettings
from orbiflow.errors import DataWarning, SettingError
from orbiflow.settings import DefaultText, Hidden, Option, fields_of

if TYPE_CHECKING:
    from orbiflow.arrays import Array
    from orbiflow.density.data import Asked, Role, TableRows
    from orbiflow.density.estimator import DensityEstimator
    from orbiflow.density.spaces import Space

MOST_SCORED = 20_000
"""Rows over which the mean log density is taken: up to here all of them, for a few hundredths of the
fit's time at most; of 100,000 rows of six angles it would be two fifths."""


class FitSettings(DensitySettings, SpaceSettings, group="Density"):
    """Where the data live, and how a density is fitted."""

    def check(self) -> None:
        """Check that there is such a space, and that what is set is of what is fitted."""
        SpaceSettings.check(self)
        DensitySettings.check(self)


@runtime.operation("density fit")
def fit(
    data: Path,
    density: FitSettings,
    reading: RowSettings = RowSettings(),
    *,
    given: Annotated[tuple[str, ...], DefaultText("none")] = (),
    out: Annotated[Path, Option("--out", "-o")] = Path("density"),
    picture: Annotated[bool, Hidden()] = False,
    on_event: runtime.Sink = runtime.ignore,
    cancel: runtime.Cancel = runtime.Cancel(),
) -> runtime.Outcome:
    """Fit a density: angles (torus), lat,lon or x,y,z (sphere), axes (projective plane) or theta,phi.

    Writes density.safetensors and report.json into the folder.

    Args:
        data: CSV, TSV, NPY or Parquet.
        given: Columns on which the density may depend, and what they are, as for columns:
            temperature=linear,hour=cycle:24,level=word. The density where they are known, too.
        out: Folder for the results, made if need be.
        picture: Also draw a small picture, thumbnail.png.
    """
    begin = time.perf_counter()
    _check(density, reading)
    with runtime.one_thread():
        covariates = _asked_columns(given, reading)
        rows = tables.read_rows(
            data, reading, on_event, where=density, given=[str(name) for name in covariates]
        )
        values = rows.values
        folder = runtime.ResultFolder(out, written_files)
        runtime.check_output_folder(out, data)
        on_event(runtime.Note(f"columns: {rows.declaration}"))
        roles = _given_roles(rows, covariates, density.unit, on_event) if given else None
        estimator = fit_rows(rows, density, reading, on_event, cancel, roles)
        document = _document(
            estimator, rows, {**density.values(), **reading.values()}, density.seed
        )
        document["seconds"] = time.perf_counter() - begin
        sketch = comparing.RowSketch.of(estimator.space_, values[rows.whole])
        model = models.density_to_bytes(
            estimator.density_,
            columns=list(rows.columns),
            roles=[role and str(role) for role in rows.roles],
            fitted_rows=runtime.to_json(sketch),
        )
        report = json.dumps(document, allow_nan=False, indent=1)
        files = {pictures.MODEL: model, pictures.REPORT: report}
        if picture:
            files[pictures.THUMBNAIL] = pictures.density_thumbnail(estimator.density_, values)
    write_files(folder, files, on_event)
    for line in (*estimator.report_.words(), *_words(document, len(values), out)):
        on_event(runtime.Note(line) if isinstance(line, str) else line)
    summary = {name: document[name] for name in ("log_likelihood", "seconds")}
    summary |= {"folder": str(out), "rows": len(values)}
    return runtime.Outcome({**summary, "picture": pictures.THUMBNAIL if picture else None})


def _asked_columns(given: Sequence[str], reading: RowSettings) -> Asked:
    """Return the columns of a table that are given to a fit, which must be one of whole rows."""
    if not given:
        return {}
    fitting.check_complete(reading.kept_missing)
    try:
        return asked_roles(given)
    except SettingError as error:
        raise SettingError(error.template.replace("{columns}", "{given}")) from error


def _given_roles(
    rows: TableRows, asked: Asked, unit: str | None, tell: runtime.Sink
) -> dict[str, Role]:
    """Return what is known of rows, by its name, before anything is fitted.

    `unit` is that of angles that name none.
    """
    from orbiflow.density.data import given_roles, in_file

    roles = given_roles(list(rows.given), rows.given, asked, unit, where=rows.source.where)
    try:
        covariates = spaces.Covariates.of(rows.given, roles)
        doubts = covariates.fit_doubts(rows.given)
    except SettingError as error:
        refusal = in_file(error, rows.source.where)
        refusal.template = refusal.template.replace("{columns}", "{given}")
        raise refusal from error
    tell(runtime.Note(f"given: {covariates.declaration}"))
    for doubt in doubts:
        tell(runtime.Note(f"WARNING: {doubt}"))
    return roles


def space_of(where: SpaceSettings, names: Sequence[str], unit: str | None) -> str | Space:
    """Return the space of columns, if settings tell it, otherwise its name: data tell the rest."""
    if (form := where.rotation_form(names)) is not None:
        options = {"symmetry": where.crystal, "specimen": where.specimen, "passive": where.passive}
        return spaces.make_space(where.space, form=form, unit=unit or "radians", **options)
    if not where.cell:
        return where.space
    return spaces.make_space(where.space, cell=where.cell, fractional=where.fractional)


def columns_of(where: SpaceSettings, rows: TableRows, seed: int = 0) -> spaces.DataColumns:
    """Return what settings and names say of the space of a table's rows."""
    names = rows.own_names
    return spaces.DataColumns(space_of(where, names, rows.unit), seed=seed)


def fit_rows(
    rows: TableRows,
    density: SpaceSettings,
    reading: RowSettings,
    tell: runtime.Sink,
    cancel: runtime.Cancel,
    given: Mapping[str, Role] | None = None,
) -> DensityEstimator:
    """Fit a density to the rows of a table; where columns are `given`, also by what they are.

    Beside the space, `density` has settings of the fit, which are taken where they were set.
    """
    from orbiflow.density.estimator import DensityEstimator

    parameters: dict[str, Any] = {
        name: getattr(density, name)
        for name in (entry.name for entry in fields_of(DensitySettings))
        if name in density.fields_given
    }
    parameters |= {"space": columns_of(density, rows).space, "missing": reading.kept_missing}
    progress = runtime.progress_events(tell, cancel)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)  # notes say the same
        return DensityEstimator(**parameters).fit(rows, given=given, progress=progress)


def _check(density: FitSettings, reading: RowSettings) -> None:
    """Refuse rows that such a density cannot be fitted to, before they are read."""
    kinds = {role.kind for role in asked_roles(reading.columns).values() if role is not None}
    density.check_rows("refuse", "group" if "group" in kinds else None)
    if reading.missing == "marginalise":
        check_marginalised(density, density)


def check_marginalised(where: SpaceSettings, settings: DensitySettings) -> None:
    """Refuse what cannot be fitted to rows that lack angles."""
    if where.space != "torus":
        raise SettingError(
            f"{{missing}} marginalise is for angles on a torus: on the {where.space} no coordinate is "
            "known without the other; use {missing} drop"
        )
    settings.check_rows("marginalise")


def _document(
    estimator: DensityEstimator, rows: TableRows, asked: Mapping[str, Any], seed: int
) -> dict[str, Any]:
    """Return what report.json says; `seed` chooses the rows that are scored."""
    import numpy as np

    report, space = estimator.report_, estimator.space_
    scored = np.flatnonzero(rows.whole if rows.weights is None else rows.whole & (rows.weights > 0))
    if len(scored) > MOST_SCORED:
        scored = np.sort(np.random.default_rng(seed).choice(scored, MOST_SCORED, replace=False))
    weights = None if rows.weights is None else rows.weights[scored]
    return {
        "space": {"name": space.name, **space.settings()},
        "columns": rows.columns,
        "declaration": rows.declaration,
        "settings": {name: asked[name] for name in fitting.REPORTED},
        "log_likelihood": {
            "natural": _mean_score(estimator, rows.values[scored], weights),
            "natural_rows": len(scored),
            "uniform": uniform_score(estimator, rows.values[scored], weights),
            "square_train": -report.train_nll,
            "square_validation": -report.validation_nll,
        },
        "report": runtime.to_json(report),
    }


def _mean_score(estimator: DensityEstimator, values: Array, weights: Array | None) -> float:
    """Return the mean log density of rows (N, k) of the fit, which were checked then."""
    may_lack = estimator.missing == "marginalise"
    points = inference.chart_of_rows(estimator.space_, values, may_lack=may_lack)
    scores = inference.at_observed(estimator.density_, points, measure="natural")
    return fitting.weighted_mean(scores, weights)


def uniform_score(estimator: DensityEstimator, values: Array, weights: Array | None) -> float:
    """Return the mean log density in natural measure of the uniform distribution at rows (N, k)."""
    return fitting.weighted_mean(inference.uniform_logs(estimator.space_, values), weights)


def _words(document: Mapping[str, Any], rows: int, out: Path) -> tuple[str, str]:
    """Return in words what came of a fit to so many rows."""
    likelihood, mass = document["log_likelihood"], document["report"]["mass"]
    gain = likelihood["natural"] - likelihood["uniform"]
    scored = likelihood["natural_rows"]
    which = "these rows" if scored == rows else f"{scored} of them"
    integral = "" if mass is None else f"; integral {mass:.5f}"
    return (
        f"{rows} rows: mean log density at {which} {likelihood['natural']:.4f} nats, {gain:z.4f} more "
        f"than the uniform density{integral}",
        f"written to {out} in {document['seconds']:.0f} s",
    )


@runtime.operation("density batch", keeps_partial=True, starts_processes=True)
def batch(
    folder: Path,
    density: FitSettings,
    reading: RowSettings = RowSettings(),
    out: Annotated[Path, Option("-o")] = Path("batch"),
    work: WorkSettings = WorkSettings(),
    *,
    match: str | None = None,
    on_event: runtime.Sink = runtime.ignore,
    cancel: runtime.Cancel = runtime.Cancel(),
) -> runtime.Outcome:
    """Fit a density to every table of a folder, here or on a Dask cluster.

    Writes a folder for each table, as fit does, with a small picture; batch.csv, a table of all; and
    index.html, a page of all. If it is interrupted, run the same command again to resume. The exit
    status is 1 if some have no density.

    Args:
        folder: Folder of tables, searched with the folders inside: CSV, TSV, NPY or Parquet.
        out: Folder for the results; an earlier batch there is resumed.
        match: Only files whose names fit a pattern, such as "*.csv".
    """
    _check(density, reading)
    arguments = {**density.to_json(), **reading.to_json(), "picture": True}

    def call_of(name: str, _results: str) -> runtime.Call:
        return runtime.find("density fit").call({**arguments, "data": name, "out": "out"})

    sheet = ContactSheet(DENSITIES, f"Densities of {folder.name or 'a folder'}")
    return run_files(folder, out, sheet, call_of, match, work, on_event, cancel)


def _figures(summary: Summary) -> dict[str, Any]:
    likelihood = summary["log_likelihood"]
    return {
        "rows": summary["rows"],
        "log_likelihood": likelihood["natural"],
        "gain": likelihood["natural"] - likelihood["uniform"],
        "held_out": likelihood["square_validation"],
    }


DENSITIES = BatchKind(
    things="tables",
    items="files",
    endings=(".csv", ".tsv", ".txt", ".npy", ".parquet"),
    most_bytes=256 * 2**20,
    reads="data",
    writes="out",
    modules=("orbiflow.density.estimator", "orbiflow.density.pictures.plots"),
    columns=(
        Column("rows", "rows", "d"),
        Column("log_likelihood", "mean log density", ".4f"),
        Column("gain", "more than uniform", ".4f"),
        Column("held_out", "held out, on the square", ".4f"),
    ),
    best=_figures,
    picture=lambda summary: summary["picture"],
    shows="Density",
    written=written_files,
)
