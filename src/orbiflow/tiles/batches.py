"""The search for tiles of many silhouettes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path, PurePath
from typing import Annotated, Any, Literal

from orbiflow.batch import (
    PAIRED,
    BatchKind,
    Column,
    ContactSheet,
    Entry,
    Matrix,
    Summary,
    WorkSettings,
    run_files,
)
from orbiflow.errors import SettingError
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
    pairs: Literal["all"] | None = None,
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
        pairs: With all, find two figures that tile the plane together for every pair of silhouettes,
            and show which go together.
        match: Only files whose names fit a pattern, such as "*.svg".
        figures: Also write figures for print.
    """
    shared = {**settings.to_json(), "figures": figures}
    if pairs is None and settings.ratio is not None:
        raise SettingError("{ratio} is for pairs; give {pairs} all, or leave it out")

    def call_of(name: str, results: str) -> Call:
        first, _, second = name.partition(PAIRED) if pairs else (name, "", "")
        names = [file for file in (first, second) if file]
        is_outline = all(PurePath(file).suffix.lower() in OUTLINES for file in names)
        options = {"smooth": reading.smooth} if is_outline else reading.to_json()
        # each call has one process: many at a time make better use of the cores
        fixed = {"image": first, "out": "out", "workers": 1}
        words = {"called": first, "shown_out": str(out / results)}
        more = {"second": second, "second_called": second} if second else {}
        return find("escherize").call({**shared, **options, **fixed, **words, **more})

    title = f"{'Pairs' if pairs else 'Tiles'} of {folder.name or 'a folder'}"
    sheet = PairSheet(PAIRS, title) if pairs else ContactSheet(TILES, title)
    return run_files(folder, out, sheet, call_of, match, work, on_event, cancel)


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


TILES = BatchKind(
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

PAIRS = replace(TILES, things="pairs", items="pairs", second="second")


class PairSheet(ContactSheet):
    """The table and page of all pairs of silhouettes, with the stars of each pair at a glance."""

    def matrix(self, entries: Sequence[Entry]) -> Matrix:
        """Return a table of the stars of the worse figure of each pair."""
        by_pair = {tuple(entry.file.split(PAIRED)): entry for entry in entries}
        names = sorted({name for pair in by_pair for name in pair})
        cells = [
            [_cell(by_pair.get((column, row))) for column in names[:number]]
            for number, row in enumerate(names)
        ]
        shown = [PurePath(name).stem for name in names]
        return Matrix("Which go together? The stars of the worse figure", shown, cells)


def _cell(entry: Entry | None) -> tuple[Entry, str, float] | None:
    stars = None if entry is None else entry.best.get("stars")
    if entry is None or not isinstance(stars, int | float):
        return None
    return entry, f"{stars:g}", (stars - 1) / 4
