"""What browsers ask of projects: make, change, upload, watch, and give work."""

from __future__ import annotations

import json
import re
import secrets
from collections.abc import AsyncIterator
from pathlib import Path, PurePosixPath
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import FileResponse, StreamingResponse
from starlette.background import BackgroundTask

from orbiflow.errors import OrbiflowError
from orbiflow.runtime import is_object
from orbiflow.studio.animals import ANIMALS, animal_file
from orbiflow.studio.guard import Refused
from orbiflow.studio.hub import Hub
from orbiflow.studio.project_file import ENDING, write_project
from orbiflow.studio.settings import Limits
from orbiflow.studio.store import Store
from orbiflow.studio.words import MASKS, plain_name, shown_project, shown_summary, shown_task
from orbiflow.studio.work_queue import WorkQueue
from orbiflow.tiles import ReadingSettings

PNG = b"\x89PNG\r\n\x1a\n"
MOST_VIEW = 200_000  # characters of what pages remember of a project
NAMES = {"tile": "New tile", "density": "New density"}


async def body_object(request: Request) -> dict[str, Any]:
    """Return the JSON object that a request brings."""
    try:
        found = json.loads(await request.body() or b"{}")
    except (ValueError, RecursionError):
        raise Refused(400, "the request is no JSON; reload the page") from None
    if not is_object(found):
        raise Refused(400, "the request is no JSON object; reload the page")
    return found


async def save_body(request: Request, file: Path) -> None:
    """Write a request's body to a file, whole or not at all."""
    part = file.with_name(f".{file.name}.{secrets.token_hex(4)}.tmp")
    try:
        with part.open("xb") as out:
            async for chunk in request.stream():
                out.write(chunk)
        if not part.stat().st_size:
            raise Refused(422, "the file is empty; choose another one")
        part.replace(file)
    finally:
        part.unlink(missing_ok=True)


