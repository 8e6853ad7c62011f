"""What browsers ask of solids that fill space: upload a mesh, and what is shown of it.

Searches and take-aways are tasks like any others: "fill", "build" and "film". A solid is a tile of
its project.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from starlette.requests import Request
from starlette.responses import FileResponse

from orbiflow.studio.brought_files import place_of
from orbiflow.studio.guard import Refused
from orbiflow.studio.project_routes import SANDBOX, stage_of
from orbiflow.studio.routes import Routes, Studio, save_body, taken_up
from orbiflow.studio.solid_tasks import FIGURE, MESH, PAGE, SHEET, THUMB, mesh_view
from orbiflow.studio.tile_files import SAVED
from orbiflow.studio.words import plain_letters, plain_name

FILES = (SHEET, THUMB, PAGE)
"""Files of a solid that are served as they are."""

routes = Routes()


@routes("GET", "/projects/{project}/mesh")
def mesh(project: str, here: Studio) -> dict[str, Any]:
    """Tell of a project's mesh."""
    return {"mesh": mesh_view(_home(here, project))}


@routes("PUT", "/projects/{project}/mesh")
async def upload(request: Request, project: str, here: Studio, name: str = "") -> dict[str, Any]:
    """Take a mesh, and forget an earlier one."""
    called = plain_name(name, "mesh.stl")
    file = place_of(_home(here, project), "mesh", called)
    await save_body(request, file)
    await taken_up(here, project, file, called, [MESH, FIGURE], ["mesh read", "fill"])
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
