"""The pages of the search and of what is taken away, in a real browser."""

import re
from typing import Any

import numpy as np
import pytest

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


def asked_for(page: Any) -> dict[str, Any]:
    """Return the settings with which a page asks for what it is to make; nothing is made."""
    page.route("**/tasks", lambda route: route.fulfill(status=422, json={"error": "not now"}))
    with page.expect_request("**/tasks") as caught:
        page.get_by_role("button", name="Download").click()
    page.get_by_text("not now").wait_for()
    page.unroute("**/tasks")
    return caught.value.post_data_json["settings"]


def taking(page: Any, studio: RunningStudio, own: str) -> int:
    """Go to where the first tile of a project is taken away; return its number."""
    tile = studio.project(own)["tiles"][0]["id"]
    page.goto(f"/#/p/{own}/take/{tile}")
    return tile


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
    page.get_by_role("radio", name="Print or cut").press("Space")
    reach(page, "What is it for?", "Poster")
    reach(page, "Kind of file", "SVG")
    with page.expect_download() as caught:
        reach(page, "Download")
    page.get_by_role("link", name=re.compile("^beast")).first.wait_for()
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


def test_two_tabs_and_a_reload_in_the_middle(page, studio: RunningStudio) -> None:
    from playwright.sync_api import expect

    own = studio.with_picture()
    other = page.context.new_page()
    other.goto(f"/#/p/{own}")
    other.wait_for_selector(".cards", state="attached")
    page.bring_to_front()  # a browser draws no frames for a page behind another
    small_searches(page, "IH1", "IH4")
    page.goto(f"/#/p/{own}/picture")
    page.get_by_role("button", name="Find tiles").click()
    other.wait_for_selector(CARD)
    page.reload()
    page.wait_for_selector(f"{DONE} >> nth=1")
    other.wait_for_selector(f"{DONE} >> nth=1")
    names = [tab.locator(f"{CARD} .lies").all_inner_texts() for tab in (page, other)]
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
        page = browser.new_page(reduced_motion="reduce")
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


def test_tiles_of_an_outline_since_changed_are_marked_and_searched_anew(page, studio) -> None:
    own = studio.with_tiles()
    small_searches(page, "IH4")
    page.goto(f"/#/p/{own}")
    page.wait_for_selector(CARD)
    new, old = page.locator(f"ul:not(details ul) > {CARD}"), page.locator(f"details {CARD}")
    assert (new.count(), page.locator("details:visible").count()) == (1, 0)
    studio.client.put(f"projects/{own}/reading", json={"smooth": 0.05})
    page.locator("summary", has_text="changed the picture").wait_for()
    assert (new.count(), old.count()) == (0, 1)
    page.get_by_role("button", name=re.compile("^Search")).click()
    page.wait_for_selector("ul:not(details ul) > .card[data-stage=final]")
    assert (new.count(), old.count()) == (1, 1)


def test_pulled_versions_of_a_tile_are_on_its_card(page, studio: RunningStudio) -> None:
    own = studio.with_tiles()
    (first,) = (tile["id"] for tile in studio.project(own)["tiles"])

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
    searched = studio.with_tiles()
    small_searches(page, "IH4")
    page.goto(f"/#/p/{searched}")
    page.wait_for_selector(CARD)
    with page.expect_request("**/tasks") as caught:
        page.get_by_role("button", name=re.compile("^More like this")).first.click()
    first = studio.project(searched)["tiles"][0]["id"]
    assert caught.value.post_data_json["settings"]["like"] == first
    page.get_by_role("button", name="Stop").click()
    page.get_by_role("button", name="Search again").wait_for()


def test_each_thing_has_three_fields_and_its_own_settings(page, studio, searched) -> None:
    tile = taking(page, studio, searched)
    fields = page.locator(".form > .field:not([hidden])")
    page.wait_for_selector(".form")
    titles = {}
    for thing in page.locator(".wishes > .choice label").all_inner_texts()[:-3]:
        if thing == "Ball or lamp":
            continue  # which this tile cannot be
        before = page.locator(".form").element_handle()
        page.get_by_role("radio", name=thing).check()
        page.wait_for_function("form => !form.isConnected", arg=before)
        titles[thing] = fields.locator("label").all_inner_texts()
        assert 1 <= len(titles[thing]) <= 3, thing
    assert len(titles) == 12
    page.get_by_role("radio", name="Ball or lamp").check()
    page.locator(".wishes").get_by_text("no pattern on a sphere").wait_for()
    assert page.get_by_role("button", name="Download").count() == 0
    page.get_by_role("radio", name="Pieces for a laser").check()
    page.get_by_label("Width of the machine's cut").fill("0.2")
    page.get_by_role("radio", name="Poster").check()
    page.get_by_role("radio", name="Pieces for a laser").check()
    wanted = {"tile": tile, "purpose": "laser", "cut": "pieces", "kerf": 0.2}
    assert asked_for(page) == wanted


