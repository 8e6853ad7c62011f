"""Writing a tile in real size: the job of an `ExportRequest`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from orbiflow.jobs.asked import given, read_as
from orbiflow.jobs.place import check_place
from orbiflow.jobs.run import Sink
from orbiflow.jobs.tile_requests import ExportRequest
from orbiflow.runtime import (
    Cancel,
    Finished,
    Note,
    Progress,
    RecordError,
    Written,
    write_atomic,
)
from orbiflow.tiles import (
    FORMATS,
    Exported,
    ExportSettings,
    read_result,
    scenes,
    sheet_names,
    write_scene,
)
from orbiflow.units import length, page_size, size

LENGTHS = ("tile_size", "tolerance", "warn_neck")
LENGTHS_OR_ZERO = ("kerf", "clearance", "spacing")


def export(request: ExportRequest, tell: Sink, cancel: Cancel) -> Finished:
    """Write the file, or one a sheet.

    Returns:
        `summary`: the `files`, how many `tiles` are on them, the `class`, `tile_size` in mm.

    Raises:
        OrbiflowError: for anything that the user can mend.
        Cancelled: if it was told to stop; nothing is written.
    """
    settings = _settings(request)
    tile = read_result(request.result, request.tile)
    out = request.out or Path(f"{tile.name}.{settings.format}")
    check_place(out, request.result)
    tell(Progress(0.0, "laying out"))
    found, notes = scenes(tile, settings, force=request.force)
    contents: list[str | bytes] = []
    for k, scene in enumerate(found):
        cancel.check()
        tell(Progress((1 + k) / (1 + len(found)), "writing"))
        contents.append(write_scene(scene, settings))
    cancel.check()
    files = [
        write_atomic(name, content)
        for name, content in zip(sheet_names(out, len(found)), contents, strict=True)
    ]
    for note in notes:
        tell(Note(note))
    done = Exported(tuple(files), tuple(found), notes)
    tell(Note(_said(done, settings, tile.tile.isohedral_class)))
    for path in files:
        tell(Written(path))
    summary = {
        "files": [str(path) for path in files],
        "tiles": done.tiles,
        "class": tile.tile.isohedral_class,
        "tile_size": settings.tile_size,
    }
    return Finished("done", summary)


def _said(done: Exported, settings: ExportSettings, name: str) -> str:
    width, height = settings.page
    what = {"none": "tiles", "skeleton": "tiles in outline", "pieces": "pieces"}[settings.cut]
    files = str(done.files[0])
    if len(done.files) > 1:
        files = f"{len(done.files)} sheets, {done.files[0]} to {done.files[-1].name}"
    return (
        f"written {files}: {done.tiles} {what} of {name}, {settings.tile_size:g} mm, on "
        f"{width:g} x {height:g} mm"
    )


def _settings(request: ExportRequest) -> ExportSettings:
    asked = given(request, ("format", "cut", "copies", "clip", "palette", "dpi"))
    asked |= {"border": request.border, "calibrate": request.calibrate}
    asked |= _lengths(request)
    ending = request.out.suffix.lower().lstrip(".") if request.out else ""
    if "format" not in asked and ending in FORMATS:
        asked["format"] = ending
    elif "format" not in asked and ending:
        raise RecordError(
            f"{{out}} ends in .{ending}; say {{format}}, or end it in .{', .'.join(FORMATS)}"
        )
    elif ending in FORMATS and asked["format"] != ending:
        raise RecordError(
            f"{{out}} ends in .{ending} but {{format}} is {asked['format']}; make them the same"
        )
    if request.purpose is None:
        settings = ExportSettings(**asked)
    else:
        settings = ExportSettings.preset(request.purpose, **asked)
    _refuse_unused(request, settings)
    return settings


def _refuse_unused(request: ExportRequest, settings: ExportSettings) -> None:
    """Raises a `RecordError` for what was asked for and would change nothing."""
    if request.dpi is not None and settings.format != "png":
        raise RecordError(f"{{dpi}} belongs to {{format}} png, not to {settings.format}")
    if request.palette is not None and settings.cut != "none":
        raise RecordError(
            f"{{palette}} is of fills: it belongs to {{cut}} none, not {settings.cut}"
        )
    if request.palette is not None and not settings.filled:
        raise RecordError(f"{{palette}} is of fills, and {{purpose}} {request.purpose} has none")


def _lengths(request: ExportRequest) -> dict[str, Any]:
    readers: dict[str, Callable[[str], Any]] = dict.fromkeys(LENGTHS, length)
    readers |= dict.fromkeys(LENGTHS_OR_ZERO, partial(length, zero=True))
    readers |= {"area": page_size, "bed": size}
    asked = given(request, readers)
    return {name: read_as(name, readers[name], text) for name, text in asked.items()}
