"""What browsers ask of projects, of their pictures and of their tiles."""

from __future__ import annotations

import json
import re
import secrets
import shutil
from collections.abc import Awaitable, Callable
from importlib import import_module
from pathlib import Path, PurePosixPath
from typing import Any

from starlette.background import BackgroundTask
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, Response, StreamingResponse

from orbiflow.errors import OrbiflowError
from orbiflow.runtime import is_object
from orbiflow.settings import naming_extras
from orbiflow.studio.guard import PAGE, SANDBOX, Refused
from orbiflow.studio.kinds_of_work import READS, kind_of_work
from orbiflow.studio.project_file import ENDING, MAX_VIEW, write_project
from orbiflow.studio.routes import JsonObject, Routes, Studio, save_body, whole
from orbiflow.studio.share_link import link_text, write_linked
from orbiflow.studio.store import Missing
from orbiflow.studio.taking import PREVIEW, export_folder
from orbiflow.studio.tasks import SPACE
from orbiflow.studio.tile_files import VIEW, best_stage, tile_folder, tile_number
from orbiflow.studio.words import (
    MASKS,
    NAMES,
    OF_PICTURE,
    is_outdated,
    own_names,
    plain_name,
    shown_project,
    shown_summary,
    shown_task,
)
from orbiflow.tiles import ReadingSettings

NEEDS = {
    "density": ("a density", "matplotlib"),
    "solid": ("a solid", "skimage", "trimesh", "gemmi"),
}
"""Who needs which packages, for a project of a kind."""

routes = Routes()


@routes("GET", "/projects")
async def projects(here: Studio) -> list[dict[str, Any]]:
    """List all projects."""
    return [shown_summary(here.store, summary) for summary in here.store.summaries()]


@routes("POST", "/projects")
async def create(body: JsonObject, here: Studio) -> dict[str, Any]:
    """Make a project."""
    kind = body.get("kind", "tile")
    if not isinstance(kind, str) or kind not in NAMES:
        raise OrbiflowError(f"a project is of kind {', '.join(NAMES)}")
    who, *packages = NEEDS.get(kind, ("",))
    with naming_extras(who):
        for package in packages:
            await run_in_threadpool(import_module, package)
    name = plain_name(body.get("name"), NAMES[kind])
    made = here.store.create(kind, name, here.limits.projects)
    return shown_project(here.store, here.store.project(made))


@routes("POST", "/projects/open")
async def open_file(request: Request, here: Studio) -> dict[str, Any]:
    """Make a project of a file, once a task has taken up what is in it; of no other file."""
    return await _opened(here, lambda out: save_body(request, out))


@routes("POST", "/projects/shared")
async def open_link(body: JsonObject, here: Studio) -> dict[str, Any]:
    """Make a project of the tile that a link carries, as of a file."""
    text = body.get("text")

    async def write(out: Path) -> None:
        write_linked(text if isinstance(text, str) else "", out)

    return await _opened(here, write)


async def _opened(here: Studio, write: Callable[[Path], Awaitable[Any]]) -> dict[str, Any]:
    """Return a new project of what `write` puts into a project's file."""
    made = here.store.create("tile", "Opened project", here.limits.projects)
    try:
        await write(here.store.home(made) / f"opened{ENDING}")
        task = await here.done(made, "open", {})
        if task["state"] in ("failed", "cancelled"):
            reason = task["error"] or "opening was cancelled; open the file again"
            raise OrbiflowError(reason.replace(f"opened{ENDING}", "this file"))
    except BaseException:
        here.store.delete(made)
        raise
    return shown_project(here.store, here.store.project(made))


@routes("GET", "/projects/{project}/tiles/{tile}/link")
def link(project: str, tile: int, here: Studio) -> dict[str, Any]:
    """Return the text by which a link opens a tile in any studio."""
    record = here.store.project(project)
    result = tile_folder(here.store.home(project), tile)
    return {"text": link_text(result, record["name"], (record["view"] or {}).get("look"))}


@routes("GET", "/projects/{project}/file")
def file(project: str, here: Studio) -> FileResponse:
    """Save a project as a file."""
    with here.store.still():
        record, cards = here.store.project(project), here.store.cards(project)
    if record["kind"] != "tile":
        raise OrbiflowError("only projects of tiles are saved as a file; take the model away")
    names = ("name", "kind", "view", "reading", "input", "second")
    tiles = [
        {"id": card["id"], "parent": card["parent"], "outdated": is_outdated(card, record)}
        for card in cards
    ]
    out = here.store.home(project) / f".{secrets.token_hex(4)}.tmp"
    document = {**{name: record[name] for name in names}, "tiles": tiles}
    write_project(here.store.home(project), document, out)
    return FileResponse(
        out,
        filename=f"{record['name']}{ENDING}",
        media_type="application/zip",
        background=BackgroundTask(out.unlink, missing_ok=True),
    )