def project_routes(store: Store, queue: WorkQueue, hub: Hub, limits: Limits) -> APIRouter:
    """Return the routes under /api/projects."""
    routes = APIRouter()

    def start_reading(project: str) -> dict[str, Any]:
        whole = store.project(project)
        queue.replace_waiting(project, "read")
        settings = {"called": whole["input"]["name"], **whole["reading"]}
        task = queue.submit(project, "read", settings, most=limits.waiting)
        return {"task": shown_task(store, store.task(task))}

    def new_input(project: str, name: str, file: Path) -> dict[str, Any]:
        home = store.home(project)
        for old in home.glob("input.*"):
            if old != file:
                old.unlink()
        for mask in MASKS:
            (home / f"{mask}.png").unlink(missing_ok=True)
        kind = file.suffix.lstrip(".")
        changes: dict[str, Any] = {"input": {"name": name, "type": kind}, "reading": {}}
        if store.project(project)["name"] in NAMES.values():
            changes["name"] = name.rsplit(".", 1)[0]
        store.change(project, "silhouette", silhouette=None, **changes)
        store.change(project)
        return start_reading(project)

    @routes.get("/projects")
    async def projects() -> list[dict[str, Any]]:
        return [shown_summary(summary) for summary in store.summaries()]

    @routes.post("/projects")
    async def create(request: Request) -> dict[str, Any]:
        given = await body_object(request)
        kind = given.get("kind", "tile")
        if kind not in NAMES:
            raise OrbiflowError("a project is of kind tile or density")
        name = plain_name(given.get("name"), NAMES[kind])
        made = store.create(kind, name, limits.projects)
        return shown_project(store, store.project(made))

    @routes.post("/projects/open")
    async def open_file(request: Request) -> dict[str, Any]:
        made = store.create("tile", "Opened project", limits.projects)
        try:
            await save_body(request, store.home(made) / f"opened{ENDING}")
            queue.submit(made, "open", {}, most=limits.waiting)
        except BaseException:
            store.delete(made)
            raise
        return shown_project(store, store.project(made))

    @routes.get("/projects/{project}/file")
    def file(project: str) -> FileResponse:
        with store.still():
            own = store.project(project)
            cards = store.cards(project)
        names = ("name", "kind", "view", "reading", "input")
        tiles = [{name: card[name] for name in ("id", "parent")} for card in cards]
        home = store.home(project)
        out = home / f".{secrets.token_hex(4)}.tmp"
        write_project(home, {**{name: own[name] for name in names}, "tiles": tiles}, out)
        return FileResponse(
            out,
            filename=f"{own['name']}{ENDING}",
            media_type="application/zip",
            background=BackgroundTask(out.unlink, missing_ok=True),
        )

    @routes.get("/projects/{project}")
    async def get(project: str) -> dict[str, Any]:
        with store.still():
            return shown_project(store, store.project(project))

    @routes.patch("/projects/{project}")
    async def patch(request: Request, project: str) -> dict[str, Any]:
        given, own = await body_object(request), store.project(project)
        changes: dict[str, Any] = {"changed_by": request.headers.get("x-orbiflow-client", "")[:80]}
        if "name" in given:
            changes["name"] = plain_name(given["name"], own["name"])
        if "view" in given:
            if not is_object(given["view"]):
                raise OrbiflowError("view must be a JSON object")
            changes["view"] = {**own["view"], **given["view"]}
            if len(json.dumps(changes["view"])) > MOST_VIEW:
                raise Refused(413, "this project remembers too much already; undo some drawing")
        store.change(project, **changes)
        return shown_project(store, store.project(project))

    @routes.delete("/projects/{project}")
    async def delete(project: str) -> dict[str, Any]:
        store.project(project)
        queue.forget(project)
        store.delete(project)
        return {}

    @routes.put("/projects/{project}/input")
    async def upload(request: Request, project: str, name: str = "") -> dict[str, Any]:
        store.project(project)
        called = plain_name(name, "picture")
        ending = PurePosixPath(called).suffix.lower()
        known = re.fullmatch("[.][a-z0-9]{1,7}", ending)
        file = store.home(project) / f"input{ending if known else '.bin'}"
        await save_body(request, file)
        return new_input(project, called, file)

    @routes.post("/projects/{project}/animal")
    async def animal(request: Request, project: str) -> dict[str, Any]:
        name = str((await body_object(request)).get("name"))
        store.project(project)
        source = animal_file(name)
        file = store.home(project) / "input.png"
        file.write_bytes(source.read_bytes())
        return new_input(project, f"{ANIMALS[name]}.png", file)

    @routes.put("/projects/{project}/reading")
    async def reading(request: Request, project: str) -> dict[str, Any]:
        given = {k: v for k, v in (await body_object(request)).items() if v is not None}
        settings = ReadingSettings(**given)
        if store.project(project)["input"] is None:
            raise OrbiflowError("there is no picture yet; choose one first")
        store.change(project, "silhouette", reading=settings.to_json())
        return start_reading(project)

    @routes.put("/projects/{project}/{mask}")
    async def put_mask(request: Request, project: str, mask: str) -> dict[str, Any]:
        file = mask_file(project, mask)
        await save_body(request, file.with_suffix(".new"))
        with file.with_suffix(".new").open("rb") as start:
            if start.read(len(PNG)) != PNG:
                raise OrbiflowError("what is painted must be a PNG")
        file.with_suffix(".new").replace(file)
        return mask_changed(project, mask)

    @routes.delete("/projects/{project}/{mask}")
    async def delete_mask(project: str, mask: str) -> dict[str, Any]:
        mask_file(project, mask).unlink(missing_ok=True)
        return mask_changed(project, mask)

    def mask_file(project: str, mask: str) -> Path:
        if mask not in MASKS:
            raise Refused(404, "there is nothing here; go back to the start page")
        store.project(project)
        return store.home(project) / f"{mask}.png"

    def mask_changed(project: str, mask: str) -> dict[str, Any]:
        store.change(project, "silhouette")
        return start_reading(project) if mask == "mend" else {}

    @routes.get("/projects/{project}/{picture}.png")
    async def picture(project: str, picture: str) -> FileResponse:
        store.project(project)
        file = store.home(project) / f"{picture}.png"
        if picture not in (*MASKS, "backdrop") or not file.exists():
            raise Refused(404, "there is no such picture (any more)")
        return FileResponse(file)

    @routes.post("/projects/{project}/tasks")
    async def task(request: Request, project: str) -> dict[str, Any]:
        given = await body_object(request)
        operation, settings = given.get("operation"), given.get("settings", {})
        if not isinstance(operation, str) or not is_object(settings):
            raise OrbiflowError("a task has an operation and settings")
        view = store.project(project)["view"]
        if "drawing" in settings:  # as it is now
            drawn = view.get("drawing", {}) if settings["drawing"] is True else {}
            settings = {**settings, "drawing": json.dumps(drawn)}
        number = queue.submit(project, operation, settings, most=limits.waiting)
        return {"task": shown_task(store, store.task(number))}

    @routes.post("/tasks/{task}/{action}")
    async def steer(task: int, action: str) -> dict[str, Any]:
        actions = {"pause": queue.pause, "resume": queue.resume, "cancel": queue.cancel}
        if action not in actions:
            raise Refused(404, "a task can be paused, resumed and cancelled")
        actions[action](task)
        return {"task": shown_task(store, store.task(task))}

    @routes.get("/projects/{project}/events")
    async def events(request: Request, project: str, after: int = 0) -> StreamingResponse:
        store.project(project)
        if hub.count >= limits.streams:
            raise Refused(503, "too many pages watch the studio; close some of them")
        last = request.headers.get("last-event-id", "")
        start = int(last) if last.isdecimal() and len(last) < 18 else after
        stream: AsyncIterator[bytes] = hub.stream(project, start)
        return StreamingResponse(
            stream, media_type="text/event-stream", headers={"cache-control": "no-store"}
        )

    return routes
