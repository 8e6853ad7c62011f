"""The pictures of docs/studio.md: what a visitor sees, in windows of a desk and of a phone."""

from __future__ import annotations

import io
from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser, Page, ViewportSize

from studio_screen import BACK, EYE, in_window, outline_in_window

IMAGES = Path(__file__).parents[1] / "images"
WIDE: ViewportSize = {"width": 1280, "height": 860}
TALL: ViewportSize = {"width": 1280, "height": 1240}
PHONE: ViewportSize = {"width": 390, "height": 844}
PATIENCE = 600_000  # milliseconds for a search on a busy machine
HEAD = ((0.09, 0.11), (0.13, 0.18), (0.18, 0.26))
FOOT = ((0.5, 0.83), (0.53, 0.88), (0.51, 0.93))
STRIPES = [
    ((x, x / 3 + 68), (x + 12, x / 2 + 82)) for x in (130.0, 175.0, 220.0, 265.0)
]  # of a shell
MARGIN = 24
DRAWN = """async (own) =>
    (await (await fetch(`/api/projects/${own}`)).json()).view.drawing?.eyes.length"""


def keep(page: Page, name: str) -> None:
    """Keep what a page shows as a picture of docs."""
    with Image.open(io.BytesIO(page.screenshot())) as shot:
        shot.convert("RGB").save(IMAGES / f"studio-{name}.webp", quality=82, method=6)


def paint(page: Page, tool: str, points: tuple[tuple[float, float], ...]) -> None:
    """Paint a line over the picture that was read, through shares of its width and height."""
    page.locator(f"label:has-text('{tool}')").first.click()
    page.locator("canvas.reading").scroll_into_view_if_needed()
    box = page.locator("canvas.reading").bounding_box()
    assert box
    for k, (x, y) in enumerate(points):
        page.mouse.move(box["x"] + x * box["width"], box["y"] + y * box["height"], steps=5)
        if k == 0:
            page.mouse.down()


def start_and_picture(page: Page, project: str) -> None:
    """The first page; the picture while it is mended."""
    page.goto("/")
    page.wait_for_selector(".animal img")
    page.wait_for_load_state("networkidle")
    page.wait_for_timeout(500)
    keep(page, "start")
    page.goto(f"/#/p/{project}/picture")
    page.wait_for_selector("canvas.reading[aria-busy=false]")
    paint(page, "Matters most", HEAD)
    page.mouse.up()
    page.wait_for_timeout(600)
    paint(page, "Remove", FOOT)
    page.wait_for_timeout(300)
    keep(page, "picture")
    page.keyboard.press("Escape")


def close_up(page: Page, path: str) -> None:
    """One tile: its symmetry, a point that is pulled."""
    page.goto(f"/#/{path}")
    page.wait_for_selector(".closeup-canvas")
    page.locator(".closeup-side label:has-text('Look')").first.click()
    page.get_by_label("Show the symmetry").check()
    page.locator(".sign").first.hover()
    page.wait_for_timeout(700)
    keep(page, "symmetry")
    page.get_by_label("Show the symmetry").uncheck()
    page.locator(".closeup-side label:has-text('Pull')").first.click()
    page.wait_for_selector("[data-ready=pull]")
    x, y = outline_in_window(page, BACK)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 8, y - 28, steps=8)
    page.wait_for_timeout(600)
    keep(page, "pull")
    page.keyboard.press("Escape")
    page.mouse.up()


def draw(page: Page, path: str) -> None:
    """A tile with an eye and a line, in the dark."""
    page.goto(f"/#/{path}")
    page.wait_for_selector(".closeup-canvas")
    page.locator(".closeup-side label:has-text('Draw')").first.click()
    x, y = in_window(page, EYE)
    if not page.evaluate(DRAWN, path.split("/")[1]):
        page.locator(".closeup-side label:has-text('Eye')").first.click()
        page.mouse.click(x, y)
    page.locator(".closeup-side label:has-text('Pencil')").first.click()
    page.get_by_role("radio", name="Yellow").check()
    for stripe in STRIPES:
        for k, place in enumerate(stripe):
            page.mouse.move(*in_window(page, place), steps=8)
            if k == 0:
                page.mouse.down()
        page.mouse.up()
    page.mouse.move(5, 5)
    page.wait_for_timeout(900)
    keep(page, "draw")


