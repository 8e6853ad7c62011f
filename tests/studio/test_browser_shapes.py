"""Begin with a shape that fits: each type is shown, opens as a tile, and is pulled."""

from typing import Any

from orbiflow.tiles import CLASSES, ISOHEDRAL_TYPES
from studio.browser import RunningStudio
from studio_checks import serious_issues


def test_shape_is_chosen_and_opened(page: Any, studio: RunningStudio) -> None:
    page.goto("/")
    page.get_by_role("button", name="A shape that fits").click()
    page.wait_for_selector(".shapes a")
    assert page.locator(".shapes a").count() == len(CLASSES)
    serious_issues(page)
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
    page.locator(".shapes button", has_text="IH5 ·").click()
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
