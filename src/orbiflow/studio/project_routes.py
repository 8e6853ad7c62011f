"""What browsers ask of projects: make, change, save, watch, and give work."""

from __future__ import annotations

import json
import secrets
from importlib import import_module
from typing import Any

from starlette.background import BackgroundTask
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, StreamingResponse

from orbiflow.errors import OrbiflowError
from orbiflow.extras import naming_extras
from orbiflow.runtime import is_object
from orbiflow.studio.guard import Refused
from orbiflow.studio.kinds_of_work import kind_of_work
from orbiflow.studio.project_file import ENDING, MOST_VIEW, write_project
from orbiflow.studio.requests import Studio, body_object, save_body
from orbiflow.studio.routes import Routes
from orbiflow.studio.words import NAMES, plain_name, shown_project, shown_summary, shown_task

routes = Routes()


@routes.get("/projects")
async def projects(here: Studio) -> list[dict[str, Any]]:
    """List all projects."""
    return [shown_summary(summary) for summary in here.store.summaries()]


@routes.post("/projects")
async def create(request: Request, here: Studio) -> dict[str, Any]:
    """Make a project."""
    given = await body_object(request)
    kind = given.get("kind", "tile")
    if not isinstance(kind, str) or kind not in NAMES:
        raise OrbiflowError("a project is of kind tile or density")
    if kind == "density":
        with naming_extras("a density"):
            await run_in_threadpool(import_module, "matplotlib")
    name = plain_name(given.get("name"), NAMES[kind])
    made = here.store.create(kind, name, here.limits.projects)
    return shown_project(here.store, here.store.project(made))


@routes.post("/projects/open")
async def open_file(request: Request, here: Studio) -> dict[str, Any]:
    """Make a project of a file, once a task has taken up what is in it; of no other file."""
    made = here.store.create("tile", "Opened project", here.limits.projects)
    try:
        await save_body(request, here.store.home(made) / f"opened{ENDING}")
        task = await here.done(made, "open", {})
        if task["state"] in ("failed", "cancelled"):
            told = task["error"] or "opening was cancelled; open the file again"
            raise OrbiflowError(told.replace(f"opened{ENDING}", "this file"))
    except BaseException:
        here.store.delete(made)
        raise
    return shown_project(here.store, here.store.project(made))


@routes.get("/projects/{project}/file")
def file(project: str, here: Studio) -> FileResponse:
    """Save a project as a file."""
    with here.store.still():
        own, cards = here.store.project(project), here.store.cards(project)
    if own["kind"] != "tile":
        raise OrbiflowError("only projects of tiles are saved as a file; take the model away")
    names = ("name", "kind", "view", "reading", "input")
    tiles = [{name: card[name] for name in ("id", "parent")} for card in cards]
    out = here.store.home(project) / f".{secrets.token_hex(4)}.tmp"
    document = {**{name: own[name] for name in names}, "tiles": tiles}
    write_project(here.store.home(project), document, out)
    return FileResponse(
        out,
        filename=f"{own['name']}{ENDING}",
        media_type="application/zip",
        background=BackgroundTask(out.unlink, missing_ok=True),
    )


@routes.get("/projects/{project}")
async def get(project: str, here: Studio) -> dict[str, Any]:
    """Return all of a project, as it is at one moment."""
    with here.store.still():
        return shown_project(here.store, here.store.project(project))


@routes.patch("/projects/{project}")
async def patch(request: Request, project: str, here: Studio) -> dict[str, Any]:
    """Change a project's name, or parts of what its pages remember."""
    given, own = await body_object(request), here.store.project(project)
    changes: dict[str, Any] = {"changed_by": request.headers.get("x-orbiflow-client", "")[:80]}
    if "name" in given:
        changes["name"] = plain_name(given["name"], own["name"])
    if "view" in given:
        if not is_object(given["view"]):
            raise OrbiflowError("view must be a JSON object")
        changes["view"] = {**own["view"], **given["view"]}
        if len(json.dumps(changes["view"])) > MOST_VIEW:
            raise Refused(413, "this project remembers too much already; undo some drawing")
    here.store.change(project, **changes)
    return shown_project(here.store, here.store.project(project))


@routes.delete("/projects/{project}")
async def delete(project: str, here: Studio) -> dict[str, Any]:
    """Delete a project with all its files."""
    here.store.project(project)
    await run_in_threadpool(here.queue.forget, project)
    here.store.delete(project)
    return {}


@routes.post("/projects/{project}/tasks")
async def task(request: Request, project: str, here: Studio) -> dict[str, Any]:
    """Give a project work."""
    given = await body_object(request)
    operation, settings = given.get("operation"), given.get("settings", {})
    if not isinstance(operation, str) or not is_object(settings):
        raise OrbiflowError("a task has an operation and settings")
    own = here.store.project(project)
    view = own["view"]
    if "drawing" in settings:  # as it is now
        drawn = view.get("drawing", {}) if settings["drawing"] is True else {}
        settings = {**settings, "drawing": json.dumps(drawn)}
    if kind_of_work(operation).makes:
        settings = {**settings, "called": own["name"]}
    return await here.submit(project, operation, settings)


@routes.post("/tasks/{number}/{action}")
async def steer(number: int, action: str, here: Studio) -> dict[str, Any]:
    """Pause, resume or cancel a task."""
    queue = here.queue
    actions = {"pause": queue.pause, "resume": queue.resume, "cancel": queue.cancel}
    if action not in actions:
        raise Refused(404, "a task can be paused, resumed and cancelled")
    await run_in_threadpool(actions[action], number)
    return {"task": shown_task(here.store, here.store.task(number))}


@routes.get("/projects/{project}/events")
async def events(request: Request, project: str, here: Studio, after: int = 0) -> StreamingResponse:
    """Stream what changes in a project, from some event on."""
    here.store.project(project)
    if here.hub.count >= here.limits.streams:
        raise Refused(503, "too many pages watch the studio; close some of them")
    last = request.headers.get("last-event-id", "")
    start = int(last) if last.isdecimal() and len(last) < 18 else after
    return StreamingResponse(
        here.hub.stream(project, start),
        media_type="text/event-stream",
        headers={"cache-control": "no-store"},
    )
