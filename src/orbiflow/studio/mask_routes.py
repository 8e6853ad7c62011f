"""What browsers ask of what is painted over a picture: what mends it, keeps its shape, matters most."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request

from orbiflow.errors import OrbiflowError
from orbiflow.studio.guard import Refused
from orbiflow.studio.project_routes import end_of, read_anew
from orbiflow.studio.routes import Routes, Studio, save_body
from orbiflow.studio.store import Missing
from orbiflow.studio.words import MASKS, own_names, shown_project

PNG = b"\x89PNG\r\n\x1a\n"

routes = Routes()


@routes("PUT", "/projects/{project}/{mask}")
async def put_mask(
    request: Request, project: str, mask: str, here: Studio, number: int = 0
) -> dict[str, Any]:
    """Take what was painted over a picture."""
    file = _mask_file(here, project, mask, number)
    fresh = file.with_suffix(".new")
    await save_body(request, fresh)
    with fresh.open("rb") as start:
        if start.read(len(PNG)) != PNG:
            raise OrbiflowError("what is painted must be a PNG")
    fresh.replace(file)
    return await _mask_changed(here, project, mask, number)


@routes("DELETE", "/projects/{project}/{mask}")
async def delete_mask(project: str, mask: str, here: Studio, number: int = 0) -> dict[str, Any]:
    """Forget what was painted over a picture."""
    _mask_file(here, project, mask, number).unlink(missing_ok=True)
    return await _mask_changed(here, project, mask, number)


def _mask_file(here: Studio, project: str, mask: str, number: int) -> Path:
    if mask not in MASKS:
        raise Refused(404, "there is nothing here; go back to the start page")
    end = end_of(here, project, number)
    if number and here.store.project(project)["second"] is None:
        raise Missing("there is no second picture (any more); add one first")
    return here.store.home(project) / f"{mask}{end}.png"


async def _mask_changed(here: Studio, project: str, mask: str, number: int) -> dict[str, Any]:
    """Return the address of what is painted now, by which a page knows it from what others paint.

    `refused` says why a search would not take it, if so.
    """
    from orbiflow.studio.silhouette_file import why_not_painted

    here.store.change(project, "silhouette")
    shown = shown_project(here.store, here.store.project(project), "silhouette")
    address = (shown["second"] if number else shown)[mask]
    if mask == "mend":
        return {"mask": address, **await read_anew(here, project, number)}
    why = await run_in_threadpool(why_not_painted, here.store.home(project), mask, number)
    return {"mask": address, "refused": own_names(why, here.store.project(project))}