def take_away(page: Page, path: str) -> None:
    """What has been made of a tile."""
    page.goto(f"/#/{path}")
    page.wait_for_selector(".form")
    page.get_by_role("radio", name="Pieces for a laser").check()
    page.get_by_role("button", name="Download", exact=True).click()
    page.wait_for_selector(".said a", timeout=PATIENCE)
    page.wait_for_timeout(700)
    page.evaluate("scrollTo(0, 0)")
    keep(page, "take")


def density(page: Page) -> None:
    """A density of one of the tables that are there to try."""
    page.goto("/")
    page.get_by_role("button", name="Numbers instead of animals").click()
    page.locator(".example").first.click()
    page.get_by_role("button", name="Fit the density").click()
    page.wait_for_selector(".turned canvas", timeout=PATIENCE)
    page.wait_for_load_state("networkidle")
    page.wait_for_timeout(2500)
    keep(page, "density")


def solid(page: Page, path: str) -> None:
    """A solid that was found of a mesh, with its stack a little apart."""
    page.goto(f"/#/{path}")
    page.wait_for_selector(".solids li")
    page.get_by_label("Turn slowly").uncheck()
    page.get_by_role("slider", name="Apart").fill("25")
    page.locator("h1").focus()
    page.wait_for_timeout(1500)
    keep(page, "solid")


def phones(browser: Browser, address: str, own: str, tile: int) -> None:
    """Three pages on a phone, side by side; two of them in the dark."""
    seen: list[Image.Image] = []
    for path, ready, dark in (
        (f"p/{own}", ".card[data-tile]", True),
        (f"p/{own}/t/{tile}", ".closeup-canvas", False),
        (f"p/{own}/take/{tile}", ".form", True),
    ):
        scheme = "dark" if dark else "light"
        page = browser.new_page(viewport=PHONE, base_url=address, color_scheme=scheme)
        page.goto(f"/#/{path}")
        page.wait_for_selector(ready)
        page.wait_for_timeout(1200)
        seen.append(Image.open(io.BytesIO(page.screenshot())).convert("RGB"))
        page.close()
    width, height = PHONE["width"], PHONE["height"]
    sheet = Image.new("RGB", (3 * width + 2 * MARGIN, height), "#8f8b83")
    for k, one in enumerate(seen):
        sheet.paste(one, (k * (width + MARGIN), 0))
    sheet.save(IMAGES / "studio-phone.webp", quality=82, method=6)


def make_pictures(browser: Browser, address: str) -> None:
    """Make all pictures of the newest project that has tiles."""
    page = browser.new_page(viewport=WIDE, base_url=address)
    page.set_default_timeout(PATIENCE)
    page.goto("/")
    ask = "async (path) => (await fetch(`/api/${path}`)).json()"
    every = [one for one in page.evaluate(ask, "projects") if one["tiles"]]
    own = next(one["id"] for one in every if one["kind"] == "tile")
    project = page.evaluate(ask, f"projects/{own}")
    tile = project["tiles"][0]["id"]
    start_and_picture(page, own)
    close_up(page, f"p/{own}/t/{tile}")
    dark = browser.new_page(viewport=WIDE, base_url=address, color_scheme="dark")
    draw(dark, f"p/{own}/t/{tile}")
    take_away(page, f"p/{own}/take/{tile}")
    phones(browser, address, own, tile)
    density(page)
    for one in [one for one in every if one["kind"] == "solid"][:1]:  # no mesh is kept here
        solid(page, f"s/{one['id']}")
