"""What the studio's workers do for solids: read a mesh, and search for solids that fill space."""

from __future__ import annotations

import json
import re
import shutil
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orbiflow.errors import OrbiflowError
from orbiflow.runtime import (
    NEVER,
    Cancel,
    Note,
    Outcome,
    Progress,
    Sink,
    as_part,
    cores,
    ignore,
    make_folder,
    operation,
    write_atomic,
    write_json,
)
from orbiflow.solids import FillSettings
from orbiflow.studio.brought_files import brought_file
from orbiflow.studio.settings import Job
from orbiflow.studio.taking import export_folder, files_of
from orbiflow.studio.tile_files import (
    CARD,
    SAVED,
    STAGES,
    VIEW,
    announce_tiles,
    put_stage,
    tile_folder,
    tile_number,
    tiles_of,
)
from orbiflow.studio.words import plain_letters

if TYPE_CHECKING:
    from orbiflow.solids import EscherSolid

MESH, FIGURE, BACKDROP = "mesh.json", "figure.json", "backdrop.png"
SOLID, SHEET, THUMB, PAGE = "solid.safetensors", "sheet.png", "thumb.png", "page.html"
PLAIN_WORDS = {
    "(or is cut off|of a kind that is not read): .*": r"\1; export it again",
    "needs ('.*'), which cannot be read.*": r"needs \1 as well; export a .glb, which is one file",
}
"""What errors of the reader say of bytes and folders, and what helps."""


@operation("studio mesh")
def mesh(
    job: Job, called: str = "mesh", *, on_event: Sink = ignore, cancel: Cancel = NEVER
) -> Outcome:
    """Read the mesh of a project, and draw it.

    Args:
        called: What messages call its file.
    """
    from orbiflow.drawing import png_bytes, solid_picture
    from orbiflow.solids import figure_data, read_mesh, usual_size, usual_up

    file = brought_file(job.project, "mesh")
    on_event(Progress(0.1, "reading the mesh"))
    try:
        body, notes, _ = read_mesh(file)
    except OrbiflowError as error:
        text = str(error).replace(str(file), called)
        for pattern, words in PLAIN_WORDS.items():
            text = re.sub(pattern, words, text)
        raise OrbiflowError(text) from error
    cancel.check()
    on_event(Progress(0.7, "drawing it"))
    up = usual_up(file)
    corners = body.corners[..., [0, 2, 1]] * (1, -1, 1) if up == "y" else body.corners
    write_atomic(job.project / BACKDROP, png_bytes(solid_picture([corners], (600, 450))))
    write_json(job.project / FIGURE, figure_data(body))
    low, high = body.points.min(axis=0).tolist(), body.points.max(axis=0).tolist()
    view = {
        "called": called,
        "notes": notes,
        "triangles": len(body.faces),
        "low": low,
        "high": high,
        "usual_size": usual_size(body),
        "up": up,
    }
    write_json(job.project / MESH, view)
    return Outcome({"triangles": len(body.faces)})


@operation("studio fill", keeps_partial=True, starts_processes=True)
def fill(
    job: Job,
    settings: FillSettings = FillSettings(),
    *,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Search for solids that look like a project's mesh and fill space; write each that is found."""
    from orbiflow.solids import fill, read_mesh

    view = mesh_view(job.project)
    if view is None:
        raise OrbiflowError("this mesh was not read; bring another one")
    announce_tiles(job, on_event)
    numbers: dict[int, int] = {}

    def keep(solid: EscherSolid) -> None:
        numbers[id(solid)] = put_solid(job, solid, on_event)

    read = read_mesh(brought_file(job.project, "mesh"))
    solids = fill(
        read.mesh,
        settings.replace(up=settings.up or view["up"], workers=cores()),
        name=Path(view["called"]).stem,
        painting=read.painting,
        on_solid=keep,
        on_event=as_part(on_event),
        cancel=cancel,
    )
    gone = sorted(set(tiles_of(job)) - {numbers[id(solid)] for solid in solids})
    for number in gone:
        shutil.rmtree(job.project / "tiles" / str(number), ignore_errors=True)
    if solids:
        best = tile_folder(job.project, numbers[id(solids[0])])
        write_atomic(job.project / BACKDROP, (best / THUMB).read_bytes())
    else:
        on_event(Note("no solid was found that is one piece and fills space"))
    state = "cancelled" if cancel.cancelled else "done" if solids else "nothing found"
    return Outcome({"solids": len(solids), "gone": gone}, state)


def put_solid(job: Job, solid: EscherSolid, on_event: Sink) -> int:
    """Write a certified solid as a tile of its project, announce it, and return its number.

    One that this task wrote before it was interrupted stays as it is.
    """
    home, stage, mine = job.project, STAGES[-1], tiles_of(job)
    about = {
        "group": solid.group_name,
        "positions": solid.group.order,
        **solid.likeness.as_dict(),
        "size": solid.size.tolist(),
        "certified": solid.certificate.valid,
    }
    for number in mine:
        card = json.loads((home / "tiles" / str(number) / stage / CARD).read_text())
        if about.items() <= card.items():
            return number
    number = max(mine, default=tile_number(job.task, 0) - 1) + 1
    card = {"id": number, "stage": stage, "stars": 0, **about}
    put_stage(home, number, stage, partial(_write_solid, solid, card), on_event)
    return number


def _write_solid(solid: EscherSolid, card: dict[str, Any], stage: Path) -> None:
    """Write a solid, what a list and a page show of it, and what is taken away as it is."""
    from orbiflow.drawing import png_bytes
    from orbiflow.solids import solid_sheet, stack_data, stack_page

    folder, title = make_folder(stage / SAVED), f"{solid.name}, {solid.group_name}"
    sheet = solid_sheet(solid)
    (width, height), words = sheet.size, sheet.width // 40
    # the stack is the square at the right, above its words
    stack = sheet.crop((width - height + words, 0, width, height - words))
    write_atomic(folder / SOLID, solid.to_bytes())
    write_atomic(folder / SHEET, png_bytes(sheet))
    write_atomic(folder / THUMB, png_bytes(stack.resize((450, 450))))
    page = stack_page(solid, title=title)
    write_atomic(folder / PAGE, page.encode())
    write_json(stage / VIEW, stack_data(solid))
    write_json(stage / CARD, card)


@operation("studio film")
def film(
    job: Job, tile: int, called: str = "", *, on_event: Sink = ignore, cancel: Cancel = NEVER
) -> Outcome:
    """Write a film, a GIF, in which a stack turns, opens and closes.

    Args:
        tile: The number of the solid.
        called: The name of the project, with which that of the file begins.
    """
    from orbiflow.solids import read_solid, solid_gif

    def report(share: float) -> None:
        cancel.check()
        on_event(Progress(share, "drawing the film"))

    folder, solid = export_folder(job.project, job.task), read_solid(tile_folder(job.project, tile))
    report(0.0)
    content = solid_gif(solid, progress=report)
    write_atomic(make_folder(folder) / f"{plain_letters(called, 'solid')}-stack.gif", content)
    made = {"takeaway": job.task, "files": files_of(folder), "made": time.time()}
    return Outcome({**made, "preview": False})


def mesh_view(home: Path) -> dict[str, Any] | None:
    """Return what a page shows of a project's mesh, None before it is read."""
    return json.loads((home / MESH).read_text()) if (home / MESH).is_file() else None
