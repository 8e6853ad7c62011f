"""All files of an escherization: a folder a class, and an overview."""

from __future__ import annotations

import contextlib
import functools
import json
from collections.abc import Iterable, Sequence
from pathlib import Path

from orbiflow.arguments import instance
from orbiflow.arguments import path as as_path
from orbiflow.runtime import Note, ResultFolder, Sink, Written, ignore, work, write_atomic
from orbiflow.tiles.pages.index import index_page
from orbiflow.tiles.pages.overview import overview_png
from orbiflow.tiles.pages.tile_folder import (
    FIELD_FILES,
    FIGURE_FILES,
    TILE_FILES,
    figure_files,
    write_tile_folder,
)
from orbiflow.tiles.pictures import FrontPoint, front_png
from orbiflow.tiles.result_file import RESULT, folder_names
from orbiflow.tiles.search import ClassFailure, SearchResult, report
from orbiflow.tiles.silhouette import Target
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tilings import Colouring, colouring

OVERVIEW, INDEX, FRONT = "overview.png", "index.html", "front.png"


def write_gallery(
    results: Sequence[EscherTile],
    target: Target,
    out: Path,
    *,
    failures: Sequence[ClassFailure] = (),
    figures: bool = False,
    workers: int = 1,
) -> None:
    """Write each class's folder, `overview.png` and `index.html`.

    Args:
        results: best first, at least one.
        target: of the search.
        out: a folder.
        failures: classes without a tile, to be named in the page.
        figures: write the figures, too.
        workers: processes that draw figures; the pictures alone are drawn in less time than it takes to
            start one.

    Raises:
        OutputError: if a file cannot be written.
    """
    names = folder_names([result.isohedral_class for result in results])
    folders = [out / name for name in names]
    colours = [colouring(result.tile) for result in results]
    draw = functools.partial(_draw, results, target, folders, colours, figures)
    if workers == 1 or len(results) == 1 or not figures:
        for k in range(len(results)):
            draw(k)
    else:
        with contextlib.closing(work(draw, range(len(results)), workers)) as news:
            for _ in news:
                pass
    write_atomic(out / OVERVIEW, overview_png(results, target, colours, failures=failures))
    extra = [figure_files(result) if figures else () for result in results]
    page = index_page(results, target, names, failures=failures, figures=extra)
    write_atomic(out / INDEX, page)


def write_front(
    results: Sequence[EscherTile], found: Iterable[EscherTile], target: Target, out: Path
) -> None:
    """Write `front.png`: a list's tiles among all that were found, by deformation and overlap.

    Raises:
        OutputError: if the file cannot be written.
    """
    listed = {id(result.tile) for result in results}
    others = [result for result in found if id(result.tile) not in listed]
    points = [
        FrontPoint(
            result.deformation,
            result.metrics.iou,
            result.tile.polygon,
            result.isohedral_class,
            result.objective,
            id(result.tile) in listed,
            bool(result.front),
        )
        for result in (*others, *results)
        if result.deformation is not None
    ]
    if points:
        write_atomic(out / FRONT, front_png(points, y_down=target.y_down))


def _draw(
    results: Sequence[EscherTile],
    target: Target,
    folders: Sequence[Path],
    colours: Sequence[Colouring],
    figures: bool,
    index: int,
    *_: object,
) -> None:
    """The folder of one result; in a worker process, too."""
    write_tile_folder(
        results[index], target, folders[index], colours=colours[index], figures=figures
    )


def written_files(folder: Path) -> set[str]:
    """Paths of the files that an earlier search wrote into `folder`, by its result.json.

    Relative, with slashes; none if there is no such run.
    """
    try:
        document = json.loads((folder / RESULT).read_text(encoding="utf-8"))
        classes = [str(entry["class"]) for entry in document["tiles"]]
        ours = isinstance(document["schema_version"], int)
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        ours, classes = False, []
    if not ours:
        return set()
    front = {FRONT} if document.get("objective") == "both" else set()
    files = (*TILE_FILES, *FIGURE_FILES)
    inside = {f"{name}/{file}" for name in folder_names(classes) for file in files}
    return {RESULT, OVERVIEW, INDEX} | front | inside


def result_folder(out: str | Path) -> ResultFolder:
    """Return the folder that a run is written to.

    Raises:
        OutputError: If it holds what orbiflow did not write.
    """
    return ResultFolder(as_path(out, "the folder to write into"), written_files)


def write_run(
    result: SearchResult,
    out: str | Path,
    *,
    figures: bool = False,
    on_event: Sink = ignore,
) -> list[Path]:
    """Write what a search found as a result folder: a folder a class, overviews, `result.json`.

    An earlier run there is replaced whole, unless the search was interrupted before any class had its
    tile: a first look is less than an earlier run's tiles.

    Args:
        result: What the search found.
        out: The folder, which every command on a RESULT takes.
        figures: Write the figures for print, too, in as many processes as the search had.
        on_event: Called with each `Note` and `Written`.

    Returns:
        The files; none if an earlier run was left as it is.

    Raises:
        OutputError: If the folder holds what orbiflow did not write, or cannot be written.
    """
    instance(result, SearchResult, "the result", "escherize(target) gives one")
    folder, tiles = result_folder(out), result.tiles
    earlier = folder.has_a_run and (folder.path / OVERVIEW).is_file()
    if earlier and all(tile.isohedral_class in result.interrupted for tile in tiles):
        return []
    if tiles:
        on_event(Note("drawing"))
    if tiles and figures and not any(FIELD_FILES[0] in figure_files(tile) for tile in tiles):
        on_event(Note("no flow made these tiles, so there is none to draw: the silhouette bent"))
    with folder.replaced() as staged:
        _fill(staged, result, figures=figures)
        files = [path.relative_to(staged) for path in staged.rglob("*") if path.is_file()]
    written = [folder.path / path for path in sorted(files)]
    for path in written:
        on_event(Written(path))
    return written


def _fill(folder: Path, result: SearchResult, *, figures: bool) -> None:
    """Write all files of a run into an empty folder."""
    tiles, target = result.tiles, result.target
    document = report(result)
    if tiles:
        workers = result.workers if figures else 1
        failures = result.failures
        write_gallery(tiles, target, folder, failures=failures, figures=figures, workers=workers)
        if document["objective"] == "both":
            write_front(tiles, result.found or tiles, target, folder)
    write_atomic(folder / RESULT, json.dumps(document, allow_nan=False))
