"""What browsers ask of a project's picture: upload, choose, mend, and how it is read."""

from __future__ import annotations

import re
from pathlib import Path, PurePosixPath
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse

from orbiflow.errors import OrbiflowError
from orbiflow.studio.animals import ANIMALS, animal_file
from orbiflow.studio.guard import Refused
from orbiflow.studio.requests import Studio, body_object, save_body
from orbiflow.studio.routes import Routes
from orbiflow.studio.words import MASKS, NAMES, plain_name
from orbiflow.tiles import ReadingSettings

PNG = b"\x89PNG\r\n\x1a\n"
ENDING = re.compile("[.][a-z0-9]{1,7}")

routes = Routes(prefix="/projects/{project}")


@routes.put("/input")
async def upload(request: Request, project: str, here: Studio, name: str = "") -> dict[str, Any]:
    """Take a picture or drawing of any kind, as raw bytes."""
    here.store.project(project)
    called = plain_name(name, "picture")
    ending = PurePosixPath(called).suffix.lower()
    file = here.store.home(project) / f"input{ending if ENDING.fullmatch(ending) else '.bin'}"
    await save_body(request, file)
    return await _new_input(here, project, called, file)


@routes.post("/animal")
async def animal(request: Request, project: str, here: Studio) -> dict[str, Any]:
    """Take one of the bundled animals."""
    name = str((await body_object(request)).get("name"))
    here.store.project(project)
    content = animal_file(name).read_bytes()
    file = here.store.home(project) / "input.png"
    file.write_bytes(content)
    return await _new_input(here, project, f"{ANIMALS[name]}.png", file)


async def _new_input(here: Studio, project: str, name: str, file: Path) -> dict[str, Any]:
    """Forget the picture before, what was painted over it, and the search for its tiles."""
    await run_in_threadpool(here.queue.forget, project, "read", "search")
    home = here.store.home(project)
    for old in [*home.glob("input.*"), *(home / f"{mask}.png" for mask in MASKS)]:
        if old != file:
            old.unlink(missing_ok=True)
    changes: dict[str, Any] = {"input": {"name": name, "type": file.suffix.lstrip(".")}}
    if here.store.project(project)["name"] in NAMES.values():
        changes["name"] = PurePosixPath(name).stem
    here.store.change(project, "silhouette", silhouette=None, reading={}, **changes)
    here.store.change(project)
    return await _read_anew(here, project)


async def _read_anew(here: Studio, project: str) -> dict[str, Any]:
    whole = here.store.project(project)
    if whole["input"] is None:
        raise OrbiflowError("there is no picture yet; choose one first")
    await run_in_threadpool(here.queue.replace_waiting, project, "read")
    return await here.submit(
        project, "read", {"called": whole["input"]["name"], **whole["reading"]}
    )


@routes.put("/reading")
async def reading(request: Request, project: str, here: Studio) -> dict[str, Any]:
    """Read the picture anew, with other settings."""
    given = {k: v for k, v in (await body_object(request)).items() if v is not None}
    here.store.change(project, "silhouette", reading=ReadingSettings(**given).to_json())
    return await _read_anew(here, project)


@routes.put("/{mask}")
async def put_mask(request: Request, project: str, mask: str, here: Studio) -> dict[str, Any]:
    """Take what was painted over the picture."""
    file = _mask_file(here, project, mask)
    fresh = file.with_suffix(".new")
    await save_body(request, fresh)
    with fresh.open("rb") as start:
        if start.read(len(PNG)) != PNG:
            raise OrbiflowError("what is painted must be a PNG")
    fresh.replace(file)
    return await _mask_changed(here, project, mask)


@routes.delete("/{mask}")
async def delete_mask(project: str, mask: str, here: Studio) -> dict[str, Any]:
    """Forget what was painted over the picture."""
    _mask_file(here, project, mask).unlink(missing_ok=True)
    return await _mask_changed(here, project, mask)


def _mask_file(here: Studio, project: str, mask: str) -> Path:
    if mask not in MASKS:
        raise Refused(404, "there is nothing here; go back to the start page")
    here.store.project(project)
    return here.store.home(project) / f"{mask}.png"


async def _mask_changed(here: Studio, project: str, mask: str) -> dict[str, Any]:
    here.store.change(project, "silhouette")
    return await _read_anew(here, project) if mask == "mend" else {}


@routes.get("/{picture}.png")
async def get_picture(project: str, picture: str, here: Studio) -> FileResponse:
    """Return the backdrop, or what was painted over it."""
    here.store.project(project)
    file = here.store.home(project) / f"{picture}.png"
    if picture not in (*MASKS, "backdrop") or not file.exists():
        raise Refused(404, "there is no such picture (any more)")
    return FileResponse(file)
