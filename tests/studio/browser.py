"""A studio that runs as the real command, and a browser that looks at it."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
import shapely

from exported import polygons, svg_lines

CHROMIUM = Path("/usr/bin/chromium")
PATIENCE = 120.0  # seconds until something that never comes counts as missing
TESTS = Path(__file__).parents[1]
# the command, whose workers search by less at the effort "fast"
SMALL = """
from orbiflow.cli.app import main
from orbiflow.studio import work_queue

work_queue.WARM_MODULES += ("runtime.small_process",)
main()
"""
BOOT = b"[[0, 0], [60, 0], [60, 20], [30, 25], [28, 70], [0, 70]]"


class RunningStudio:
    """The real server in a process of its own; it can be killed and started again."""

    def __init__(self, folder: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.folder, self.saved = folder, b""
        self.address = f"http://127.0.0.1:{self.port}"
        given: dict[str, Any] = {"timeout": PATIENCE, "trust_env": False}
        given |= {"base_url": f"{self.address}/api/", "headers": {"X-Orbiflow": "1"}}
        self.client = httpx.Client(**given)

    def start(self) -> None:
        """Start the server and wait until it answers."""
        own = ["--port", str(self.port), "--data", str(self.folder), "--no-browser"]
        self.process = subprocess.Popen(
            [sys.executable, "-c", SMALL, "studio", *own],
            stdout=subprocess.DEVNULL,
            env={
                **os.environ,
                "XDG_CONFIG_HOME": str(self.folder / "config"),
                "PYTHONPATH": f"{TESTS}{os.pathsep}{os.environ.get('PYTHONPATH', '')}",
            },
        )
        self.until(self._answers)

    def _answers(self) -> bool:
        assert self.process.poll() is None, "the server has ended"
        try:
            return self.client.get("about").is_success
        except httpx.TransportError:
            return False

    def kill(self) -> None:
        """End the server as a power cut would."""
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def stop(self) -> None:
        """End the server as a user would."""
        self.process.send_signal(signal.SIGINT)
        self.process.wait()

    def until(self, holds: Callable[[], Any]) -> Any:
        """Return what a function returns, as soon as that is true."""
        end = time.monotonic() + PATIENCE
        while not (found := holds()):
            assert time.monotonic() < end, f"never became true: {holds}"
            time.sleep(0.05)
        return found

    def project(self, own: str) -> dict[str, Any]:
        """Return a project as pages are told of it."""
        return self.client.get(f"projects/{own}").json()

    def with_picture(self, data: bytes = BOOT, name: str = "boot.json") -> str:
        """Return a new project whose picture has been read."""
        own = self.client.post("projects", json={"kind": "tile"}).json()["id"]
        self.client.put(f"projects/{own}/input", params={"name": name}, content=data)
        self.until(lambda: self.project(own)["silhouette"])
        return own

    def with_tiles(self) -> str:
        """Return a new project with what one search for all tests has found."""
        if not self.saved:
            own = self.with_picture()
            self.search(own, "IH4")
            assert self.found(own)
            self.saved = self.client.get(f"projects/{own}/file").content
        own = self.client.post("projects/open", content=self.saved).json()["id"]
        self.until(lambda: self.project(own)["silhouette"])
        return own

    def made(self, own: str, operation: str, tile: int, **settings: Any) -> str:
        """Return the text of a file that is made of a tile."""
        body = {"operation": operation, "settings": {"tile": tile, **settings}}
        number = self.client.post(f"projects/{own}/tasks", json=body).json()["task"]["id"]

        def ended() -> Any:
            (task,) = [one for one in self.project(own)["tasks"] if one["id"] == number]
            return task if task["state"] in ("done", "failed") else None

        task = self.until(ended)
        assert task["state"] == "done", task["error"]
        [file] = task["result"]["files"]
        return self.client.get(f"takeaways/{number}/files/{file['name']}").text

    def search(self, own: str, *classes: str) -> None:
        """Start a short search."""
        settings = {"effort": "fast", **({"classes": classes} if classes else {})}
        body = {"operation": "search", "settings": settings}
        self.client.post(f"projects/{own}/tasks", json=body).raise_for_status()

    def found(self, own: str) -> list[dict[str, Any]]:
        """Return the tiles of a project, once its search is done."""
        self.until(lambda: self.project(own)["tasks"][0]["state"] == "done")
        return self.project(own)["tiles"]


@contextmanager
def running_studio(folder: Path) -> Iterator[RunningStudio]:
    """Give a studio that runs."""
    own = RunningStudio(folder)
    own.start()
    try:
        yield own
    finally:
        own.stop()
        own.client.close()


def chromium() -> Path:
    """Return the browser, or skip the test."""
    pytest.importorskip("playwright", reason="playwright is not installed: no browser tests")
    if not CHROMIUM.exists():
        pytest.skip(f"{CHROMIUM} is missing: no browser tests")
    return CHROMIUM


def small_searches(page: Any, *classes: str) -> None:
    """Let the searches that a page asks for be short ones, in these classes only."""

    def shorten(route: Any) -> None:
        body = route.request.post_data_json
        if body["operation"] == "search":
            body["settings"] |= {"effort": "fast", "classes": list(classes)}
        route.continue_(post_data=body)

    page.route("**/tasks", shorten)


def middle(page: Any, selector: str = ".closeup-canvas") -> tuple[float, float]:
    """Return the middle of what is seen of an element, in pixels of the window."""
    box = page.locator(selector).bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def drag(page: Any, *places: tuple[float, float], selector: str = ".closeup-canvas") -> None:
    """Draw along places, given from the middle of an element."""
    x, y = middle(page, selector)
    page.mouse.move(x + places[0][0], y + places[0][1])
    page.mouse.down()
    for u, v in places[1:]:
        page.mouse.move(x + u, y + v, steps=4)
    page.mouse.up()


def area_of(project: dict[str, Any]) -> float:
    """Return the area of a project's silhouette in pixels of its picture."""
    return shapely.Polygon(project["silhouette"]["outline"]).area


def covers_page_once(text: str) -> bool:
    """Return whether the tiles of an SVG, clipped at its page, leave no gap and do not overlap.

    Lengths in the file are rounded to micrometres.
    """
    lines = [line for line in svg_lines(text) if line.layer != "paper"]
    found = polygons(lines)
    size = np.array(text.split('viewBox="')[1].split('"')[0].split(), dtype=float)
    page = shapely.box(*size)
    pieces = shapely.intersection(found, page)
    slivers = 2e-3 * sum(polygon.length for polygon in found)
    missing = page.area - shapely.union_all(pieces, grid_size=1e-6).area
    twice = shapely.area(pieces).sum() - (page.area - missing)
    return len(found) > 20 and abs(missing) <= slivers and abs(twice) <= slivers
