"""Take a picture of every state of the studio: `python docs/gallery/studio_states.py FOLDER [STATE]`.

The real command runs on a temporary folder with a turtle that was searched and a density. Each state is
shown on a desk and on a phone, light and dark, and written as FOLDER/STATE-WIDTH-SCHEME.png. What does
not fit there, or what axe finds, is printed. For states that pass quickly and for failures, answers of
the server are changed on their way to the page.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

from playwright.sync_api import Browser, Page, Route, ViewportSize, sync_playwright

from studio_checks import serious_issues, untidy_parts
from studio_film import ANIMAL, running_studio
from studio_pictures import FOOT, HEAD, PATIENCE, paint
from studio_screen import BACK, in_window, outline_in_window

SIZES: tuple[ViewportSize, ...] = ({"width": 1440, "height": 900}, {"width": 390, "height": 844})
SCHEMES: tuple[Literal["light", "dark"], ...] = ("light", "dark")
MESH = "v 0 0 0\nv 30 0 0\nv 0 40 0\nv 0 0 20\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
ROWS = "phi,psi\n" + "".join(f"{v},{50 * math.sin(v):.1f}\n" for v in range(-170, 170, 6))
TASK = {"id": 10**9, "operation": "search", "share": 0.4, "what": "", "error": None, "place": 0}
READY = ".card, .form, .closeup-canvas, .drop, canvas.reading[aria-busy=false], .density .panel"


class Visit:
    """A page of the studio, and what it needs to come into its states."""

    def __init__(self, page: Page, turtle: dict[str, Any], density: str) -> None:
        self.page, self.turtle, self.density = page, turtle["id"], density
        self.tile = turtle["tiles"][0]["id"]

    def goto(self, path: str, ready: str = READY) -> None:
        """Open a page and wait until it is there."""
        self.page.goto(f"/#/{path}")
        self.page.wait_for_selector(ready)

    def answer(self, path: str, status: int = 200, body: Any = None) -> None:
        """Let the server answer this."""
        self.page.route(path, lambda route: route.fulfill(status=status, json=body))

    def refuse(self, path: str, error: str, status: int = 422) -> None:
        """Let the server refuse requests that change something."""

        def told(route: Route) -> None:
            if route.request.method == "GET":
                route.continue_()
            else:
                route.fulfill(status=status, json={"error": error})

        self.page.route(path, told)

    def project(self, own: str, change: Callable[[dict[str, Any]], Any]) -> None:
        """Change what the server tells of a project."""

        def told(route: Route) -> None:
            found = route.fetch().json()
            change(found)
            route.fulfill(json=found)

        self.page.route(f"**/api/projects/{own}", told)

    def task(self, own: str, **task: Any) -> None:
        """Let a project have this task only."""
        self.project(own, lambda found: found.update(tasks=[{**TASK, "result": None, **task}]))

    def searching(self, stage: str = "final", tiles: int = 9, **task: Any) -> None:
        """Show a search."""

        def fewer(found: dict[str, Any]) -> None:
            found["tasks"] = [{**TASK, "result": None, **task}]
            found["tiles"] = [{**card, "stage": stage} for card in found["tiles"][:tiles]]

        self.project(self.turtle, fewer)
        self.goto(f"p/{self.turtle}", ".state-words")

    def close_up(self, mode: str) -> None:
        """Show the tile."""
        self.goto(f"p/{self.turtle}/t/{self.tile}")
        self.page.locator(f".closeup-side label:has-text('{mode}')").first.click()
        if mode == "Pull":
            self.page.wait_for_selector("[data-ready=pull]")

    def pull(self, x: float, y: float) -> None:
        """Pull the turtle's back."""
        self.close_up("Pull")
        at = outline_in_window(self.page, BACK)
        self.page.mouse.move(*at)
        self.page.mouse.down()
        self.page.mouse.move(at[0] + x, at[1] + y, steps=6)

    def take(self, kind: str) -> None:
        """Show what can be taken away."""
        self.goto(f"p/{self.turtle}/take/{self.tile}", ".form")
        self.page.get_by_role("radio", name=kind, exact=True).check()
        self.page.wait_for_timeout(400)

    def make(self, kind: str) -> None:
        """Take something away."""
        self.take(kind)
        self.page.get_by_role("button", name="Download").click()
        self.page.wait_for_selector(".preview img", timeout=PATIENCE)

    def picture(self, **silhouette: Any) -> None:
        """Show what was read of the picture."""
        if silhouette:
            self.project(self.turtle, lambda found: found["silhouette"].update(silhouette))
        self.goto(f"p/{self.turtle}/picture")

    def paint(self, tool: str, *, lasso: bool = False) -> None:
        """Hold a stroke on the picture; what is sent of it is kept from the server."""
        self.refuse("**/api/projects/*/*", "")
        self.picture()
        if lasso:
            self.page.locator("label:has-text('lasso')").first.click()
        paint(self.page, tool, FOOT if tool == "Remove" else HEAD)

    def new_density(self) -> str:
        """Return a density project that is empty."""
        asked = self.page.request.post(
            "/api/projects", data={"kind": "density"}, headers={"X-Orbiflow": "1"}
        )
        return asked.json()["id"]

    def with_table(self, name: str, rows: str) -> None:
        """Bring a table to a density."""
        self.goto(f"d/{self.new_density()}")
        table = {"name": name, "mimeType": "text/csv", "buffer": rows.encode()}
        self.page.set_input_files("input[type=file]", [table])  # pyright: ignore[reportArgumentType]

    def with_mesh(self, name: str = "corner.obj", text: str = MESH) -> None:
        """Bring a mesh to the first page."""
        self.goto("")
        mesh = {"name": name, "mimeType": "model/obj", "buffer": text.encode()}
        self.page.set_input_files("input[accept*='.stl']", [mesh])  # pyright: ignore[reportArgumentType]

    def dialog(self, name: str) -> None:
        """Open a dialog of the first page."""
        self.goto("")
        self.page.get_by_role("button", name=name).first.click()
        self.page.wait_for_selector("dialog")


