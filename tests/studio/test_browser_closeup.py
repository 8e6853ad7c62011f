"""The page of one tile in a real browser: look, pull, undo, draw, and what is in the file then."""

import json
import math
from typing import Any

import pytest
import shapely

from orbiflow.studio.tile_files import tile_folder
from orbiflow.tiles import certify, read_result
from studio.browser import RunningStudio, covers_page_once, drag, middle
from studio_checks import serious_issues, untidy_parts

CANVAS, BADGE = ".closeup-canvas", ".badge"


@pytest.fixture(name="tile")
def tile_fixture(studio: RunningStudio, searched: str) -> dict[str, Any]:
    """The best tile that a search has found."""
    return studio.project(searched)["tiles"][0]


@pytest.fixture(name="closeup")
def closeup_fixture(page: Any, searched: str, tile: dict[str, Any]) -> Any:
    """The page of that tile."""
    page.goto(f"/#/p/{searched}/t/{tile['id']}")
    page.wait_for_selector(CANVAS)
    return page


def shown(page: Any) -> int:
    """Return the number of the tile that the page shows."""
    return int(page.url.rsplit("/", 1)[1])


def proved(page: Any, but: int) -> int:
    """Wait until another tile than `but` is shown and proved; return its number."""
    page.wait_for_url(lambda url: not url.endswith(f"/{but}"))
    page.wait_for_selector(f"{BADGE}[data-kind=proved]")
    return shown(page)


def picture(page: Any) -> str:
    """Return what the canvas shows, with the pointer elsewhere."""
    page.mouse.move(5, 5)
    page.wait_for_timeout(100)
    return page.locator(CANVAS).evaluate("canvas => canvas.toDataURL()")


def choose(page: Any, what: str) -> None:
    page.get_by_role("radio", name=what, exact=True).check()
    if what == "Pull":
        page.wait_for_selector("[data-ready=pull]")


def place_on_outline(page: Any) -> tuple[float, float]:
    """Return a place of the window where the outline can be taken hold of."""
    x, y = middle(page)
    for step in range(100):
        place = x + 3.0 * step, y + 1.0 * step
        page.mouse.move(*place)
        if page.locator(CANVAS).evaluate("canvas => canvas.style.cursor") == "grab":
            return place
    raise AssertionError("no outline was found")


def pulled(page: Any, x: float, y: float) -> None:
    """Take hold of the outline, pull it and let it go."""
    px, py = place_on_outline(page)
    page.mouse.move(px, py)
    page.mouse.down()
    page.mouse.move(px + x / 2, py + y / 2)
    page.mouse.move(px + x, py + y)
    page.mouse.up()


def test_pull_certify_undo_redo(closeup, studio: RunningStudio, searched: str, tile) -> None:
    page, first = closeup, tile["id"]
    choose(page, "Pull")
    pulled(page, 26.0, 14.0)
    second = proved(page, first)
    card = next(c for c in studio.project(searched)["tiles"] if c["id"] == second)
    assert (card["parent"], card["certified"]) == (first, True)
    found = read_result(tile_folder(studio.folder / "projects" / searched, second))
    assert certify(found.tile).valid
    assert covers_page_once(studio.made(searched, "export", second, purpose="web"))
    page.keyboard.press("Control+z")
    assert proved(page, second) == first
    page.keyboard.press("Control+Shift+Z")
    assert proved(page, first) == second
    page.get_by_role("button", name="Undo").click()
    assert proved(page, second) == first
    # the pulled tile is there after a reload, and knows where it came from
    page.goto(f"/#/p/{searched}/t/{second}")
    page.reload()
    page.wait_for_selector(".past button:enabled")
    page.get_by_role("button", name="Undo").click()
    assert proved(page, second) == first


def test_nothing_is_undone_before_the_tile_is_there(page, searched: str, tile) -> None:
    held = list[Any]()
    page.route("**/tiles/*", lambda route: held.append(route))
    page.goto(f"/#/p/{searched}/t/{tile['id']}")
    page.get_by_role("button", name="Undo").wait_for()
    assert page.get_by_role("button", name="Undo").is_disabled()
    page.keyboard.press("Control+z")
    held[0].continue_()
    page.wait_for_selector(f"{BADGE}[data-kind=proved]")
    assert shown(page) == tile["id"]


def test_by_keyboard_and_too_far_stops_at_the_last_tile(closeup, tile) -> None:
    page = closeup
    choose(page, "Pull")
    page.locator(CANVAS).focus()
    for _ in range(3):
        page.keyboard.press("ArrowRight")
    assert "Point" in page.locator("[aria-live=polite]").first.inner_text()
    for key in ("Shift+ArrowDown", "Shift+ArrowDown", "Enter"):
        page.keyboard.press(key)
    second = proved(page, tile["id"])
    page.wait_for_selector("[data-ready=pull]")
    x, y = place_on_outline(page)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y + 350)
    page.mouse.move(x, y + 700)
    page.wait_for_selector(f"{BADGE}[data-kind=stopped]:has-text('No further here')")
    page.mouse.up()
    assert proved(page, second) != second


def test_a_refusal_springs_back_is_said_once_and_makes_way(closeup, tile) -> None:
    page, why = closeup, "the tile has become much too small or too large"
    page.clock.install()
    page.route("**/by-hand/pull", lambda route: route.fulfill(status=422, json={"error": why}))
    choose(page, "Pull")
    before = picture(page)
    pulled(page, 26.0, 14.0)
    page.wait_for_selector(f"{BADGE}[data-kind=refused]")
    assert picture(page) == before
    assert shown(page) == tile["id"]
    live = page.locator("[role=status], [aria-live]").filter(has_text="much too small")
    assert live.count() == 1
    page.clock.fast_forward(9000)
    page.wait_for_selector(f"{BADGE}[data-kind=proved]")
    # the refusal is an answer of the server, which browsers note
    page.wrong[:] = [said for said in page.wrong if "422" not in said]