@routes("GET", "/projects/{project}")
async def get(project: str, here: Studio) -> dict[str, Any]:
    """Return all of a project, as it is at one moment."""
    with here.store.still():
        return shown_project(here.store, here.store.project(project))


@routes("PATCH", "/projects/{project}")
async def patch(request: Request, body: JsonObject, project: str, here: Studio) -> dict[str, Any]:
    """Change a project's name, or parts of what its pages remember."""
    record = here.store.project(project)
    changes: dict[str, Any] = {"changed_by": request.headers.get("x-orbiflow-client", "")[:80]}
    if "name" in body:
        changes["name"] = plain_name(body["name"], record["name"])
    if "view" in body:
        if not is_object(body["view"]):
            raise OrbiflowError("view must be a JSON object")
        changes["view"] = {**record["view"], **body["view"]}
        if len(json.dumps(changes["view"])) > MAX_VIEW:
            raise Refused(413, "this project remembers too much already; undo some drawing")
    here.store.change(project, **changes)
    return shown_project(here.store, here.store.project(project))


@routes("DELETE", "/projects/{project}")
async def delete(project: str, here: Studio) -> dict[str, Any]:
    """Delete a project with all its files."""
    here.store.project(project)
    await run_in_threadpool(here.queue.forget, project)
    here.store.delete(project)
    return {}


@routes("POST", "/projects/{project}/tasks")
async def task(body: JsonObject, project: str, here: Studio) -> dict[str, Any]:
    """Give a project work."""
    operation, settings = body.get("operation"), body.get("settings", {})
    if not isinstance(operation, str) or not is_object(settings):
        raise OrbiflowError("a task has an operation and settings")
    settings = with_what_is_drawn(here, project, settings)
    if operation == "search":
        await run_in_threadpool(check_painted, here, project)
    if kind_of_work(operation).makes or operation == "film":
        settings = {**settings, "called": here.store.project(project)["name"]}
    return await here.submit(project, operation, settings)


@routes("POST", "/tasks/{number}/{action}")
async def steer(number: int, action: str, here: Studio) -> dict[str, Any]:
    """Pause, resume or cancel a task."""
    queue = here.queue
    actions = {"pause": queue.pause, "resume": queue.resume, "cancel": queue.cancel}
    if action not in actions:
        raise Refused(404, "a task can be paused, resumed and cancelled")
    await run_in_threadpool(actions[action], number)
    return {"task": shown_task(here.store, here.store.task(number))}


@routes("GET", "/projects/{project}/events")
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


PLAIN_ENDING = re.compile("[.][a-z0-9]{1,7}")


@routes("PUT", "/projects/{project}/input")
async def upload(
    request: Request, project: str, here: Studio, name: str = "", number: int = 0
) -> dict[str, Any]:
    """Take a picture or drawing of any kind, as raw bytes."""
    end = end_of(here, project, number)
    called = plain_name(name, "picture")
    ending = PurePosixPath(called).suffix.lower()
    ending = ending if PLAIN_ENDING.fullmatch(ending) else ".bin"
    file = here.store.home(project) / f"input{end}{ending}"
    await save_body(request, file)
    return await _new_input(here, project, called, file, number)


@routes("POST", "/projects/{project}/animal")
async def animal(body: JsonObject, project: str, here: Studio, number: int = 0) -> dict[str, Any]:
    """Take one of the bundled animals."""
    name = str(body.get("name"))
    end = end_of(here, project, number)
    picture = animal_file(name)
    file = here.store.home(project) / f"input{end}{picture.suffix}"
    file.write_bytes(picture.read_bytes())
    return await _new_input(here, project, f"{ANIMALS[name]}{picture.suffix}", file, number)


@routes("POST", "/projects/{project}/second")
async def same_again(project: str, here: Studio) -> dict[str, Any]:
    """Take the first picture as the second one, too, with what was painted over it."""
    record, home = here.store.project(project), here.store.home(project)
    if record["input"] is None:
        raise OrbiflowError("there is no picture yet; choose one first")
    copy = home / f"input{OF_PICTURE[1]}.{record['input']['type']}"
    shutil.copyfile(next(home.glob("input.*")), copy)
    name = record["input"]["name"]
    return await _new_input(here, project, name, copy, 1, reading=record["reading"], masks=MASKS)


