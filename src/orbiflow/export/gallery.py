"""All files of an escherization: a folder a class, and an overview."""

from __future__ import annotations

import contextlib
import functools
import io
import json
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from orbiflow.escher.processes import work
from orbiflow.escher.result import TileResult
from orbiflow.export.folder import TILE_FILES, overlay, write_tile_folder
from orbiflow.figures.front import FrontPoint, front_png
from orbiflow.figures.tilings import tiling_png
from orbiflow.files import write_atomic
from orbiflow.silhouette.target import Target

RESULT, OVERVIEW, FRONT = "result.json", "overview.png", "front.png"
_PANEL, _HEADER = 560, 60  # pixels


def write_gallery(
    results: Sequence[TileResult], target: Target, out: Path, *, workers: int = 1
) -> None:
    """Write each class's folder and `overview.png`, in `workers` processes.

    Raises:
        OutputError: if a file cannot be written.
    """
    folders = [out / name for name in folder_names([result.name for result in results])]
    draw = functools.partial(_draw, results, target, folders)
    if workers == 1 or len(results) == 1:
        for k in range(len(results)):
            draw(k)
    else:
        with contextlib.closing(work(draw, range(len(results)), workers)) as news:
            for _ in news:
                pass
    pictures = [
        tuple((folder / name).read_bytes() for name in ("overlay.png", "tiling.png"))
        for folder in folders
    ]
    write_atomic(out / OVERVIEW, overview_png(results, target, pictures))


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
    index: int,
    *_: object,
) -> None:
    """The folder of one result; in a worker process, too."""
    write_tile_folder(results[index], target, folders[index])


def folder_names(classes: Iterable[str]) -> list[str]:
    """Of results of these classes; further tiles of a class are IH4-2, IH4-3 and so on.

    >>> folder_names(["IH4", "IH6", "IH4"])
    ['IH4', 'IH6', 'IH4-2']
    """
    seen: Counter[str] = Counter()
    names = []
    for name in classes:
        seen[name] += 1
        names.append(name if seen[name] == 1 else f"{name}-{seen[name]}")
    return names


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
    inside = {f"{name}/{file}" for name in folder_names(classes) for file in TILE_FILES}
    return {RESULT, OVERVIEW} | front | inside


def _measure(result: TileResult) -> str:
    if result.deformation is None:
        return f"recognised {result.recognisability.score:.2f}"
    return f"bent {result.deformation:.2f}"


def overview_png(
    results: Sequence[TileResult],
    target: Target,
    pictures: Sequence[Sequence[bytes]] | None = None,
) -> bytes:
    """PNG of all tiles, best first: each over its target, and its tiling.

    Args:
        results: of one search.
        target: of the search.
        pictures: overlay and tiling of each result as PNGs, if they are at hand.
    """
    columns = min(3, len(results))
    rows = -(-len(results) // columns)
    sheet = Image.new("RGB", (columns * 2 * _PANEL, rows * (_PANEL + _HEADER)), "white")
    pen = ImageDraw.Draw(sheet)
    font = ImageFont.load_default(size=30)
    for i, result in enumerate(results):
        left, top = (i % columns) * 2 * _PANEL, (i // columns) * (_PANEL + _HEADER)
        proof = "certified" if result.certificate.valid else "NOT CERTIFIED"
        title = (
            f"{result.name}  {result.group_name}    {_measure(result)}    "
            f"IoU {result.metrics.iou:.3f}    {proof}"
        )
        pen.text((left + 24, top + 14), title, fill="#1a1a1a", font=font)
        both = (
            pictures[i]
            if pictures is not None
            else (
                overlay(result, target, width_px=900),
                tiling_png(result.tile, y_down=target.y_down, width_px=900),
            )
        )
        for j, picture in enumerate(both):
            panel = Image.open(io.BytesIO(picture)).convert("RGB")
            panel.thumbnail((_PANEL - 24, _PANEL - 24), Image.Resampling.LANCZOS)
            x = left + j * _PANEL + (_PANEL - panel.width) // 2
            sheet.paste(panel, (x, top + _HEADER + (_PANEL - panel.height) // 2))
    buffer = io.BytesIO()
    sheet.save(buffer, "PNG", compress_level=4)
    return buffer.getvalue()
