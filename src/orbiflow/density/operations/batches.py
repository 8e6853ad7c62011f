"""Fitting densities to many tables."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from orbiflow.batch import Column, Kind, Summary, WorkSettings, run_files
from orbiflow.density.fitting import ComponentSettings
from orbiflow.density.run_folder import written_files
from orbiflow.density.tables import SpaceSettings, TableSettings
from orbiflow.runtime import Call, Cancel, Outcome, Sink, find, ignore, operation
from orbiflow.settings import Option

NEVER = Cancel()


@operation("density batch", keeps_partial=True, starts_processes=True)
def batch(
    folder: Path,
    where: SpaceSettings,
    density: ComponentSettings = ComponentSettings(),
    out: Annotated[Path, Option("-o")] = Path("batch"),
    table: TableSettings = TableSettings(),
    work: WorkSettings = WorkSettings(),
    *,
    match: str | None = None,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Fit a density to every table of a folder, here or on a Dask cluster.

    Writes a folder for each table, as fit does, with a small picture; batch.csv, a table of all; and
    index.html, a page of all. If it is interrupted, run the same command again to resume. The exit
    status is 1 if some have no density.

    Args:
        folder: Folder of tables, searched with the folders inside: CSV, TSV, NPY or Parquet.
        out: Folder for the results; an earlier batch there is resumed.
        match: Only files whose names fit a pattern, such as "*.csv".
    """
    given = {**where.to_json(), **density.to_json(), **table.to_json(), "picture": True}

    def call_of(name: str) -> Call:
        return find("density fit").call({**given, "data": name, "out": "out"})

    title = f"Densities of {folder.name or 'a folder'}"
    return run_files(folder, out, DENSITIES, title, call_of, match, work, on_event, cancel)


def _figures(summary: Summary) -> dict[str, Any]:
    likelihood = summary["log_likelihood"]
    return {
        "rows": summary["rows"],
        "log_likelihood": likelihood["natural"],
        "gain": likelihood["natural"] - likelihood["uniform"],
        "held_out": likelihood["square_validation"],
    }


DENSITIES = Kind(
    things="tables",
    items="files",
    endings=(".csv", ".tsv", ".txt", ".npy", ".parquet"),
    most_bytes=256 * 2**20,
    reads="data",
    writes="out",
    modules=("orbiflow.density.estimator", "orbiflow.density.pictures.thumbnail"),
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