@routes("DELETE", "/projects/{project}/second")
async def delete_second(project: str, here: Studio) -> dict[str, Any]:
    """Take the second picture away, with what was painted over it, and end the search for both."""
    here.store.project(project)
    await run_in_threadpool(here.queue.forget, project, READS[1], "search")
    for file in here.store.home(project).glob(f"*{OF_PICTURE[1]}.*"):
        file.unlink(missing_ok=True)
    here.store.change(project, "silhouette", second=None)
    return {}


def end_of(here: Studio, project: str, number: int) -> str:
    """Return what the names of the files of a picture end in."""
    here.store.project(project)
    if number not in range(len(OF_PICTURE)):
        raise Refused(404, "a project has two pictures at most")
    return OF_PICTURE[number]


async def _new_input(
    here: Studio,
    project: str,
    name: str,
    file: Path,
    number: int,
    *,
    reading: dict[str, Any] | None = None,
    masks: tuple[str, ...] = (),
) -> dict[str, Any]:
    """Forget the picture before, what was painted over it, and the search for its tiles.

    The new one is read as `reading` says, with what these masks of the first picture say.
    """
    await run_in_threadpool(here.queue.forget, project, READS[number], "search")
    home, end = here.store.home(project), OF_PICTURE[number]
    for old in [*home.glob(f"input{end}.*"), *(home / f"{mask}{end}.png" for mask in MASKS)]:
        if old != file:
            old.unlink(missing_ok=True)
    for mask in masks:
        if (painted := home / f"{mask}.png").exists():
            shutil.copyfile(painted, home / f"{mask}{end}.png")
    changes = {"input": {"name": name, "type": file.suffix.lstrip(".")}, "reading": reading or {}}
    here.store.change(project, "silhouette", number, silhouette=None, **changes)
    if here.store.project(project)["name"] in NAMES.values():
        here.store.change(project, name=PurePosixPath(name).stem)
    here.store.change(project)
    return await read_anew(here, project, number)


async def read_anew(here: Studio, project: str, number: int) -> dict[str, Any]:
    """Read a picture anew, as it and its settings are now."""
    whole = here.store.project(project)
    record = whole["second"] if number else whole
    if record is None or record["input"] is None:
        raise OrbiflowError("there is no picture yet; choose one first")
    await run_in_threadpool(here.queue.forget, project, READS[number], state="waiting")
    called = record["input"]["name"]
    return await here.submit(
        project, READS[number], {"called": called, "number": number, **record["reading"]}
    )


@routes("PUT", "/projects/{project}/reading")
async def reading(body: JsonObject, project: str, here: Studio, number: int = 0) -> dict[str, Any]:
    """Read a picture anew, with other settings."""
    end_of(here, project, number)
    settings = {k: v for k, v in body.items() if v is not None}
    here.store.change(project, "silhouette", number, reading=ReadingSettings(**settings).to_json())
    return await read_anew(here, project, number)


@routes("GET", "/projects/{project}/{picture}.png")
def get_picture(project: str, picture: str, here: Studio) -> Response:
    """Return a backdrop, or what was painted over it."""
    here.store.project(project)
    file = here.store.home(project) / f"{picture}.png"
    pictures = {f"{name}{end}" for end in OF_PICTURE for name in (*MASKS, "backdrop")}
    if picture not in pictures:
        raise Refused(404, "there is no such picture (any more)")
    return whole(file, "image/png")


def stage_of(here: Studio, project: str, tile: int) -> Path:
    """Return the folder of a tile's last stage."""
    here.store.card(project, tile)
    stage = best_stage(here.store.home(project), tile)
    if stage is None:
        raise Refused(404, "there is no such tile (any more); choose another one")
    return stage


@routes("GET", "/projects/{project}/tiles/{tile}")
def view(project: str, tile: int, here: Studio) -> Response:
    """Return what the page of a tile shows."""
    return whole(stage_of(here, project, tile) / VIEW)


@routes("DELETE", "/projects/{project}/tiles/{tile}")
async def delete_tile(project: str, tile: int, here: Studio) -> dict[str, Any]:
    """Delete a tile."""
    here.store.delete_tile(project, tile)
    shutil.rmtree(here.store.home(project) / "tiles" / str(tile), ignore_errors=True)
    return {}


@routes("GET", "/projects/{project}/tiles/{tile}/space")
async def space(project: str, tile: int, here: Studio) -> Response:
    """Return the space in which a tile is pulled."""
    file = stage_of(here, project, tile) / SPACE
    if not file.is_file():
        task = await here.done(project, "space", {"tile": tile})
        if task["state"] != "done":
            raise OrbiflowError("the tile cannot be made ready to be pulled; reload the page")
    return whole(file)


