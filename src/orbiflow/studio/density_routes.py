"""What browsers ask of densities: upload a table, and what a fit shows.

Fits and take-aways are tasks like any others: "density fit", "density map" and "density take".
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import FileResponse, JSONResponse, Response

from orbiflow.errors import OrbiflowError
from orbiflow.studio.density_table import ENDINGS, ending_of
from orbiflow.studio.density_tasks import FIT, SURFACE, TABLE, VIEW, fit_folder, map_file
from orbiflow.studio.guard import Refused
from orbiflow.studio.requests import body_object, save_body
from orbiflow.studio.store import Store
from orbiflow.studio.words import NAMES, plain_name, shown_task
from orbiflow.studio.work_queue import WorkQueue

EXAMPLES = {
    "backbone": ("Bends of a protein chain", "Two angles at each link, phi and psi: a doughnut."),
    "sidechain": ("Bends with a side arm", "Three angles: choose which two you see."),
    "poles": ("Old magnetic poles", "The Earth's magnet flips, so both ends count as one."),
    "patches": ("Tiny bits of photographs", "How edges lie in 3 by 3 dots: a Klein bottle."),
}
"""Tables that anybody may try: a title, and what they are."""

TABLES = Path(__file__).parent / "tables"
SCRIPT = Path(__file__).parents[1] / "density" / "pictures" / "surface.js"
MOST_AXES = 64


def density_routes(store: Store, queue: WorkQueue) -> APIRouter:
    """Return the routes of densities."""
    routes = APIRouter()

    def home(project: str) -> Path:
        if store.project(project)["kind"] != "density":
            raise Refused(404, "this project is no density; start one with a table")
        return store.home(project)

    def new_table(project: str, file: Path, name: str) -> dict[str, Any]:
        for operation in ("density table", "density fit", "density map", "density take"):
            queue.replace_waiting(project, operation)
        for old in (home(project) / f"table{ending}" for ending in ENDINGS):
            if old != file:
                old.unlink(missing_ok=True)
        (home(project) / TABLE).unlink(missing_ok=True)
        shutil.rmtree(home(project) / "fits", ignore_errors=True)
        own = store.project(project)
        changes: dict[str, Any] = {"input": {"name": name, "type": file.suffix.lstrip(".")}}
        before = Path(own["input"]["name"]).stem if own["input"] else name
        if own["name"] in (NAMES["density"], "My table", before):
            changes["name"] = Path(name).stem
        store.change(project, **changes)
        task = queue.submit(project, "density table", {})
        return {"task": shown_task(store, store.task(task))}

    @routes.get("/density/surface.js")
    async def script() -> FileResponse:
        return FileResponse(SCRIPT, media_type="text/javascript")

    @routes.get("/projects/{project}/density")
    async def state(project: str) -> dict[str, Any]:
        folder, table, fit = home(project), None, None
        if (folder / TABLE).is_file():
            table = json.loads((folder / TABLE).read_text())
        try:
            own = fit_folder(folder)
            view, report = json.loads((own / VIEW).read_text()), _report(own)
            fit = {"number": int(own.name), **view, **report}
        except OrbiflowError:
            pass
        examples = [{"name": name, "title": title, "about": about}
                    for name, (title, about) in EXAMPLES.items()]  # fmt: skip
        return {"table": table, "fit": fit, "examples": examples}

    @routes.put("/projects/{project}/density/table")
    async def upload(request: Request, project: str, name: str = "") -> dict[str, Any]:
        called = plain_name(name, "table.csv")
        file = home(project) / f"table{ending_of(called)}"
        await save_body(request, file)
        return new_table(project, file, called)

    @routes.post("/projects/{project}/density/example")
    async def example(request: Request, project: str) -> dict[str, Any]:
        name = (await body_object(request)).get("name")
        if name not in EXAMPLES:
            raise OrbiflowError(f"there is no such example; there are {', '.join(EXAMPLES)}")
        file = home(project) / "table.csv"
        shutil.copyfile(TABLES / f"{name}.csv", file)
        return new_table(project, file, f"{EXAMPLES[name][0]}.csv")

    @routes.get("/projects/{project}/density/{fit}/surface")
    async def surface(project: str, fit: int) -> Response:
        return _document(fit_folder(home(project), fit) / SURFACE)

    @routes.get("/projects/{project}/density/{fit}/map")
    async def flat(project: str, fit: int, axes: str = "0") -> Response:
        chosen = axes.split("-")
        if len(chosen) > 2 or not all(a.isdecimal() and int(a) < MOST_AXES for a in chosen):
            raise Refused(404, "a map is of one or two angles, such as 0-1")
        return _document(map_file(fit_folder(home(project), fit), tuple(map(int, chosen))))

    return routes


def _document(file: Path) -> Response:
    """Return a file of JSON, or null if nobody has drawn it yet."""
    drawn = file.is_file()
    return FileResponse(file, media_type="application/json") if drawn else JSONResponse(None)


def _report(fit: Path) -> dict[str, Any]:
    """Return what a page says of a fit: its mean log density, over which rows, and its components."""
    document = json.loads((fit / FIT / "report.json").read_text())
    report, likelihood = document["report"], document["log_likelihood"]
    return {
        "likelihood": {
            "mean": likelihood["natural"],
            "rows": likelihood["natural_rows"],
            "uniform": likelihood["uniform"],
        },
        "held_out": {
            "rows": report["validation"],
            "gain": report["start_nll"] - report["validation_nll"],
        },
        "weights": report["weights"],
        "components": report["components"],
        "notes": report["notes"],
        "seconds": document["seconds"],
    }
