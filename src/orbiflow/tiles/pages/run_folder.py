"""All files of an escherization: a folder a class, and an overview."""

from __future__ import annotations

import contextlib
import functools
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from orbiflow.arguments import instance
from orbiflow.arguments import path as as_path
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import (
    ResultFolder,
    work,
    write_atomic,
)
from orbiflow.tiles.pages.index import index_page
from orbiflow.tiles.pages.overview import overview_png
from orbiflow.tiles.pages.tile_folder import (
    FIGURE_FILES,
    TILE_FILES,
    figure_files,
    write_tile_folder,
)
from orbiflow.tiles.pictures import FrontPoint, front_png
from orbiflow.tiles.result_file import RESULT, folder_names
from orbiflow.tiles.search import (
    ClassFailure,
    LikenessSearch,
    SearchMethod,
    report,
)
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


def write_run(
    results: Sequence[EscherTile],
    target: Target,
    out: str | Path,
    settings: SearchMethod | None = None,
    *,
    failures: Sequence[ClassFailure] = (),
    figures: bool = False,
) -> Path:
    """Write tiles that were found as a result folder: a folder a class, overviews, `result.json`.

    Args:
        results: best first, at least one.
        target: of the search.
        out: the folder; an earlier run there is replaced whole.
        settings: of the search, for the record; default those of `escherize`.
        failures: classes without a tile.
        figures: write the figures for print, too.

    Returns:
        The folder, which every command on a RESULT takes.

    Raises:
        OrbiflowError: without any result.
        OutputError: if the folder holds what orbiflow did not write, or cannot be written.
    """
    if not results:
        raise OrbiflowError("there is no tile to write; the search's failures say why")
    target = instance(target, Target, "the target", "Target.read(file) gives one")
    folder = ResultFolder(as_path(out, "the folder to write into"), written_files)
    settings = LikenessSearch.for_effort("normal") if settings is None else settings
    seconds = sum(result.seconds for result in results)
    document = report(target, results, failures, settings, seconds=seconds, workers=1)
    with folder.replaced() as staged:
        fill_run(staged, document, results, target, failures=failures, figures=figures)
    return folder.path


def fill_run(
    folder: Path,
    document: dict[str, Any],
    results: Sequence[EscherTile],
    target: Target,
    *,
    found: Sequence[EscherTile] = (),
    failures: Sequence[ClassFailure] = (),
    figures: bool = False,
    workers: int = 1,
) -> list[Path]:
    """Write all files of a run into an empty folder.

    Args:
        document: for `result.json`; see `orbiflow.escher.report.report`.
        found: all tiles, those that are not listed among them, of a search for both.
        workers: processes that draw figures.

    Returns:
        The files, relative to the folder, in order.

    Raises:
        OutputError: if a file cannot be written.
    """
    if results:
        write_gallery(results, target, folder, failures=failures, figures=figures, workers=workers)
        if document["objective"] == "both":
            write_front(results, found or results, target, folder)
    write_atomic(folder / RESULT, json.dumps(document, allow_nan=False))
    return sorted(path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
