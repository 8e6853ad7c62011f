"""Drawing on a tile, and beginning with a shape that fits, in a real browser."""

import json
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import pytest
import shapely

from orbiflow.tiles import CLASSES, ISOHEDRAL_TYPES
from studio.browser import BOOT, RunningStudio, drag
from studio_checks import serious_issues

CANVAS = ".closeup-canvas"
COLOUR_AT = """(canvas, [x, y]) => {
    const ratio = canvas.width / canvas.clientWidth;
    return [...canvas.getContext("2d").getImageData(x * ratio, y * ratio, 1, 1).data].slice(0, 3);
}"""
RED, BLUE = [200, 50, 43], [37, 99, 168]


@pytest.fixture(name="pen")
def pen_fixture(page: Any, studio: RunningStudio, searched: str) -> Iterator[Any]:
    """The page on which a tile is drawn on, close up; what is drawn is gone afterwards."""
    tile = studio.project(searched)["tiles"][0]["id"]
    page.goto(f"/#/p/{searched}/t/{tile}")
    page.wait_for_selector(".badge[data-kind=proved]")
    page.get_by_role("radio", name="Draw", exact=True).check()
    for _ in range(4):
        page.get_by_role("button", name="Nearer").click()
    yield page
    page.close()
    studio.client.patch(f"projects/{searched}", json={"view": {"drawing": {}, "closeup": {}}})


def colour(page: Any, x: float, y: float) -> list[int]:
    """Return the colour of the canvas at a place from its middle."""
    box = page.locator(CANVAS).bounding_box()
    page.wait_for_timeout(80)
    place = [box["width"] / 2 + x, box["height"] / 2 + y]
    return page.locator(CANVAS).evaluate(COLOUR_AT, place)


def drawn(studio: RunningStudio, own: str, strokes: int, eyes: int = 0) -> dict[str, Any]:
    """Return what the project remembers, once it has so many lines and parts, and eyes."""

    def found() -> Any:
        now = studio.project(own)["view"].get("drawing") or {}
        counts = len(now.get("strokes", [])), len(now.get("eyes", []))
        return now if counts == (strokes, eyes) else None

    return studio.until(found)


def test_a_box_of_straight_lines_is_filled_to_its_lines(pen, studio, searched) -> None:
    pen.get_by_role("radio", name="Line", exact=True).check()
    pen.get_by_role("radio", name="Black").check()
    corners = [(-30, -30), (30, -30), (30, 30), (-30, 30), (-30, -30)]
    for one, other in pairwise(corners):
        drag(pen, one, (5, 5), other)  # where it went meanwhile does not count
    assert colour(pen, 0, -30) == [27, 27, 27]
    before, beyond = colour(pen, 0, 0), colour(pen, 0, 42)
    pen.get_by_role("radio", name="Fill").check()
    pen.get_by_role("radio", name="Red").check()
    drag(pen, (0, 0))
    assert colour(pen, 0, 0) == RED != before
    assert colour(pen, 0, -30) == [27, 27, 27]
    assert colour(pen, 0, 42) == beyond
    strokes = drawn(studio, searched, 5)["strokes"]
    assert [bool(one.get("rings")) for one in strokes] == [True, *[False] * 4]  # under the lines
    # what is filled is in what is made
    tile = studio.project(searched)["tiles"][0]["id"]
    assert "#c8322b" in studio.made(searched, "art", tile, drawing=True, format="svg")
    # the drawing can be hidden
    pen.get_by_label("Show the drawing").uncheck()
    assert colour(pen, 0, 0) == before
    pen.get_by_label("Show the drawing").check()
    # the rubber takes the part away, and leaves the lines
    pen.get_by_role("radio", name="Rubber").check()
    drag(pen, (0, 0))
    drawn(studio, searched, 4)
    assert colour(pen, 0, 0) == before


