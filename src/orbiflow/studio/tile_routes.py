"""What browsers ask of tiles and take-aways."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from starlette.requests import Request
from starlette.responses import FileResponse

from orbiflow.errors import OrbiflowError
from orbiflow.studio.closeup_tasks import SPACE
from orbiflow.studio.guard import Refused
from orbiflow.studio.requests import Studio, body_object
from orbiflow.studio.routes import Routes
from orbiflow.studio.takeaways import PREVIEW, export_folder
from orbiflow.studio.tile_files import VIEW, best_stage, tile_number

SANDBOX = {"content-security-policy": "sandbox; default-src 'none'; style-src 'unsafe-inline'"}

routes = Routes()


def stage_of(here: Studio, project: str, tile: int) -> Path:
    """Return the folder of a tile's last stage."""
    here.store.card(project, tile)
    found = best_stage(here.store.home(project), tile)
    if found is None:
        raise Refused(404, "there is no such tile (any more); choose another one")
    return found


@routes.get("/projects/{project}/tiles/{tile}")
async def view(project: str, tile: int, here: Studio) -> FileResponse:
    """Return what the page of a tile shows."""
    return FileResponse(stage_of(here, project, tile) / VIEW, media_type="application/json")


@routes.delete("/projects/{project}/tiles/{tile}")
async def delete(project: str, tile: int, here: Studio) -> dict[str, Any]:
    """Delete a tile."""
    here.store.delete_tile(project, tile)
    shutil.rmtree(here.store.home(project) / "tiles" / str(tile), ignore_errors=True)
    return {}


@routes.get("/projects/{project}/tiles/{tile}/space")
async def space(project: str, tile: int, here: Studio) -> FileResponse:
    """Return the space in which a tile is pulled."""
    file = stage_of(here, project, tile) / SPACE
    if not file.is_file():
        task = await here.done(project, "space", {"tile": tile})
        if task["state"] != "done":
            raise OrbiflowError("the tile cannot be made ready to be pulled; reload the page")
    return FileResponse(file, media_type="application/json")


@routes.post("/projects/{project}/tiles/{tile}/pulled")
async def pulled(request: Request, project: str, tile: int, here: Studio) -> dict[str, Any]:
    """Make a tile of one that was pulled, and return its card."""
    given = await body_object(request)
    stage_of(here, project, tile)
    task = await here.done(project, "pull", {**given, "tile": tile})
    if task["state"] != "done":
        raise OrbiflowError(task["error"] or "the change was cancelled; pull again")
    return here.store.card(project, tile_number(task["id"], 0))


def _made(here: Studio, task: int, name: str) -> Path:
    """Return a file that a task has made."""
    own = here.store.task(task)
    result = own["result"] or {}
    names = [file["name"] for file in result.get("files", ())]
    names += [PREVIEW] * bool(result.get("preview"))
    file = export_folder(here.store.home(own["project"]), task) / name
    if name not in names or not file.is_file():
        raise Refused(404, "there is no such file (any more); make it again")
    return file


@routes.get("/takeaways/{task}/files/{name}")
async def download(task: int, name: str, here: Studio) -> FileResponse:
    """Return a file to keep."""
    return FileResponse(_made(here, task, name), filename=name, headers=SANDBOX)


@routes.get("/takeaways/{task}/preview.png")
async def preview(task: int, here: Studio) -> FileResponse:
    """Return a picture of what a task has made."""
    return FileResponse(_made(here, task, PREVIEW), headers=SANDBOX)
