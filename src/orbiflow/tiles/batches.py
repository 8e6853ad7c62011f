"""The search for tiles of many silhouettes."""

from __future__ import annotations

from pathlib import Path, PurePath
from typing import Annotated, Any

from orbiflow.batch import Column, Kind, Summary, WorkSettings, run_files
from orbiflow.runtime import NEVER, Call, Cancel, Outcome, Sink, find, ignore, operation
from orbiflow.settings import Option
from orbiflow.tiles.search import SearchSettings
from orbiflow.tiles.silhouette import ReadingSettings

# Endings of silhouettes that are no pictures: how these are read does not apply to them
OUTLINES = (".svg", ".json", ".geojson", ".dat", ".wkt")


@operation("batch", keeps_partial=True, starts_processes=True)
def batch(
    folder: Path,
    out: Annotated[Path, Option("-o")] = Path("batch"),
    settings: SearchSettings = SearchSettings(),
    reading: ReadingSettings = ReadingSettings(),
    work: WorkSettings = WorkSettings(),
    *,
    match: str | None = None,
    figures: bool = False,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Find tiles for every silhouette of a folder, here or on a Dask cluster.

    Writes a folder for each silhouette, as escherize does; batch.csv, a table of all; and
    index.html, a page of all. Both grow as results come. If it is interrupted, run the same command
    again to resume: nothing is done twice unless a file or an option has changed. The exit status
    is 1 if some have no tile.

    Args:
        folder: Folder of silhouettes, searched with the folders inside: PNG, JPEG, WebP, SVG, and
            polygons (.json, .geojson, .dat, .wkt).
        out: Folder for the results; an earlier batch there is resumed.
        match: Only files whose names fit a pattern, such as "*.svg".
        figures: Also write figures for print.
    """
    given = {**settings.to_json(), "figures": figures}

    def call_of(name: str, results: str) -> Call:
        is_outline = PurePath(name).suffix.lower() in OUTLINES
        own = {"smooth": reading.smooth} if is_outline else reading.to_json()
        # each silhouette has one process: many at a time make better use of the cores
        fixed = {"image": name, "out": "out", "workers": 1}
        words = {"called": name, "shown_out": str(out / results)}
        return find("escherize").call({**given, **own, **fixed, **words})

    title = f"Tiles of {folder.name or 'a folder'}"
    return run_files(folder, out, TILES, title, call_of, match, work, on_event, cancel)


def _best(summary: Summary) -> dict[str, Any]:
    names = ("class", "word", "stars", "score", "iou", "deformation", "recognised", "certified")
    tiles = summary["tiles"]
    return {name: tiles[0][name] for name in names} if tiles else {}


def _tiling(summary: Summary) -> str | None:
    tiles = summary["tiles"]
    return f"{tiles[0]['class']}/tiling.png" if tiles else None


def _written(folder: Path) -> set[str]:
    from orbiflow.tiles.run_folder import written_files

    return written_files(folder)


TILES = Kind(
    things="silhouettes",
    items="files",
    endings=(".png", ".jpg", ".jpeg", ".webp", ".svg", ".json", ".geojson", ".dat", ".wkt"),
    most_bytes=64 * 2**20,
    reads="image",
    writes="out",
    modules=("orbiflow.tiles.run_folder.writing", "orbiflow.tiles.search.escherizing"),
    columns=(
        Column("class", "class"),
        Column("word", "likeness"),
        Column("stars", "stars", "g"),
        Column("score", "score", ".3f"),
        Column("iou", "IoU", ".3f"),
        Column("deformation", "bent", ".3f", falling=False),
        Column("recognised", "recognised", ".3f"),
        Column("certified", "certified"),
    ),
    best=_best,
    picture=_tiling,
    shows="Tiling",
    opens="index.html",
    written=_written,
)
