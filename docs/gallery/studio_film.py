"""Make the studio's pictures and its film again: `python docs/gallery/studio_film.py`.

The real command runs on a temporary folder, and Chromium, driven by Playwright, does what a visitor
does. The pointer is drawn, as browsers without windows show none. The search is the quick one.
"""

from __future__ import annotations

import argparse
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, ViewportSize, sync_playwright

import orbiflow
from studio_pictures import IMAGES, PATIENCE, TALL, keep, make_pictures
from studio_screen import BACK, EYE, Film, centre, in_window, outline_in_window

ANIMAL = Path(orbiflow.__file__).parent / "studio" / "animals" / "turtle.svg"
SHAPE = IMAGES.parents[1] / "examples" / "silhouettes" / "turtle.png"
FILMED: ViewportSize = {"width": 1080, "height": 675}

DROP = """async ([bytes, name]) => {
    const files = new DataTransfer();
    files.items.add(new File([new Uint8Array(bytes)], name, { type: "image/svg+xml" }));
    const given = new Event("drop", { bubbles: true, cancelable: true });
    Object.defineProperty(given, "dataTransfer", { value: files });
    document.body.dispatchEvent(given);
}"""


@contextmanager
def running_studio(folder: Path) -> Iterator[str]:
    """Start the command and give its address."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"http://127.0.0.1:{port}"
    words = ["studio", "--port", str(port), "--data", str(folder), "--no-browser"]
    server = subprocess.Popen([sys.executable, "-m", "orbiflow", *words])
    try:
        while server.poll() is None:
            try:
                urllib.request.urlopen(f"{address}/api/about").close()
                break
            except OSError:
                time.sleep(0.2)
        yield address
    finally:
        server.terminate()
        server.wait()


def bring_picture(film: Film) -> None:
    """Drop a picture on the first page."""
    page = film.page
    page.wait_for_selector(".animal img")
    film.rest(500)
    with Image.open(SHAPE) as picture:
        film.carried = picture.convert("LA").resize((130, 122))
    film.pointer = (1050.0, 640.0)
    film.go(*centre(page, ".drop"), frames=9)
    film.carried = None
    page.evaluate(DROP, [list(ANIMAL.read_bytes()), "turtle.svg"])


def watch_search(film: Film) -> None:
    """Watch the tiles get better; another tab keeps a picture of it."""
    page = film.page
    page.wait_for_selector(".cards")
    other = page.context.new_page()
    other.set_viewport_size(TALL)
    other.goto(page.url)
    page.wait_for_selector(".card[data-tile]", timeout=PATIENCE)
    taken = False
    while page.get_by_role("button", name="Pause").count():
        film.sample()
        if not taken and other.locator(".card[data-stage=final]").count():
            keep(other, "search")
            taken = True
        page.wait_for_timeout(300)
    other.close()
    film.keep_samples(16, 150)
    film.rest(500)


def pull_point(film: Film) -> None:
    """Open the best tile and pull a point of its outline."""
    page = film.page
    film.click(*centre(page, ".card[data-tile] canvas"))
    page.wait_for_selector(".closeup-canvas")
    page.wait_for_timeout(300)
    film.rest(500)
    film.click(*centre(page, ".closeup-side label:has-text('Pull')"))
    page.wait_for_selector("[data-ready=pull]")
    x, y = outline_in_window(page, BACK)
    film.go(x, y, frames=6)
    page.mouse.down()
    film.pressed = True
    for aside, up, frames in ((12, 22, 10), (-16, 20, 9)):
        film.go(x + aside, y - up, frames=frames)
    while page.locator(".badge[data-kind=crossed]").count():
        film.go(0.7 * film.pointer[0] + 0.3 * x, 0.7 * film.pointer[1] + 0.3 * y, frames=2)
    page.mouse.up()
    film.pressed = False
    page.wait_for_selector(".badge[data-kind=proved]")
    film.rest(700)


def draw_eye(film: Film) -> None:
    """Put an eye into the tile."""
    page = film.page
    film.click(*centre(page, ".closeup-side label:has-text('Draw')"))
    film.click(*centre(page, ".closeup-side label:has-text('Eye')"))
    film.click(*in_window(page, EYE))
    page.wait_for_timeout(700)  # until the drawing is kept
    film.go(film.pointer[0] + 130, film.pointer[1] + 190, frames=4)
    film.rest(600)


def take_away(film: Film) -> None:
    """Make a file and show it."""
    page = film.page
    film.click(*centre(page, ".steps >> text=Take"))
    page.wait_for_selector(".form")
    page.get_by_role("radio", name="Mug").check()
    film.rest(400)
    film.click(*centre(page, "text=Download"))
    page.wait_for_selector(".preview img", timeout=PATIENCE)
    page.wait_for_function("document.querySelector('.preview img').complete")
    page.evaluate("scrollTo(0, 0)")
    film.go(*centre(page, ".said a.button"), frames=5)
    film.rest(1500)


def make_film(page: Page) -> Film:
    """Go the whole way, from a picture to a file."""
    film = Film(page)
    for act in (bring_picture, watch_search, pull_point, draw_eye, take_away):
        act(film)
    return film


def main() -> None:
    """Make the film and the pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--no-film", action="store_true", help="the pictures alone")
    parser.add_argument("--data", help="folder of projects to take pictures of, or to leave there")
    options = parser.parse_args()
    with (
        tempfile.TemporaryDirectory() as temporary,
        running_studio(Path(options.data or temporary)) as address,
        sync_playwright() as playwright,
    ):
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
        )
        if not options.no_film:
            page = browser.new_context(viewport=FILMED, base_url=address).new_page()
            page.set_default_timeout(PATIENCE)
            page.goto("/")
            film = make_film(page)
            film.write(IMAGES / "studio.gif", width=720, seconds=10.0)
            page.context.close()
        make_pictures(browser, address)
        browser.close()


if __name__ == "__main__":
    main()
