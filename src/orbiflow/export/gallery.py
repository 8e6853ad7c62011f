"""All files of an escherization: a folder a class, and an overview."""

from __future__ import annotations

import contextlib
import functools
import json
from collections.abc import Iterable, Sequence
from pathlib import Path

from orbiflow.escher.result import ClassFailure, TileResult
from orbiflow.export.folder import FIGURE_FILES, TILE_FILES, figure_files, write_tile_folder
from orbiflow.export.index_page import index_page
from orbiflow.export.overview import overview_png
from orbiflow.export.result_file import folder_names
from orbiflow.figures.front import FrontPoint, front_png
from orbiflow.files import write_atomic
from orbiflow.processes import work
from orbiflow.silhouette.target import Target
from orbiflow.tilings import Colouring, colouring

RESULT, OVERVIEW, INDEX, FRONT = "result.json", "overview.png", "index.html", "front.png"


def write_gallery(
    results: Sequence[TileResult],
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
    names = folder_names([result.name for result in results])
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
    results: Sequence[TileResult], found: Iterable[TileResult], target: Target, out: Path
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
            result.name,
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
    results: Sequence[TileResult],
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