FULL = "there are 1000 projects already; delete some of them first"
DOUBTS = {
    "doubts": ["2 holes were filled, which may be background: try another edge (Where it ends)"],
    "notes": ["the animal is dark on a light ground", "smoothed by 1 % of its size"],
    "left_out": [[[300, 300], [360, 310], [330, 350]]],
}


def start_full(on: Visit) -> None:
    on.refuse("**/api/projects", FULL)
    on.goto("")
    on.page.locator(".animal").first.click()
    on.page.wait_for_selector(".told .error")


def start_refused(on: Visit) -> None:
    on.goto("")
    file = {"name": "notes.png", "mimeType": "image/png", "buffer": b"this is no picture"}
    on.page.set_input_files("#file", [file])  # pyright: ignore[reportArgumentType]
    on.page.wait_for_selector(".told .error")


def start_over(on: Visit) -> None:
    on.goto("")
    on.page.evaluate("document.body.classList.add('over')")


def start_empty(on: Visit) -> None:
    on.answer("**/api/projects", body=[])
    on.goto("")


def start_many(on: Visit) -> None:
    own = {"kind": "tile", "name": "Night monkey", "changed": 0, "thumb": None, "busy": False}
    on.answer("**/api/projects", body=[{**own, "id": f"{k}", "tiles": k} for k in range(1000)])
    on.answer("**/api/projects/*", body={**own, "id": "1", "tiles": []})
    on.goto("", ".project")


def picture_failed(on: Visit) -> None:
    error = "notes.png: not a picture that can be read; choose another one"
    failed = {**TASK, "operation": "read", "state": "failed", "result": None, "error": error}
    on.project(on.turtle, lambda found: found.update(silhouette=None, tiles=[], tasks=[failed]))
    on.page.goto(f"/#/p/{on.turtle}/picture")
    on.page.get_by_role("button", name="Choose another picture").wait_for()


def close_symmetry(on: Visit) -> None:
    on.close_up("Look")
    on.page.get_by_label("Show the symmetry").check()
    on.page.locator(".sign").first.hover()


