"""The folder of a search, as `orbiflow escherize` leaves it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from orbiflow.arguments import instance
from orbiflow.arguments import path as as_path
from orbiflow.errors import OrbiflowError
from orbiflow.escher.bending_settings import BendingSettings
from orbiflow.escher.methods import Settings
from orbiflow.escher.report import report
from orbiflow.escher.result import ClassFailure, TileResult
from orbiflow.export.gallery import RESULT, write_front, write_gallery, written_files
from orbiflow.files import write_atomic
from orbiflow.folders import ResultFolder
from orbiflow.silhouette.target import Target


def write_run(
    results: Sequence[TileResult],
    target: Target,
    out: str | Path,
    settings: Settings | None = None,
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
    settings = BendingSettings.for_effort("normal") if settings is None else settings
    seconds = sum(result.seconds for result in results)
    document = report(target, results, failures, settings, seconds=seconds, workers=1)
    with folder.replaced() as staged:
        fill_run(staged, document, results, target, failures=failures, figures=figures)
    return folder.path


def fill_run(
    folder: Path,
    document: dict[str, Any],
    results: Sequence[TileResult],
    target: Target,
    *,
    found: Sequence[TileResult] = (),
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
