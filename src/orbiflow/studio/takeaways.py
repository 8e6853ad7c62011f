"""What a user takes away of a tile: files that operations write, and a small picture of them."""

from __future__ import annotations

import json
import shutil
import time
from contextlib import suppress
from pathlib import Path

from orbiflow.errors import OrbiflowError
from orbiflow.runtime import (
    NEVER,
    Call,
    Cancel,
    Event,
    Note,
    Outcome,
    Progress,
    Sink,
    ignore,
    make_folder,
    operation,
)
from orbiflow.studio.closeup_tasks import with_drawing
from orbiflow.studio.kinds_of_work import DRAWN, file_name, making_call
from orbiflow.studio.tile_files import tile_folder

PREVIEW = "preview.png"
SCRATCH = ".drawn"  # a folder for what is written on the way
SIDE = 1000.0  # pixels of a preview's longer side


@operation("studio take")
def take(
    project: Path,
    task: int,
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
        project: The project's folder.
        task: The number of the task.
        makes: The operation that writes it: export, art, solid or animate.
        tile: The number of the tile.
        settings: Its settings, as JSON.
        picture: Whether the picture that was uploaded goes onto the tile.
        drawing: What was drawn on the tile, as JSON.
        called: The name of the project, with which that of the file begins.
    """
    from orbiflow.studio.silhouette_file import input_file

    folder = make_folder(project / "exports" / str(task))
    files = {"picture": input_file(project)} if picture else {}
    given, result = json.loads(settings), tile_folder(project, tile)
    if drawing and makes in DRAWN:
        result, files, given = with_drawing(drawing, result, files, given, folder / SCRATCH)
    name = file_name(makes, given, result, called)
    call = making_call(makes, given, result, out=folder / name, **files)

    def tell(event: Event) -> None:
        if isinstance(event, Progress | Note):
            on_event(event)

    done = call.operation.function(**call.arguments, on_event=tell, cancel=cancel)
    written = sorted(file for file in folder.iterdir() if file.is_file())
    preview = False
    with suppress(OrbiflowError):  # what was asked for is there
        preview = _preview(call, written[0], folder, cancel)
    facts = {name: value for name, value in done.summary.items() if name not in ("file", "files")}
    return Outcome(
        {
            "takeaway": task,
            "files": [{"name": file.name, "bytes": file.stat().st_size} for file in written],
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
    if call.operation.name != "export":
        return False
    settings = call.arguments["settings"]
    small = settings.replace(format="png", dpi=min(300.0, 25.4 * SIDE / max(settings.page)))
    call.operation.function(
        **{**call.arguments, "settings": small, "out": folder / PREVIEW}, cancel=cancel
    )
    return (folder / PREVIEW).is_file()