def close_refused(on: Visit) -> None:
    on.refuse("**/by-hand/*", "the tile has become much too small or too large; pull less far")
    on.pull(10, -20)
    on.page.mouse.up()
    on.page.wait_for_selector("[data-kind=refused]")


def close_drawn(on: Visit) -> None:
    on.close_up("Draw")
    on.page.mouse.move(*in_window(on.page, (150.0, 120.0)))
    on.page.mouse.down()
    on.page.mouse.move(*in_window(on.page, (220.0, 150.0)), steps=9)


def take_running(on: Visit) -> None:
    on.take("Film")
    body = {"task": {**TASK, "operation": "animate", "state": "running", "what": "drawing"}}
    on.answer("**/tasks", body=body)
    on.page.get_by_role("button", name="Download").click()
    on.page.wait_for_selector("progress")


def take_refused(on: Visit) -> None:
    on.take("Print or cut")
    on.page.get_by_label("How long is one tile?").fill("much")
    on.page.get_by_role("button", name="Download").click()
    on.page.wait_for_selector(".field .error")


def take_thin(on: Visit) -> None:
    on.take("Print or cut")
    on.page.get_by_label("What is it for?").select_option("laser")
    on.page.locator("details").evaluate_all("all => all.forEach((own) => { own.open = true; })")


def density_refused(on: Visit) -> None:
    on.with_table("words.csv", "a,b\nx,y\n")
    on.page.wait_for_selector(".error")


def density_space(on: Visit) -> None:
    on.with_table("bends.csv", ROWS)
    on.page.get_by_role("button", name="Fit the density").wait_for()


def density_fitting(on: Visit) -> None:
    what = "held-out part 2 of 5: kernels of 40"
    on.task(on.density, operation="density fit", state="running", what=what)
    on.goto(f"d/{on.density}", ".watch")


def density_fitted(on: Visit) -> None:
    on.goto(f"d/{on.density}", "canvas.map[aria-label]")
    on.page.wait_for_timeout(800)


def density_region(on: Visit) -> None:
    density_fitted(on)
    on.page.get_by_label("Show the smallest region that holds").fill("0.5")
    on.page.get_by_role("slider", name="is held at").fill("120")


def solid_ready(on: Visit) -> None:
    on.with_mesh()
    on.page.wait_for_selector(".turned canvas")
    on.page.locator("details").evaluate_all("all => all.forEach((own) => { own.open = true; })")


