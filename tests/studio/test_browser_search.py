"""The pages of the search and of what is taken away, in a real browser."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
import shapely
from PIL import Image

from exported import tile_of
from orbiflow.arrays import Array
from orbiflow.studio.tile_view import tile_card
from orbiflow.symmetry import Isometry
from orbiflow.tiles import CLASSES, EscherTile, colouring, narrowest_neck
from orbiflow.tiles.page import longer_side
from studio.browser import RunningStudio, covers_page_once, running_studio, small_searches
from studio_checks import serious_issues, untidy_parts

CARD = ".card[data-tile]"
DONE = ".card[data-stage=final]"


def state(page: Any) -> str:
    """Return what a page says about its search."""
    return page.locator(".state-words").inner_text()


def reach(page: Any, name: str, typed: str = "") -> None:
    """Go on with the Tab key until an element is reached, by its label or words; then press Enter.

    With `typed`, choose the option of a list that begins so.
    """
    said = """() => { const own = document.activeElement;
        return own.getAttribute("aria-label") ?? own.labels?.[0]?.innerText ?? own.innerText; }"""
    for _ in range(100):
        page.keyboard.press("Tab")
        if (page.evaluate(said) or "").startswith(name):
            page.keyboard.type(typed) if typed else page.keyboard.press("Enter")
            return
    raise AssertionError(f"the Tab key never reaches {name}")


def test_keyboard_alone_leads_to_a_file_that_covers_its_page(page, drawing, tmp_path) -> None:
    small_searches(page, "IH4")
    page.goto("/")
    page.wait_for_selector("h1")
    with page.expect_file_chooser() as chooser:
        reach(page, "Choose a picture")
    chooser.value.set_files(drawing)
    page.wait_for_selector(".stage:not([hidden])")
    reach(page, "Find tiles")
    page.wait_for_selector(DONE)
    reach(page, "Take away:")
    page.wait_for_selector(".form")
    reach(page, "What is it for?", "Poster")
    reach(page, "Kind of file", "SVG")
    reach(page, "Make it")
    page.get_by_role("link", name=re.compile("^beast")).first.wait_for()
    page.focus("h1")
    with page.expect_download() as caught:
        reach(page, "beast")
    caught.value.save_as(tmp_path / "tiling.svg")
    assert covers_page_once((tmp_path / "tiling.svg").read_text())
    page.reload()
    page.locator(".made").get_by_text("Print or cut · Poster or mug").wait_for()


def test_a_search_is_paused_continued_and_stopped(page, studio: RunningStudio) -> None:
    own = studio.with_picture()
    page.goto(f"/#/p/{own}/picture")
    page.get_by_role("button", name="Find tiles").click()
    page.get_by_role("button", name="Pause").click()
    page.get_by_role("button", name="Go on").wait_for()
    assert state(page) == "Paused."
    page.get_by_role("button", name="Go on").click()
    page.wait_for_selector(CARD)
    page.get_by_role("button", name="Stop").click()
    page.get_by_role("button", name="Search again").wait_for()
    assert state(page) == "Stopped."
    assert page.locator(CARD).count() == len(studio.project(own)["tiles"])


def test_what_a_search_has_to_say_is_shown(page, studio: RunningStudio, tmp_path) -> None:
    own = studio.with_picture()
    size = [studio.project(own)["silhouette"][name] for name in ("width", "height")]
    pins = Image.new("L", size)
    pins.paste(255, (150, 200, 250, 300))  # far from the outline
    pins.save(tmp_path / "pins.png")
    studio.client.put(f"projects/{own}/pins", content=(tmp_path / "pins.png").read_bytes())
    small_searches(page, "IH4")
    page.goto(f"/#/p/{own}/picture")
    page.get_by_role("button", name="Find tiles").click()
    said = page.locator(".said-notes")
    said.get_by_text("keeps its shape there").wait_for()
    page.wait_for_selector(DONE)
    assert said.locator("li").count() == len(studio.project(own)["tasks"][0]["result"]["notes"])


def test_stop_stays_under_the_mouse_whatever_the_search_does(page, studio: RunningStudio) -> None:
    own = studio.with_picture()
    studio.search(own)
    task = studio.project(own)["tasks"][0]["id"]
    studio.client.post(f"tasks/{task}/pause")
    page.goto(f"/#/p/{own}")
    page.get_by_role("button", name="Go on").wait_for()
    stop = page.get_by_role("button", name="Stop")
    stop.hover()
    page.mouse.down()
    studio.client.post(f"tasks/{task}/resume")  # it waits, then runs
    page.get_by_role("button", name="Pause").wait_for()
    page.mouse.up()
    page.get_by_role("button", name="Search again").wait_for()
    assert state(page) == "Stopped."


def test_buttons_of_a_task_keep_their_places(page) -> None:
    page.goto("/")
    page.wait_for_selector(".drop")
    places = page.evaluate(
        """async () => {
            const { steering } = await import("/js/steering.js");
            const own = steering(null);
            document.querySelector("#page").prepend(own.root);
            return ["waiting", "running", "paused", "waiting"].map((state) => {
                own.update({ id: 1, state });
                return [...own.root.children].map((button) => {
                    const { x, y, width, height } = button.getBoundingClientRect();
                    return [button.textContent, button.disabled, x, y, width, height];
                });
            });
        }"""
    )
    assert [[name for name, *_ in state] for state in places] == [
        ["Pause", "Stop"], ["Pause", "Stop"], ["Go on", "Stop"], ["Pause", "Stop"]
    ]  # fmt: skip
    first = [place for _, *place in places[0]]
    assert all([place for _, *place in state] == first for state in places)


def test_two_tabs_and_a_reload_in_the_middle(page, studio: RunningStudio) -> None:
    from playwright.sync_api import expect

    own = studio.with_picture()
    other = page.context.new_page()
    other.goto(f"/#/p/{own}")
    other.wait_for_selector(".cards", state="attached")
    small_searches(page, "IH1", "IH4")
    page.goto(f"/#/p/{own}/picture")
    page.get_by_role("button", name="Find tiles").click()
    other.wait_for_selector(CARD)
    page.reload()
    page.wait_for_selector(f"{DONE} >> nth=1")
    other.wait_for_selector(f"{DONE} >> nth=1")
    names = [tab.locator(f"{CARD} .tag").all_inner_texts() for tab in (page, other)]
    assert names[0] == names[1]
    page.get_by_label("Name of the project").fill("Boots")
    expect(other.get_by_label("Name of the project")).to_have_value("Boots")


def test_a_tab_that_was_hidden_catches_up(page, studio: RunningStudio, searched) -> None:
    from playwright.sync_api import expect

    page.goto(f"/#/p/{searched}")
    page.wait_for_selector(CARD)
    hide = """(hidden) => {
        Object.defineProperty(document, "hidden", { value: hidden, configurable: true });
        document.dispatchEvent(new Event("visibilitychange"));
    }"""
    page.evaluate(hide, True)
    studio.client.patch(f"projects/{searched}", json={"name": "Renamed elsewhere"})
    assert page.get_by_label("Name of the project").input_value() != "Renamed elsewhere"
    page.evaluate(hide, False)
    expect(page.get_by_label("Name of the project")).to_have_value("Renamed elsewhere")


def test_a_server_that_was_killed_loses_nothing(browser, tmp_path) -> None:
    with running_studio(tmp_path) as studio:
        own = studio.with_picture()
        page = browser.new_page()
        page.set_default_timeout(120_000)
        page.goto(f"{studio.address}/#/p/{own}")
        page.wait_for_selector(".cards", state="attached")
        studio.search(own, "IH1")
        page.wait_for_selector(CARD)
        before = {card["id"] for card in studio.project(own)["tiles"]}
        studio.kill()
        page.get_by_text("The studio does not answer").wait_for()
        studio.start()
        page.get_by_text("The studio does not answer").wait_for(state="hidden")
        page.wait_for_selector(DONE)
        assert before <= {card["id"] for card in studio.found(own)}
        page.get_by_text("1 tile, best first").wait_for()
        page.close()


def test_how_long_a_search_takes_is_chosen_beside_its_button(page, studio: RunningStudio) -> None:
    own = studio.with_picture()
    page.goto(f"/#/p/{own}/picture")
    page.get_by_role("radio", name="Quick").check()
    with page.expect_request("**/tasks") as caught:
        page.get_by_role("button", name="Find tiles").click()
    assert caught.value.post_data_json["settings"]["effort"] == "fast"
    page.get_by_role("button", name="Stop").click()
    page.get_by_role("button", name="Search again").wait_for()
    assert page.get_by_role("radio", name="Quick").is_checked()


def test_tiles_of_an_opened_project_are_counted_though_none_were_searched(
    page, studio: RunningStudio
) -> None:
    own = studio.with_picture()
    studio.search(own, "IH4", "IH5")
    studio.found(own)
    saved = studio.client.get(f"projects/{own}/file").content
    opened = studio.client.post("projects/open", content=saved).json()["id"]
    page.goto(f"/#/p/{opened}")
    page.wait_for_selector(CARD)
    count = len(studio.project(opened)["tiles"])
    assert state(page).startswith(f"{count} tile")


def test_tiles_of_an_outline_since_changed_are_marked_and_searched_anew(
    page, studio: RunningStudio
) -> None:
    own = studio.with_picture()
    studio.search(own, "IH4")
    studio.found(own)
    small_searches(page, "IH4")
    page.goto(f"/#/p/{own}")
    page.wait_for_selector(CARD)
    new, old = page.locator(f"ul:not(details ul) > {CARD}"), page.locator(f"details {CARD}")
    assert (new.count(), page.locator("details:visible").count()) == (1, 0)
    studio.client.put(f"projects/{own}/reading", json={"smooth": 0.05})
    page.locator("summary", has_text="changed the picture").wait_for()
    assert (new.count(), old.count()) == (0, 1)
    page.get_by_role("button", name="Search again").click()
    page.wait_for_selector("ul:not(details ul) > .card[data-stage=final]")
    assert (new.count(), old.count()) == (1, 1)


def test_pulled_versions_of_a_tile_are_on_its_card(page, studio: RunningStudio) -> None:
    own = studio.with_picture()
    studio.search(own, "IH4")
    (first,) = (tile["id"] for tile in studio.found(own))

    def pull(tile: int) -> int:
        start = studio.client.get(f"projects/{own}/tiles/{tile}/space").json()["start"]
        pulled = f"projects/{own}/tiles/{tile}/by-hand/pull"
        return studio.client.post(pulled, json={"parameters": start}).json()["id"]

    second = pull(first)
    third = pull(second)
    page.goto(f"/#/p/{own}")
    page.wait_for_selector(CARD)
    assert page.locator(CARD).count() == 1
    assert state(page).startswith("1 tile and 2 pulled versions")
    card = page.locator(CARD)
    assert card.get_attribute("data-tile") == str(third)
    card.get_by_role("button", name="As found").click()
    assert card.get_attribute("data-tile") == str(first)
    assert card.get_by_role("link", name="Open").get_attribute("href").endswith(f"/t/{first}")
    (summary,) = (one for one in studio.client.get("projects").json() if one["id"] == own)
    assert summary["tiles"] == 1
    studio.client.delete(f"projects/{own}/tiles/{second}")  # what was pulled from it stays here
    page.get_by_text("1 tile and 1 pulled version,").wait_for()
    assert page.locator(CARD).count() == 1


def test_more_like_one_and_no_more_of_another(page, studio: RunningStudio) -> None:
    searched = studio.with_picture()
    studio.search(searched, "IH4")
    studio.found(searched)
    small_searches(page, "IH4")
    page.goto(f"/#/p/{searched}")
    page.wait_for_selector(CARD)
    with page.expect_request("**/tasks") as caught:
        page.get_by_role("button", name=re.compile("^More like this")).first.click()
    first = studio.project(searched)["tiles"][0]["id"]
    assert caught.value.post_data_json["settings"]["like"] == first
    page.get_by_role("button", name="Stop").click()
    page.get_by_role("button", name="Search again").wait_for()


def whole(matrix: list[float]) -> Array:
    """Return a matrix of a canvas in homogeneous coordinates."""
    return np.array([matrix[0::2], matrix[1::2], [0, 0, 1]])


def test_tilings_are_drawn_as_the_library_has_them(page) -> None:
    page.goto("/")
    for name in CLASSES:
        own = EscherTile(tile_of(name), name=name)
        told = page.evaluate(
            """async (card) => {
                const { Camera, Tiling } = await import("/js/tiling.js");
                const tiling = new Tiling(card);
                const camera = new Camera({ ...tiling.middle, scale: 9, turn: 0.3, yDown: false });
                const copies = tiling.copies(camera, 300, 200);
                return { copies, view: camera.matrix(300, 200) };
            }""",
            tile_card(own, 1, "final"),
        )
        view, colours, seen = whole(told["view"]), colouring(own.tile), list[shapely.Polygon]()
        for copy in told["copies"]:
            matrix = whole(copy["matrix"])
            seen.append(shapely.Polygon(own.tile.polygon @ matrix[:2, :2].T + matrix[:2, 2]))
            element = np.linalg.solve(view, matrix)
            assert copy["colour"] == colours.colour(Isometry(element[:2, :2], element[:2, 2]))
        window = shapely.box(0, 0, 300, 200)
        assert window.difference(shapely.union_all(seen, grid_size=1e-6)).area < 0.01


def test_what_does_not_apply_cannot_be_set(page, studio: RunningStudio, searched) -> None:
    tile = studio.project(searched)["tiles"][0]["id"]
    view = {"look": {"palette": "dusk"}}
    studio.client.patch(f"projects/{searched}", json={"view": view})
    page.goto(f"/#/p/{searched}/take/{tile}")
    page.get_by_text("Page and file").click()
    purpose, drawn = page.get_by_label("What is it for?"), page.get_by_label("What is drawn")
    filled, thin = page.get_by_label("Fill the page to its edge"), page.get_by_label("thinner than")
    assert (purpose.input_value(), drawn.input_value()) == ("print", "none")
    assert filled.is_checked()
    purpose.select_option("stickers")
    assert drawn.input_value() == "pieces"
    assert page.get_by_label("How large is the page?").input_value() == "210x297mm"
    purpose.select_option("laser")
    assert (drawn.input_value(), thin.input_value()) == ("skeleton", "1.5")
    assert not filled.is_checked()
    purpose.select_option("print")
    filled.uncheck()
    purpose.select_option("web")
    assert filled.is_checked()  # a purpose sets everything anew
    filled.uncheck()
    page.route("**/tasks", lambda route: route.fulfill(status=422, json={"error": "not now"}))
    with page.expect_request("**/tasks") as caught:
        page.get_by_role("button", name="Make it").click()
    page.get_by_text("not now").wait_for()
    page.unroute("**/tasks")
    wanted = {"tile": tile, "purpose": "web", "clip": False, "palette": "dusk"}
    assert caught.value.post_data_json["settings"] == wanted
    assert drawn.input_value() == "none"
    assert not page.get_by_label("Width of the machine's cut").is_visible()
    assert page.get_by_label("Colours").input_value() == "dusk"
    page.get_by_label("What is it for?").select_option("laser")
    assert not page.get_by_label("Colours").is_visible()
    page.get_by_label("What is it for?").select_option("")
    page.get_by_label("What is drawn").select_option("pieces")
    page.get_by_text("Pieces", exact=True).click()
    page.get_by_label("Width of the machine's cut").fill("0.2")
    page.get_by_label("How long is one tile?").fill("much")
    page.get_by_role("button", name="Make it").click()
    said = page.locator(".field .error")
    assert "The length of a tile: 'much' is not a length" in said.inner_text()
    size = page.get_by_label("How long is one tile?")
    assert size.get_attribute("aria-invalid") == "true"
    size.fill("30")
    said.wait_for(state="detached")


def test_the_true_size_is_of_the_file_and_follows_the_screen(page, studio, searched) -> None:
    card = studio.project(searched)["tiles"][0]
    ring = np.array(card["polygon"])
    long, lying = longer_side(ring), np.ptp(ring, axis=0)
    page.goto(f"/#/p/{searched}/take/{card['id']}")
    wide = "parseFloat(document.querySelector('.true-tile').style.width) - 4"
    page.wait_for_selector(".true-tile[style*=width]")
    first = page.evaluate(wide)
    assert first >= 40 * lying[0] / long * 96 / 25.4 - 0.1  # the rectangle may be wider
    page.get_by_label("How long is one tile?").fill("60")
    page.keyboard.press("Tab")
    assert page.evaluate(wide) == pytest.approx(1.5 * first, abs=0.1)
    width, height = 60 * lying / long
    said = page.locator(".real").inner_text()
    assert f"{width:.1f} × {height:.1f} mm as it lies" in said
    assert "60.0 ×" in said
    assert "neck" not in said  # only a disc as wide as all of it fits in
    page.get_by_role("button", name="Measure my screen").click()
    page.get_by_label(re.compile("bank card")).fill("5")
    assert page.evaluate(wide) == pytest.approx(1.5 * first * 5 / (96 / 25.4), abs=0.1)
    bank = page.locator(".bank-card").bounding_box()
    assert bank["width"] / bank["height"] == pytest.approx(85.6 / 53.98, rel=1e-2)
    page.get_by_role("radio", name="3D print").check()
    page.get_by_label("What kind of thing?").select_option("cutter")
    assert page.get_by_label("thinner than").input_value() == "5"
    assert page.get_by_label("How long is one tile?").input_value() == "80"


def test_a_neck_is_told_only_where_there_is_one(page) -> None:
    parts = [shapely.box(0, 0, 6, 6), shapely.box(5, 2, 12, 4), shapely.box(11, 0, 17, 6)]
    bone = shapely.get_coordinates(shapely.union_all(parts).boundary)[:-1]
    square = np.array([[0.0, 0.0], [6.0, 0.0], [6.0, 6.0], [0.0, 6.0]])
    page.goto("/")

    def said(ring: np.ndarray, limit: float) -> str:
        own = {"polygon": ring.tolist(), "neck": narrowest_neck(ring).ends.tolist(), "y_down": True}
        return page.evaluate(
            """async ([card, limit]) => {
                const { trueSize } = await import("/js/takeaway/truesize.js");
                const own = trueSize(card);
                document.body.append(own.root);
                own.show(34, limit);
                const text = own.root.innerText;
                own.root.remove();
                return text;
            }""",
            [own, limit],
        )

    assert "neck between two parts, in the circle, is 4.0 mm wide" in said(bone, 3.0)
    assert "Choose a longer tile" not in said(bone, 3.0)
    assert "Choose a longer tile" in said(bone, 5.0)
    assert "neck" not in said(square, 100.0)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_pages_are_for_everyone(page, studio: RunningStudio, searched, scheme) -> None:
    tile = studio.project(searched)["tiles"][0]["id"]
    page.emulate_media(color_scheme=scheme)
    for path, ready in ((f"/#/p/{searched}", CARD), (f"/#/p/{searched}/take/{tile}", ".form")):
        page.set_viewport_size({"width": 1280, "height": 900})
        page.goto(path)
        page.wait_for_selector(ready)
        for closed in page.locator("summary:visible").all():
            closed.click()
        assert serious_issues(page) == []
        page.set_viewport_size({"width": 360, "height": 700})
        assert untidy_parts(page) == []


def test_a_world_is_turned_in_a_page_of_its_own(
    page: Any, studio: RunningStudio, searched: str
) -> None:
    tile = studio.found(searched)[0]["id"]
    page.goto(f"/#/p/{searched}/take/{tile}")
    page.get_by_role("radio", name="Picture", exact=True).check(force=True)
    page.get_by_label("In another world?").select_option("disc")
    page.get_by_label("Kind of file").select_option("html")
    page.get_by_role("button", name="Make it").click()
    opened = page.get_by_role("link", name="Open")
    opened.wait_for()
    with page.context.expect_page() as found:
        opened.click()
    world = found.value
    world.wait_for_function("document.querySelector('#view').dataset.drawn")
    assert world.get_by_role("button", name="Fit").is_visible()
    world.close()