@routes("POST", "/projects/{project}/tiles/{tile}/by-hand/{way}")
async def by_hand(
    body: JsonObject, project: str, tile: int, way: str, here: Studio
) -> dict[str, Any]:
    """Make a tile of one that was pulled, or is laid in another class, and return its card."""
    if way not in ("pull", "class"):
        raise Refused(404, "there is nothing here; go back to the start page")
    stage_of(here, project, tile)
    task = await here.done(project, way, {**body, "tile": tile})
    if task["state"] != "done":
        raise OrbiflowError(task["error"] or "the change was cancelled; pull again")
    return here.store.card(project, tile_number(task["id"], 0))


@routes("POST", "/projects/{project}/tiles/{tile}/preview")
async def live_preview(body: JsonObject, project: str, tile: int, here: Studio) -> dict[str, Any]:
    """Draw what a take-away of a tile would be, in place of one that is still being drawn."""
    operation, settings = str(body.get("operation")), body.get("settings", {})
    if operation not in ("export", "art", "solid", "animate") or not is_object(settings):
        raise OrbiflowError("a preview has an operation that makes something, and settings")
    stage_of(here, project, tile)
    wanted = {**with_what_is_drawn(here, project, settings), "makes": operation, "tile": tile}
    if "side" in body:
        wanted["side"] = body["side"]
    if body.get("instead"):
        await run_in_threadpool(here.queue.forget, project, "preview")
    task = await here.done(project, "preview", wanted)
    here.store.delete_task(task["id"])
    # of one that was ended there may be something left
    shutil.rmtree(export_folder(here.store.home(project), task["id"]), ignore_errors=True)
    if task["state"] != "done":
        raise OrbiflowError(task["error"] or "another preview has taken the place of this one")
    return task["result"]


def check_painted(here: Studio, project: str) -> None:
    """Refuse a search, before it begins, that what is painted over a picture would end."""
    from orbiflow.studio.silhouette_file import why_not_painted

    record = here.store.project(project)
    for number in range(len(OF_PICTURE)):
        for mask in MASKS:
            if why := why_not_painted(here.store.home(project), mask, number):
                raise OrbiflowError(own_names(why, record))


def with_what_is_drawn(here: Studio, project: str, settings: dict[str, Any]) -> dict[str, Any]:
    """Return settings that say whether a drawing is wanted with the drawing as it is now."""
    if "drawing" not in settings:
        return settings
    view = here.store.project(project)["view"]
    drawn = view.get("drawing", {}) if settings["drawing"] is True else {}
    return {**settings, "drawing": json.dumps(drawn)}


def _made(here: Studio, task: int, name: str) -> Path:
    """Return a file that a task has made."""
    record = here.store.task(task)
    result = record["result"] or {}
    names = [file["name"] for file in result.get("files", ())]
    names += [PREVIEW] * bool(result.get("preview"))
    file = export_folder(here.store.home(record["project"]), task) / name
    if name not in names or not file.is_file():
        raise Refused(404, "there is no such file (any more); make it again")
    return file


@routes("GET", "/takeaways/{task}/files/{name}")
async def download(task: int, name: str, here: Studio) -> FileResponse:
    """Return a file to keep; a page also to look at, which may do no more than on a disk."""
    if name.endswith(".html"):
        return FileResponse(_made(here, task, name), headers=PAGE)
    return FileResponse(_made(here, task, name), filename=name, headers=SANDBOX)


@routes("GET", "/takeaways/{task}/preview.png")
def preview(task: int, here: Studio) -> Response:
    """Return a picture of what a task has made."""
    return whole(_made(here, task, PREVIEW), "image/png", **SANDBOX)


FOLDER = Path(__file__).parent / "animals"
ANIMALS = {
    "turtle": "Turtle",
    "gecko": "Gecko",
    "frog": "Frog",
    "barbet": "Bird",
    "monkey": "Night monkey",
    "crocodile": "Crocodile",
    "potoroo": "Rat kangaroo",
    "shark": "Shark",
    "bat": "Bat",
    "paca": "Paca",
}
"""What people call each animal."""


def animal_file(name: str) -> Path:
    """Return the picture of an animal."""
    if name not in ANIMALS:
        raise Missing(f"there is no such animal; there are {', '.join(ANIMALS)}")
    drawing = FOLDER / f"{name}.svg"
    return drawing if drawing.is_file() else drawing.with_suffix(".png")