def test_a_check_shows_how_far_it_is_and_can_be_stopped(page, studio, searched: str, tile) -> None:
    running = {"id": 999, "operation": "pull", "state": "running", "share": 0.4, "what": "checking"}
    event = f"event: task\ndata: {json.dumps(running)}\n\n"
    stream = {"content_type": "text/event-stream", "body": event}
    page.route("**/events?after*", lambda route: route.fulfill(**stream))
    held, stopped = list[Any](), list[str]()
    page.route("**/by-hand/pull", lambda route: held.append(route))
    page.route("**/tasks/999/cancel", lambda r: stopped.append(r.request.url) or r.fulfill(json={}))
    page.goto(f"/#/p/{searched}/t/{tile['id']}")
    page.wait_for_selector(f"{BADGE}[data-kind=proved]")
    choose(page, "Pull")
    pulled(page, 26.0, 14.0)
    page.wait_for_selector(f"{BADGE}:has-text('Checking … 40 %')")
    page.get_by_role("button", name="Stop").click()
    studio.until(lambda: page.wait_for_timeout(20) or stopped)
    held[0].fulfill(status=422, json={"error": "the change was cancelled; pull again"})
    page.wait_for_selector(f"{BADGE}[data-kind=refused]")
    assert page.get_by_role("button", name="Stop").count() == 0
    page.wrong.clear()  # a refusal is noted, and a stream that ends


def test_the_inside_is_pulled_and_the_outline_stays(closeup, studio, searched: str, tile) -> None:
    page, first = closeup, tile["id"]
    choose(page, "Pull")
    page.get_by_role("radio", name="The inside").check()
    assert not page.get_by_label("The outline gives way").is_checked()
    drag(page, (0, 0), (12, 8))
    second = proved(page, first)
    views = [studio.client.get(f"projects/{searched}/tiles/{k}").json() for k in (first, second)]
    one, other = (shapely.Polygon(view["polygon"]) for view in views)
    assert one.symmetric_difference(other).area < 1e-4 * one.area
    inner = [view["map"]["images"] for view in views]
    assert inner[0] != inner[1]
    page.get_by_role("radio", name="The outline", exact=True).check()
    page.get_by_role("button", name="Put it back").click()
    assert proved(page, second) == first
    studio.client.patch(f"projects/{searched}", json={"view": {"closeup": {}}})


def test_lines_and_eyes_repeat_and_are_in_the_file(closeup, studio, searched, tile) -> None:
    page = closeup
    before = picture(page)
    choose(page, "Draw")
    page.get_by_role("radio", name="Red").check()
    drag(page, *[(4 * k - 40, 12 * math.sin(k / 3)) for k in range(20)])
    page.get_by_role("radio", name="Eye").check()
    drag(page, (0, -20))
    studio.until(lambda: studio.project(searched)["view"].get("drawing", {}).get("eyes"))
    drawn = studio.project(searched)["view"]["drawing"]
    assert {stroke["colour"] for stroke in drawn["strokes"]} == {"#c8322b"}
    assert picture(page) != before
    made = studio.made(searched, "export", tile["id"], purpose="web", drawing=True)
    assert "#c8322b" in made
    # by keyboard: down, three steps, up
    choose(page, "Draw")
    page.get_by_role("radio", name="Pencil").check()
    page.locator(CANVAS).focus()
    for key in ("Space", "ArrowRight", "ArrowDown", "ArrowRight", "Space"):
        page.keyboard.press(key)
    count = len(drawn["strokes"])
    studio.until(lambda: len(studio.project(searched)["view"]["drawing"]["strokes"]) > count)
    page.keyboard.press("Control+z")
    page.keyboard.press("Control+z")
    studio.until(lambda: not studio.project(searched)["view"]["drawing"]["eyes"])
    page.get_by_role("button", name="Clear the drawing").click()
    studio.until(lambda: not studio.project(searched)["view"]["drawing"]["strokes"])


def test_symmetry_is_said_and_looks_are_kept(closeup, studio: RunningStudio, searched: str) -> None:
    page = closeup
    choose(page, "Look")
    page.get_by_label("Show the symmetry").check()
    page.get_by_role("button", name="Half-turn points").focus()
    assert "lit" in page.locator(".sign[data-key=turn2]").get_attribute("class")
    page.get_by_role("radio", name="lagoon").check()
    page.get_by_label("Outline").fill("3")
    page.get_by_label("From your picture to the tile").fill("0.5")
    studio.until(lambda: studio.project(searched)["view"].get("look", {}).get("line") == 3)
    kept = studio.project(searched)["view"]["look"]
    assert (kept["palette"], kept["signs"], "share" in kept) == ("lagoon", True, False)
    page.reload()
    page.wait_for_selector(".sign")
    assert page.get_by_role("radio", name="lagoon").is_checked()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nobody_is_kept_out(closeup, scheme: str) -> None:
    page = closeup
    page.emulate_media(color_scheme=scheme)
    for width in (1440, 360):
        page.set_viewport_size({"width": width, "height": 800})
        for mode in ("Look", "Pull", "Draw"):
            choose(page, mode)
            assert serious_issues(page) == []
            assert untidy_parts(page) == []
