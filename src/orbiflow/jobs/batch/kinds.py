"""Batches of silhouettes and of tables."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from orbiflow.jobs.batch.kind import (
    Column,
    FolderKind,
    Summary,
)


def _best_tile(summary: Summary) -> dict[str, Any]:
    tiles = summary["tiles"]
    names = ("class", "score", "iou", "deformation", "recognised", "certified")
    return {name: tiles[0][name] for name in names} if tiles else {}


def _tiling(summary: Summary) -> str | None:
    tiles = summary["tiles"]
    return f"{tiles[0]['class']}/tiling.png" if tiles else None


def _files_of_a_search(folder: Path) -> set[str]:
    from orbiflow.tiles import written_files

    return written_files(folder)


TILES = FolderKind(
    things="silhouettes",
    items="files",
    endings=(".png", ".jpg", ".jpeg", ".webp", ".svg", ".json", ".geojson", ".dat"),
    most_bytes=64 * 2**20,
    reads="image",
    writes="out",
    modules=("orbiflow.jobs.escherize",),
    columns=(
        Column("class", "class"),
        Column("score", "score", ".3f"),
        Column("iou", "IoU", ".3f"),
        Column("deformation", "bent", ".3f", falling=False),
        Column("recognised", "recognised", ".3f"),
        Column("certified", "certified"),
    ),
    best=_best_tile,
    picture=_tiling,
    shows="Tiling",
    opens="index.html",
    earlier=_files_of_a_search,
)


def _files_of_a_fit(folder: Path) -> set[str]:
    from orbiflow.jobs.density_folder import written_files

    return written_files(folder)


def _fit(summary: Summary) -> dict[str, Any]:
    likelihood = summary["log_likelihood"]
    gain = likelihood["natural"] - likelihood["uniform"]
    return {
        "rows": summary["rows"],
        "log_likelihood": likelihood["natural"],
        "gain": gain,
        "held_out": likelihood["square_validation"],
    }


DENSITIES = FolderKind(
    things="tables",
    items="files",
    endings=(".csv", ".tsv", ".txt", ".npy", ".parquet"),
    most_bytes=256 * 2**20,
    reads="data",
    writes="out",
    modules=("orbiflow.jobs.density_fit", "orbiflow.density.pictures.thumbnail"),
    columns=(
        Column("rows", "rows", "d"),
        Column("log_likelihood", "mean log density", ".4f"),
        Column("gain", "more than uniform", ".4f"),
        Column("held_out", "held out, on the square", ".4f"),
    ),
    best=_fit,
    picture=lambda summary: summary["picture"],
    shows="Density",
    earlier=_files_of_a_fit,
)