def solid_refused(on: Visit) -> None:
    on.with_mesh("sheet.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    on.page.wait_for_selector(".told .error")


def solid_searching(on: Visit) -> None:
    on.with_mesh()
    on.page.wait_for_selector(".turned canvas")
    own = on.page.url.split("/s/")[1]
    on.task(own, operation="fill", state="running", what="closing")
    on.page.reload()
    on.page.wait_for_selector(".watch:not([hidden])")


def lost(on: Visit) -> None:
    on.goto(f"p/{on.turtle}")
    on.page.evaluate("document.querySelector('.lost').hidden = false")


STATES: dict[str, Callable[[Visit], Any]] = {
    "start": lambda on: on.goto("", ".project"),
    "start-empty": start_empty,
    "start-many": start_many,
    "start-over": start_over,
    "start-refused": start_refused,
    "start-full": start_full,
    "start-draw": lambda on: on.dialog("Draw a shape"),
    "start-rename": lambda on: on.dialog("Rename"),
    "picture": lambda on: on.picture(),
    "picture-doubts": lambda on: on.picture(**DOUBTS),
    "picture-brush": lambda on: on.paint("Add"),
    "picture-lasso": lambda on: on.paint("Remove", lasso=True),
    "picture-pin": lambda on: on.paint("Keep its shape"),
    "picture-failed": picture_failed,
    "search-waiting": lambda on: on.searching(state="waiting", tiles=0, place=2),
    "search-sketches": lambda on: on.searching("sketch", 3, state="running", what="sketching"),
    "search-running": lambda on: on.searching("better", state="running", what="IH4: bending it"),
    "search-paused": lambda on: on.searching("better", 5, state="paused"),
    "search-done": lambda on: on.searching(state="done"),
    "search-nothing": lambda on: on.searching(state="done", tiles=0),
    "search-failed": lambda on: on.searching(state="failed", tiles=0, error="it went wrong"),
    "close-look": lambda on: on.close_up("Look"),
    "close-symmetry": close_symmetry,
    "close-pull": lambda on: on.pull(8, -28),
    "close-stopped": lambda on: on.pull(0, 300),
    "close-refused": close_refused,
    "close-draw": close_drawn,
    **{
        f"take-{name}": lambda on, kind=kind: on.make(kind)
        for name, kind in {
            "print": "Print or cut", "picture": "Picture", "solid": "3D print", "film": "Film"
        }.items()
    },
    "take-thin": take_thin,
    "take-running": take_running,
    "take-refused": take_refused,
    "density-empty": lambda on: on.goto(f"d/{on.new_density()}"),
    "density-refused": density_refused,
    "density-space": density_space,
    "density-fitting": density_fitting,
    "density-fitted": density_fitted,
    "density-region": density_region,
    "solid-ready": solid_ready,
    "solid-refused": solid_refused,
    "solid-searching": solid_searching,
    "lost": lost,
    "gone": lambda on: on.goto("p/nothing", ".lonely"),
}  # fmt: skip


def prepared(address: str) -> tuple[dict[str, Any], str]:
    """Make a turtle with tiles and a density; return the turtle's project and the density's number."""

    def ask(method: str, path: str, body: bytes | None = None, kind: str = "json") -> Any:
        head = {"X-Orbiflow": "1", "Content-Type": f"application/{kind}"}
        asked = urllib.request.Request(f"{address}/api/{path}", body, head, method=method)
        with urllib.request.urlopen(asked) as answer:
            return json.load(answer)

    def ended(own: str) -> dict[str, Any]:
        while True:
            found = ask("GET", f"projects/{own}")
            if found["tasks"] and found["tasks"][0]["state"] in ("done", "failed"):
                return found
            time.sleep(0.5)

    turtle = ask("POST", "projects", b"{}")["id"]
    ask("PUT", f"projects/{turtle}/input?name=turtle.png", ANIMAL.read_bytes(), "octet-stream")
    ended(turtle)
    search = {"operation": "search", "settings": {"effort": "fast"}}
    ask("POST", f"projects/{turtle}/tasks", json.dumps(search).encode())
    density = ask("POST", "projects", b'{"kind": "density"}')["id"]
    ask("PUT", f"projects/{density}/density/table?name=bends.csv", ROWS.encode(), "octet-stream")
    ended(density)
    chosen = {"space": "torus", "columns": ["phi", "psi"], "unit": "degrees"}
    fit = {"operation": "density fit", "settings": chosen}
    ask("POST", f"projects/{density}/tasks", json.dumps(fit).encode())
    ended(density)
    return ended(turtle), density


def visit(browser: Browser, address: str, folder: Path, names: list[str]) -> None:
    """Take the pictures."""
    turtle, density = prepared(address)
    for name in names:
        for size in SIZES:
            for scheme in SCHEMES:
                context = browser.new_context(
                    viewport=size, base_url=address, color_scheme=scheme, reduced_motion="reduce"
                )
                page = context.new_page()
                page.set_default_timeout(60_000)
                STATES[name](Visit(page, turtle, density))
                page.wait_for_timeout(500)
                file = folder / f"{name}-{size['width']}-{scheme}.png"
                page.screenshot(path=file, full_page=not page.evaluate("scrollY"))
                for fault in [*untidy_parts(page), *serious_issues(page)]:
                    print(f"{file.name}: {fault}")
                context.close()


def main() -> None:
    """Start the studio and go through its states."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("states", nargs="*", help=f"of {', '.join(STATES)}; all by default")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    with (
        tempfile.TemporaryDirectory() as data,
        running_studio(Path(data)) as address,
        sync_playwright() as playwright,
    ):
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
        )
        visit(browser, address, options.folder, options.states or list(STATES))
        browser.close()


if __name__ == "__main__":
    main()
