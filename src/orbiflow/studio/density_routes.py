"""What browsers ask of densities: upload a table, and what a fit shows.

Fits and take-aways are tasks like any others: "density fit", "density map" and "density take".
"""

from __future__ import annotations

import json
import shutil
from contextlib import suppress
from pathlib import Path
from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from orbiflow.errors import OrbiflowError
from orbiflow.studio.brought_files import place_of
from orbiflow.studio.density_tasks import FIT, SURFACE, TABLE, VIEW, fit_folder, map_file
from orbiflow.studio.guard import Refused
from orbiflow.studio.routes import JsonObject, Routes, Studio, save_body, taken_up, whole
from orbiflow.studio.words import plain_name

EXAMPLES = {
    "backbone": ("Bends of a protein chain", "Two angles at each link, phi and psi: a doughnut."),
    "sidechain": ("Bends with a side arm", "Three angles: choose which two you see."),
    "poles": ("Old magnetic poles", "The Earth's magnet flips, so both ends count as one."),
    "patches": ("Tiny bits of photographs", "How edges lie in 3 by 3 dots: a Klein bottle."),
}
"""Tables that anybody may try: a title, and what they are."""

TABLES = Path(__file__).parent / "tables"
MAX_AXES = 64
TASKS = ("density table", "density fit", "density map", "density take")

routes = Routes()


@routes("GET", "/projects/{project}/density")
async def density(project: str, here: Studio) -> dict[str, Any]:
    """Tell of a project's table, of what is fitted to it, and of tables to try."""
    home, table, fit = _home(here, project), None, None
    if (home / TABLE).is_file():
        table = json.loads((home / TABLE).read_text())
    with suppress(OrbiflowError):
        folder = fit_folder(home)
        view = json.loads((folder / VIEW).read_text())
        fit = {"number": int(folder.name), **view, **_report(folder)}
    titles = [{"name": name, "title": t, "about": about} for name, (t, about) in EXAMPLES.items()]
    return {"table": table, "fit": fit, "examples": titles}


@routes("PUT", "/projects/{project}/density/table")
async def upload(request: Request, project: str, here: Studio, name: str = "") -> dict[str, Any]:
    """Take a table."""
    called = plain_name(name, "table.csv")
    file = place_of(_home(here, project), "table", called)
    await save_body(request, file)
    return await _new_table(here, project, file, called)


@routes("POST", "/projects/{project}/density/example")
async def example(body: JsonObject, project: str, here: Studio) -> dict[str, Any]:
    """Take a table of ours."""
    name = body.get("name")
    if not isinstance(name, str) or name not in EXAMPLES:
        raise OrbiflowError(f"there is no such example; there are {', '.join(EXAMPLES)}")
    file = _home(here, project) / "table.csv"
    shutil.copyfile(TABLES / f"{name}.csv", file)
    return await _new_table(here, project, file, f"{EXAMPLES[name][0]}.csv")


@routes("GET", "/projects/{project}/density/{fit}/surface")
async def surface(project: str, fit: int, here: Studio) -> Response:
    """Give what the script draws."""
    return _document(fit_folder(_home(here, project), fit) / SURFACE)


@routes("GET", "/projects/{project}/density/{fit}/map")
async def flat(project: str, fit: int, here: Studio, axes: str = "0") -> Response:
    """Give the density on a grid, of one angle or of two."""
    chosen = axes.split("-")
    if len(chosen) > 2 or not all(a.isdecimal() and int(a) < MAX_AXES for a in chosen):
        raise Refused(404, "a map is of one or two angles, such as 0-1")
    return _document(map_file(fit_folder(_home(here, project), fit), tuple(map(int, chosen))))


def _home(here: Studio, project: str) -> Path:
    if here.store.project(project)["kind"] != "density":
        raise Refused(404, "this project is no density; start one with a table")
    return here.store.home(project)


async def _new_table(here: Studio, project: str, file: Path, name: str) -> dict[str, Any]:
    """Forget what was made of an earlier table, and look at this one."""
    await taken_up(here, project, file, name, [TABLE], TASKS)
    shutil.rmtree(file.with_name("fits"), ignore_errors=True)
    return await here.submit(project, "density table", {})


def _document(file: Path) -> Response:
    """Return a file of JSON, or null if nobody has drawn it yet."""
    return whole(file) if file.is_file() else JSONResponse(None)


def _report(fit: Path) -> dict[str, Any]:
    """Return what a page says of a fit: its mean log density, over which rows, and how it was made."""
    document = json.loads((fit / FIT / "report.json").read_text())
    names = ("weights", "components", "notes", "validation", "start_nll", "validation_nll")
    said = {name: document["report"][name] for name in names}
    return {"likelihood": document["log_likelihood"], **said}
