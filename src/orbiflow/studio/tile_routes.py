"""What browsers ask of tiles and take-aways."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import FileResponse, JSONResponse

from orbiflow.errors import OrbiflowError
from orbiflow.studio.guard import Refused
from orbiflow.studio.hub import Hub
from orbiflow.studio.project_routes import body_object
from orbiflow.studio.store import Store
from orbiflow.studio.takeaways import PREVIEW
from orbiflow.studio.tile_files import VIEW, best_stage, tile_number
from orbiflow.studio.work_queue import WorkQueue

SANDBOX = {"content-security-policy": "sandbox; default-src 'none'; style-src 'unsafe-inline'"}


def tile_routes(store: Store, queue: WorkQueue, hub: Hub) -> APIRouter:
    """Return the routes of tiles and take-aways."""
    routes = APIRouter()

    def stage(project: str, tile: int) -> Path:
        store.card(project, tile)
        found = best_stage(store.home(project), tile)
        if found is None:
            raise Refused(404, "there is no such tile (any more); choose another one")
        return found

    @routes.get("/projects/{project}/tiles/{tile}")
    async def view(project: str, tile: int) -> FileResponse:
        return FileResponse(stage(project, tile) / VIEW, media_type="application/json")

    @routes.delete("/projects/{project}/tiles/{tile}")
    async def delete(project: str, tile: int) -> dict[str, Any]:
        store.delete_tile(project, tile)
        shutil.rmtree(store.home(project) / "tiles" / str(tile), ignore_errors=True)
        return {}

    @routes.post("/projects/{project}/tiles/{tile}/pulled")
    async def pulled(request: Request, project: str, tile: int) -> JSONResponse:
        given = await body_object(request)
        stage(project, tile)
        task = queue.submit(project, "pull", {**given, "tile": tile})
        changes = hub.changes(project)
        async for _ in changes:
            found = store.task(task)
            if found["state"] in ("done", "failed", "cancelled"):
                break
        await changes.aclose()  # pyright: ignore[reportAttributeAccessIssue]
        found = store.task(task)
        if found["state"] != "done":
            raise OrbiflowError(found["error"] or "the change was cancelled; pull again")
        return JSONResponse(store.card(project, tile_number(task, 0)))

    def made(task: int, name: str) -> tuple[Path, dict[str, Any]]:
        own = store.task(task)
        result = own["result"] or {}
        names = [file["name"] for file in result.get("files", ())]
        file = store.home(own["project"]) / "exports" / str(task) / name
        if (
            name not in ([*names, PREVIEW] if result.get("preview") else names)
            or not file.is_file()
        ):
            raise Refused(404, "there is no such file (any more); make it again")
        return file, result

    @routes.get("/takeaways/{task}/files/{name}")
    async def download(task: int, name: str) -> FileResponse:
        file, _ = made(task, name)
        return FileResponse(file, filename=name, headers=SANDBOX)

    @routes.get("/takeaways/{task}/preview.png")
    async def preview(task: int) -> FileResponse:
        file, _ = made(task, PREVIEW)
        return FileResponse(file, headers=SANDBOX)

    return routes
