"""The page of a mesh in a real browser: from a mesh to a solid that fills space, and to files."""

import re
from pathlib import Path
from typing import Any

import pytest
from manifold3d import Manifold

from orbiflow.solids.bodies import as_mesh
from solids.mesh_files import obj
from studio.browser import RunningStudio
from studio_checks import serious_issues, untidy_parts


def beast() -> bytes:
    """A ball with two legs."""
    body = Manifold.sphere(20, 16)
    for x in (-9, 9):
        body += Manifold.cube((8, 10, 24)).translate((x - 4, -5, -30))
    return obj(as_mesh(body))


@pytest.fixture(scope="module", name="made")
def made_fixture() -> list[str]:
    """The address of the page that the first test makes, for the others."""
    return []


def test_from_a_mesh_to_a_solid_and_a_file(page: Any, made: list[str]) -> None:
    page.goto("/")
    mesh = {"name": "beast.obj", "mimeType": "model/obj", "buffer": beast()}
    page.set_input_files("input[accept*='.stl']", mesh)
    page.get_by_role("button", name="Find solids").wait_for()
    page.wait_for_selector(".turned canvas[aria-label^='beast: ']")
    page.get_by_role("radio", name="z", exact=True).check()
    page.get_by_role("radio", name="Quick").check()
    page.locator(".wishes").get_by_text("More", exact=True).click()
    page.get_by_label("A part that matters most").fill("nowhere")
    page.get_by_role("button", name="Find solids").click()
    page.get_by_role("alert").get_by_text("is neither a sphere nor painted").wait_for()
    page.get_by_label("A part that matters most").fill("")
    page.get_by_label("Space groups").fill("P-1, P21")
    assert untidy_parts(page, 1440, 360, 1280) == []
    assert serious_issues(page) == []
    page.get_by_role("button", name="Find solids").click()
    page.get_by_role("button", name="Pause").wait_for()
    page.reload()
    page.get_by_role("button", name="Stop").wait_for()
    page.get_by_text(re.compile("solids?, best first")).wait_for()
    made.append(page.url)
    with page.expect_download() as caught:
        page.get_by_role("button", name="Download").click()
    assert caught.value.suggested_filename == "beast-tile.3mf"
    assert caught.value.path().read_bytes()[:2] == b"PK"
    with page.expect_download() as caught:
        page.get_by_role("link", name="Page that turns it").click()
    assert "showStack" in Path(caught.value.path()).read_text()


def test_it_is_turned_and_opened_by_keys_and_fits_a_phone(page: Any, made: list[str]) -> None:
    if not made:
        pytest.skip("no solid was made")
    page.set_viewport_size({"width": 360, "height": 700})
    page.emulate_media(color_scheme="dark")
    page.goto(made[0])
    canvas = page.locator(".turned canvas[aria-label*='stack']")
    canvas.focus()
    apart = page.get_by_role("slider", name="Apart")
    assert not page.get_by_label("Turn slowly").is_checked()  # less motion is asked for
    page.keyboard.press("]")
    assert apart.get_attribute("aria-valuetext") == "10 %"
    page.get_by_role("button", name="Open", exact=True).click()
    assert apart.get_attribute("aria-valuetext") == "100 %"
    page.get_by_role("radio", name="Figure").check()
    canvas.focus()
    page.keyboard.press("0")
    assert page.get_by_role("radio", name="Stack").is_checked()
    as_it_is = {"animations": "allow", "caret": "initial"}  # else it would need a style of its own
    before = canvas.screenshot(**as_it_is)
    page.keyboard.press("ArrowRight")
    page.wait_for_timeout(200)
    assert canvas.screenshot(**as_it_is) != before
    assert untidy_parts(page) == []
    assert serious_issues(page) == []
    page.locator(".solids a:not([aria-current])").first.press("Enter")
    page.wait_for_url("**/t/*")
    page.reload()
    shown = page.locator(".solids a[aria-current]")
    shown.wait_for()
    assert shown.get_attribute("href") == page.url.removeprefix(page.url.split("#")[0])
    several = page.locator(".solids li").count()
    page.locator(".solids li:has([aria-current]) button").click()
    page.get_by_role("button", name="Remove it").click()
    fewer = "few => document.querySelectorAll('.solids li').length === few"
    page.wait_for_function(fewer, arg=several - 1)
    assert shown.count() == 1


def test_what_cannot_be_read_is_said_on_the_first_page(page: Any, studio: RunningStudio) -> None:
    before = len(studio.client.get("projects").json())
    page.goto("/")
    sheet = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    mesh = {"name": "sheet.obj", "mimeType": "model/obj", "buffer": sheet}
    page.set_input_files("input[accept*='.stl']", mesh)
    said = page.locator(".told .error")
    said.wait_for()
    assert said.inner_text().startswith("Sheet.obj") or "sheet.obj" in said.inner_text()
    assert len(studio.client.get("projects").json()) == before