def test_sizes_and_the_other_side(pen: Any, studio: RunningStudio, searched: str) -> None:
    pen.get_by_label("Size of the brush").fill("0.08")
    pen.get_by_label("The same on the other side").check()
    pen.get_by_role("radio", name="Blue").check()
    drag(pen, (-8, 0), (8, 0))
    one, other = drawn(studio, searched, 2)["strokes"]
    assert one["width"] == other["width"]
    size = shapely.Polygon(json.loads(BOOT)).area ** 0.5
    assert one["width"] == pytest.approx(0.08 * size, rel=0.1)
    sums = [a[0] + b[0] for a, b in zip(one["points"], other["points"], strict=True)]
    assert max(sums) - min(sums) < 0.01 * size
    assert [p[1] for p in one["points"]] == [p[1] for p in other["points"]]
    pen.get_by_label("The same on the other side").uncheck()
    pen.get_by_role("radio", name="Eye").check()
    for value in ("0.03", "0.09"):
        pen.get_by_label("Size of an eye").fill(value)
        drag(pen, (0, -20))
    eyes = drawn(studio, searched, 2, 2)["eyes"]
    assert eyes[1][2] == pytest.approx(3 * eyes[0][2], rel=0.02)


def test_what_is_filled_reaches_into_sharp_tips(page: Any) -> None:
    ring = [[0, 0], [100, 0], [0, 9]]
    page.goto("/")
    rings = page.evaluate(
        """async (polygon) => {
            const { partAround } = await import("/js/closeup/bucket.js");
            const { pathOf } = await import("/drawing/js/tiling.js");
            return partAround({ polygon, path: pathOf(polygon) }, [], [10, 4]);
        }""",
        ring,
    )
    tile = shapely.Polygon(ring)
    assert tile.difference(shapely.Polygon(rings[0])).area < 1e-3 * tile.area


def test_shape_is_chosen_and_opened(page: Any, studio: RunningStudio) -> None:
    page.goto("/")
    page.get_by_role("button", name="A shape that fits").click()
    page.wait_for_selector(".shapes a")
    assert page.locator(".shapes a").count() == len(CLASSES)
    assert serious_issues(page) == []
    page.get_by_text("All other types").click()
    page.wait_for_selector("[data-shape=IH93]")
    assert page.locator(".shapes a").count() == len(ISOHEDRAL_TYPES)
    page.locator("[data-shape=IH4]").click()
    page.wait_for_url("**/t/*")
    page.wait_for_selector(".closeup-canvas")
    own = page.url.split("/p/")[1].split("/")[0]
    first = studio.project(own)["tiles"][0]
    assert first["class_name"] == "IH4"
    page.get_by_role("radio", name="Pull", exact=True).check()
    page.wait_for_selector("[data-ready=pull]")
    page.locator(".closeup-canvas").focus()
    for key in ("ArrowRight", "Shift+ArrowUp", "Shift+ArrowUp", "Shift+ArrowUp", "Enter"):
        page.keyboard.press(key)
    page.wait_for_url(lambda url: not url.endswith(f"/{first['id']}"))
    assert len(studio.project(own)["tiles"]) == 2
    pulled_url, pull = page.url, int(page.url.rsplit("/", 1)[1])
    page.get_by_role("button", name="Lay the copies another way").click()
    page.locator("li[title^='IH5,'] button").click()
    page.wait_for_url(lambda url: url != pulled_url)
    last = int(page.url.rsplit("/", 1)[1])
    assert {card["id"]: card["class_name"] for card in studio.project(own)["tiles"]}[last] == "IH5"
    page.wait_for_selector("[data-ready=pull]")  # nothing is still asked of what goes now
    notes = [studio.client.get(f"projects/{own}/tiles/{k}").json()["notes"] for k in (last, pull)]
    assert not any("silhouette" in text for text in [*notes[0], *notes[1]])  # there was none
    page.goto(f"/#/p/{own}")
    page.get_by_text("1 tile and 2 pulled versions. Each one covers the plane").wait_for()
    assert page.locator(".stars").inner_text() == page.locator(".word").inner_text() == ""
    for words in ("Search", "More like this"):
        assert not page.get_by_role("button", name=words).is_visible()
    assert not page.get_by_text("How long").is_visible()
    page.get_by_role("link", name="Picture").click()
    page.get_by_role("button", name="Choose a picture").wait_for()
    studio.client.delete(f"projects/{own}").raise_for_status()
