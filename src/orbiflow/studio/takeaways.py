"""What a user takes away of a tile: files that operations write, and a small picture of them."""

from __future__ import annotations

import json
import shutil
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from orbiflow.errors import OrbiflowError
from orbiflow.runtime import (
    NEVER,
    Call,
    Cancel,
    Outcome,
    Sink,
    as_part,
    ignore,
    make_folder,
    operation,
)
from orbiflow.studio.closeup_tasks import with_drawing
from orbiflow.studio.kinds_of_work import DRAWN, file_name, making_call
from orbiflow.studio.settings import Job
from orbiflow.studio.tile_files import tile_folder

PREVIEW = "preview.png"
SCRATCH = ".drawn"  # a folder for what is written on the way
MOST_SEEN = 30_000_000  # bytes of a solid that is drawn
SIDE = 1000.0  # pixels of a preview's longer side


def export_folder(home: Path, task: int) -> Path:
    """Return the folder of the files that a task of a project makes to be taken away."""
    return home / "exports" / str(task)


def files_of(folder: Path) -> list[dict[str, Any]]:
    """Return the name and the size in bytes of each file in a folder, by name."""
    files = sorted(file for file in folder.iterdir() if file.is_file())
    return [{"name": file.name, "bytes": file.stat().st_size} for file in files]


@operation("studio take")
def take(
    job: Job,
    makes: str,
    tile: int,
    settings: str = "{}",
    picture: bool = False,
    drawing: str = "",
    called: str = "",
    *,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Write what a user takes away of a tile.

    Args:
        makes: The operation that writes it: export, art, solid or animate.
        tile: The number of the tile.
        settings: Its settings, as JSON.
        picture: Whether the picture that was uploaded goes onto the tile.
        drawing: What was drawn on the tile, as JSON.
        called: The name of the project, with which that of the file begins.
    """
    from orbiflow.studio.silhouette_file import input_file

    folder = make_folder(export_folder(job.project, job.task))
    files = {"picture": input_file(job.project)} if picture else {}
    given, result = json.loads(settings), tile_folder(job.project, tile)
    if drawing and makes in DRAWN:
        result, files, given = with_drawing(drawing, result, files, given, folder / SCRATCH)
    name = file_name(makes, given, result, called)
    call = making_call(makes, given, result, out=folder / name, **files)
    done = call.operation.function(**call.arguments, on_event=as_part(on_event), cancel=cancel)
    written = files_of(folder)
    preview = False
    with suppress(OrbiflowError):  # what was asked for is there
        preview = _preview(call, folder / written[0]["name"], folder, cancel)
    facts = {name: value for name, value in done.summary.items() if name not in ("file", "files")}
    return Outcome(
        {
            "takeaway": job.task,
            "files": written,
            "preview": preview,
            "facts": facts,
            "chosen": json.loads(settings),
            "made": time.time(),
        }
    )


def _preview(call: Call, first: Path, folder: Path, cancel: Cancel) -> bool:
    """Write a picture of a take-away, if that can be had; return whether it was."""
    if first.suffix == ".png":
        shutil.copyfile(first, folder / PREVIEW)
        return True
    if call.operation.name == "solid" and first.stat().st_size < MOST_SEEN:
        from orbiflow.tiles import read_solid, solid_picture

        solid_picture(read_solid(first)).save(folder / PREVIEW)
        return True
    if call.operation.name != "export":
        return False
    settings = call.arguments["settings"]
    small = settings.replace(format="png", dpi=min(300.0, 25.4 * SIDE / max(settings.page)))
    call.operation.function(
        **{**call.arguments, "settings": small, "out": folder / PREVIEW}, cancel=cancel
    )
    return (folder / PREVIEW).is_file()
