"""What the page of one tile asks for besides the tile itself."""

from __future__ import annotations

from fastapi import APIRouter
from fastapi.responses import FileResponse

from orbiflow.errors import OrbiflowError
from orbiflow.studio.closeup_tasks import SPACE
from orbiflow.studio.guard import Refused
from orbiflow.studio.hub import Hub
from orbiflow.studio.store import Store
from orbiflow.studio.tile_files import best_stage
from orbiflow.studio.work_queue import WorkQueue


def closeup_routes(store: Store, queue: WorkQueue, hub: Hub) -> APIRouter:
    """Return the route of the space in which a tile is pulled."""
    routes = APIRouter()

    @routes.get("/projects/{project}/tiles/{tile}/space")
    async def space(project: str, tile: int) -> FileResponse:
        store.card(project, tile)
        found = best_stage(store.home(project), tile)
        if found is None:
            raise Refused(404, "there is no such tile (any more); choose another one")
        if not (found / SPACE).is_file():
            task = queue.submit(project, "space", {"tile": tile})
            changes = hub.changes(project)
            async for _ in changes:
                if store.task(task)["state"] in ("done", "failed", "cancelled"):
                    break
            await changes.aclose()  # pyright: ignore[reportAttributeAccessIssue]
            if store.task(task)["state"] != "done":
                raise OrbiflowError("the tile cannot be made ready to be pulled; reload the page")
        return FileResponse(found / SPACE, media_type="application/json")

    return routes
