"""What browsers ask of solids that fill space: upload a mesh, and what is shown of it.

Searches and take-aways are tasks like any others: "fill", "build" and "film". A solid is a tile of
its project.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, Response

from orbiflow.studio.guard import Refused
from orbiflow.studio.project_routes import SANDBOX, stage_of
from orbiflow.studio.routes import Routes, Studio, save_body, turned_script
from orbiflow.studio.solid_tasks import (
    ENDINGS,
    FIGURE,
    MESH,
    PAGE,
    SHEET,
    THUMB,
    ending_of,
    mesh_view,
)
from orbiflow.studio.tile_files import SAVED
from orbiflow.studio.words import NAMES, plain_letters, plain_name

SCRIPT = Path(__file__).parents[1] / "solids" / "stack.js"
FILES = (SHEET, THUMB, PAGE)
"""Files of a solid that are served as they are."""

routes = Routes()


@routes("GET", "/solids/stack.js")
def script() -> Response:
    """Serve the script that turns stacks, here and in the page that a search writes."""
    return turned_script(SCRIPT)


@routes("GET", "/projects/{project}/mesh")
def mesh(project: str, here: Studio) -> dict[str, Any]:
    """Tell of a project's mesh."""
    return {"mesh": mesh_view(_home(here, project))}


@routes("PUT", "/projects/{project}/mesh")
async def upload(request: Request, project: str, here: Studio, name: str = "") -> dict[str, Any]:
    """Take a mesh, and forget an earlier one."""
    called = plain_name(name, "mesh.stl")
    home = _home(here, project)
    file = home / f"mesh{ending_of(called)}"
    await save_body(request, file)
    await run_in_threadpool(here.queue.forget, project, "mesh read", "fill")
    for old in (home / MESH, home / FIGURE, *(home / f"mesh{ending}" for ending in ENDINGS)):
        if old != file:
            old.unlink(missing_ok=True)
    changes: dict[str, Any] = {"input": {"name": called, "type": file.suffix.lstrip(".")}}
    if here.store.project(project)["name"] == NAMES["solid"]:
        changes["name"] = Path(called).stem
    here.store.change(project, **changes)
    return await here.submit(project, "mesh read", {"called": called})


@routes("GET", "/projects/{project}/mesh/figure")
async def figure(project: str, here: Studio) -> FileResponse:
    """Give what the script draws of the mesh."""
    file = _home(here, project) / FIGURE
    if not file.is_file():
        raise Refused(404, "this mesh was not read; bring another one")
    return FileResponse(file, media_type="application/json")


@routes("GET", "/projects/{project}/tiles/{tile}/files/{name}")
async def file(project: str, tile: int, name: str, here: Studio) -> FileResponse:
    """Give a file of a solid to keep: its sheet, or its page."""
    _home(here, project)
    path = stage_of(here, project, tile) / SAVED / name
    if name not in FILES:
        raise Refused(404, f"there is no such file; there are {', '.join(FILES)}")
    called = plain_letters(here.store.project(project)["name"], "solid")
    return FileResponse(path, filename=f"{called}-{name}", headers=SANDBOX)


def _home(here: Studio, project: str) -> Path:
    if here.store.project(project)["kind"] != "solid":
        raise Refused(404, "this project has no mesh; start one with a mesh")
    return here.store.home(project)