def test_what_does_not_apply_cannot_be_set(page, studio: RunningStudio, searched) -> None:
    studio.client.patch(f"projects/{searched}", json={"view": {"look": {"palette": "dusk"}}})
    tile = taking(page, studio, searched)
    page.get_by_role("radio", name="Print or cut").check()
    page.locator(".form summary").click()
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
    wanted = {"tile": tile, "purpose": "web", "clip": False, "palette": "dusk"}
    assert asked_for(page) == wanted
    assert drawn.input_value() == "none"
    assert not page.get_by_label("Width of the machine's cut").is_visible()
    assert page.get_by_label("Colours").input_value() == "dusk"
    page.get_by_label("What is it for?").select_option("laser")
    assert not page.get_by_label("Colours").is_visible()
    page.get_by_label("What is it for?").select_option("")
    page.get_by_label("What is drawn").select_option("pieces")
    page.get_by_label("Width of the machine's cut").fill("0.2")
    page.get_by_label("How long is one tile?").fill("much")
    page.get_by_role("button", name="Download").click()
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
    page.get_by_role("radio", name="Print or cut").check()
    wide = "parseFloat(document.querySelector('.true-tile').style.width)"
    page.wait_for_selector(".true-tile[style*=width]")
    first = page.evaluate(wide)
    assert first >= 40 * lying[0] / long - 0.1  # the rectangle may be wider
    page.get_by_label("How long is one tile?").fill("60")
    page.keyboard.press("Tab")
    assert page.evaluate(wide) == pytest.approx(1.5 * first, abs=0.1)
    width, height = 60 * lying / long
    said = page.locator(".real").inner_text()
    assert f"{width:.1f} × {height:.1f} mm as it lies" in said
    assert "60.0 ×" in said
    assert "neck" not in said  # only a disc as wide as all of it fits in
    page.get_by_role("radio", name="3D print").check()
    page.get_by_label("What kind of thing?").select_option("cutter")
    assert page.get_by_label("thinner than").input_value() == "5"
    assert page.get_by_label("How long is one tile?").input_value() == "80"


def test_pages_are_for_everyone(page, studio: RunningStudio, searched) -> None:
    tile = studio.project(searched)["tiles"][0]["id"]
    for path, ready in ((f"/#/p/{searched}", CARD), (f"/#/p/{searched}/take/{tile}", ".form")):
        page.set_viewport_size({"width": 1280, "height": 900})
        page.goto(path)
        page.wait_for_selector(ready)
        for closed in page.locator("summary:visible").all():
            closed.click()
        assert serious_issues(page) == []
        page.set_viewport_size({"width": 360, "height": 700})
        assert untidy_parts(page) == []


def test_machines_are_kept_by_name_and_lengths_shown_in_inches(page, studio, searched) -> None:
    tile = taking(page, studio, searched)
    page.get_by_role("radio", name="Pieces for a laser").check()
    kerf = page.get_by_label("Width of the machine's cut")
    kerf.fill("0.2")
    page.get_by_role("button", name="Keep these settings").click()
    page.get_by_label("Its name").fill("my K40")
    page.get_by_role("button", name="Keep", exact=True).click()
    page.get_by_role("radio", name="Jigsaw").check()
    page.reload()
    page.get_by_role("radio", name="Pieces for a laser").check()
    machine = page.get_by_label("Machine and material")
    machine.select_option("my K40")
    assert kerf.input_value() == "0.2"
    page.get_by_role("radio", name="inches").check()
    size = page.get_by_label("How long is one tile? (in)")
    assert size.input_value() == "1.575"
    size.fill("2")
    page.get_by_label("How large is your sheet? (in)").fill("12x8")
    wanted = {"tile": tile, "purpose": "laser", "cut": "pieces", "kerf": 0.2, "tile_size": 50.8}
    wanted |= {"area": "12x8in"}
    assert asked_for(page) == wanted
    page.get_by_role("button", name="Forget it").click()
    machine.locator("option", has_text="my K40").wait_for(state="detached")


def test_a_machine_is_chosen_only_in_the_form_that_has_its_settings(page, studio, searched) -> None:
    from playwright.sync_api import expect

    taking(page, studio, searched)
    machine, laser = page.get_by_label("Machine and material"), "Pieces for a laser"
    page.get_by_role("radio", name=laser).check()
    page.get_by_label("Width of the machine").fill("0.2")
    page.get_by_role("button", name="Keep these settings").click()
    page.get_by_label("Its name").fill("my  K40")
    page.get_by_role("button", name="Keep", exact=True).click()
    for thing, chosen in ((laser, "my K40"), ("Jigsaw", ""), (laser, "my K40")):
        page.get_by_role("radio", name=thing).check()
        expect(machine).to_have_value(chosen)
    taking(page, studio, studio.with_tiles())
    page.get_by_role("radio", name=laser).check()
    expect(machine.get_by_role("option", name="my K40")).to_be_attached()
    assert machine.input_value() == ""
