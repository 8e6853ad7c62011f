"""The first page and the page of the picture, in a real browser."""

import io
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from studio.browser import RunningStudio, area_of, small_searches
from studio_checks import serious_issues, untidy_parts

ONE_PAGE = True
STATIC = Path(__file__).parents[2] / "src" / "orbiflow" / "studio" / "static"
READ = ".stage:not([hidden])"
SETTLED = "canvas.reading[aria-busy=false]"


def own_project(page: Any) -> str:
    """Return the id of the project that a page shows."""
    page.wait_for_url("**/#/p/**")
    return page.url.split("/p/")[1].split("/")[0]


def begun(page: Any, drawing: Path) -> str:
    """Choose a picture on the first page and wait until it is read."""
    page.goto("/")
    page.set_input_files("#file", drawing)
    page.wait_for_selector(READ)
    page.wait_for_selector(SETTLED)
    return own_project(page)


def stroke(page: Any, canvas: str, *points: tuple[float, float]) -> None:
    """Draw a line on a canvas, through points given as shares of its size."""
    page.locator(canvas).scroll_into_view_if_needed()
    box = page.locator(canvas).bounding_box()
    for k, (x, y) in enumerate(points):
        page.mouse.move(box["x"] + x * box["width"], box["y"] + y * box["height"], steps=4)
        if k == 0:
            page.mouse.down()
    page.mouse.up()


def test_what_was_read_is_shown_and_sliders_read_anew(page, drawing, studio) -> None:
    own = begun(page, drawing)
    assert "1 part is left out" in page.locator(".said").inner_text()
    assert page.locator("h1").inner_text() == "Is this your animal?"
    assert studio.project(own)["name"] == "beast"
    before = studio.project(own)["silhouette"]["outline"]
    page.get_by_label("Smoothing").focus()
    for _ in range(12):
        page.keyboard.press("ArrowRight")
    studio.until(lambda: abs(studio.project(own)["reading"]["smooth"] - 0.024) < 1e-9)
    studio.until(lambda: studio.project(own)["silhouette"]["outline"] != before)
    page.get_by_label("Where it ends").focus()
    page.keyboard.press("ArrowRight")
    studio.until(lambda: studio.project(own)["reading"]["threshold"] == 0.51)
    page.get_by_role("radio", name="light").press("Space")  # a click may miss what an answer moves
    studio.until(lambda: studio.project(own)["reading"]["invert"] is True)


def test_a_drawing_is_shown_in_its_colours_in_its_place(page, studio: RunningStudio) -> None:
    body = '<path fill="#c03020" d="M30 40h120v80h-120z"/>'
    body += '<circle fill="#20a040" cx="60" cy="70" r="15"/>'
    head = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="10 20 200 160">'
    own = studio.with_picture(f"{head}{body}</svg>".encode(), "house.svg")
    assert studio.project(own)["silhouette"]["coloured"]
    assert not studio.project(studio.with_picture())["silhouette"]["coloured"]
    page.goto(f"/#/p/{own}/picture")
    page.wait_for_selector(SETTLED)
    seen = """([x, y]) => {
        const canvas = document.querySelector("canvas.reading");
        const scale = canvas.width / 200;
        const context = canvas.getContext("2d");
        return [...context.getImageData((x - 10) * scale, (y - 20) * scale, 1, 1).data];
    }"""
    red, green, _, _ = page.evaluate(seen, [120, 100])
    assert red > 2 * green
    red, green, _, _ = page.evaluate(seen, [60, 70])
    assert green > 2 * red
    assert min(page.evaluate(seen, [190, 160])) > 250


def test_thin_legs_are_said_and_grown_by_a_button(page, studio: RunningStudio) -> None:
    ends = [(40, 60), (20, 160), (380, 60), (380, 160)]
    legs = "".join(f"M200 200L{x} {y}" for x, y in ends)
    body = '<circle cx="200" cy="200" r="50"/>'
    drawing = f'<path d="{legs}" stroke="black" stroke-width="4"/>{body}'
    head = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 400 400">'
    own = studio.with_picture(f"{head}{drawing}</svg>".encode(), "spider.svg")
    page.goto(f"/#/p/{own}/picture")
    before = studio.project(own)["silhouette"]
    assert "let them grow (Thin parts) by" in before["doubts"][0]
    page.get_by_role("button", name="Make thin parts thicker").click()
    studio.until(lambda: studio.project(own)["reading"].get("thicken") == 0.04)
    studio.until(lambda: not (studio.project(own)["silhouette"] or before)["doubts"])
    page.get_by_text("at least 4 % wide").wait_for()


def test_painting_mends_the_shape_and_can_be_undone(page, drawing, studio: RunningStudio) -> None:
    own = begun(page, drawing)
    before = area_of(studio.project(own))
    page.get_by_role("radio", name="Remove").check()
    page.get_by_role("radio", name="lasso").check()
    stroke(page, "canvas.reading", (0.3, 0.68), (0.6, 0.68), (0.6, 0.97), (0.3, 0.97))
    studio.until(lambda: area_of(studio.project(own)) < 0.95 * before)
    page.keyboard.press("Control+z")
    studio.until(lambda: area_of(studio.project(own)) == pytest.approx(before))
    page.get_by_role("radio", name="Add").check()
    page.get_by_role("radio", name="brush").check()
    stroke(page, "canvas.reading", (0.7, 0.3), (0.9, 0.16))
    studio.until(lambda: area_of(studio.project(own)) > 1.02 * before)
    page.reload()  # what was painted is still there to go on with
    page.wait_for_selector(READ)
    assert studio.project(own)["mend"]


def test_two_tabs_paint_on_one_picture(page, drawing, studio: RunningStudio) -> None:
    own = begun(page, drawing)
    whole = area_of(studio.project(own))
    other = page.context.new_page()
    other.goto(page.url)
    other.wait_for_selector(READ)
    seen = "() => document.querySelector('canvas.reading').toDataURL()"
    before = other.evaluate(seen)
    page.bring_to_front()  # a browser draws no frames for a page behind another
    page.get_by_role("radio", name="Remove").check()
    page.get_by_role("radio", name="lasso").check()
    stroke(page, "canvas.reading", (0.3, 0.68), (0.6, 0.68), (0.6, 0.97), (0.3, 0.97))
    studio.until(lambda: area_of(studio.project(own)) < 0.95 * whole)  # a leg is gone
    cut = area_of(studio.project(own))
    studio.until(lambda: other.wait_for_timeout(50) or other.evaluate(seen) != before)
    other.wait_for_selector(READ)
    other.bring_to_front()
    other.get_by_role("radio", name="Add").check()
    stroke(other, "canvas.reading", (0.7, 0.3), (0.9, 0.16))
    studio.until(lambda: area_of(studio.project(own)) > 1.02 * cut)
    assert area_of(studio.project(own)) < 0.98 * whole
    other.close()


def test_marks_are_kept_and_only_on_the_animal(page, drawing, studio: RunningStudio) -> None:
    own = begun(page, drawing)
    page.get_by_role("radio", name="Keep its shape").check()
    stroke(page, "canvas.reading", (0.95, 0.9), (0.97, 0.95))
    said = page.locator(".said .error", has_text="Keep its shape")
    said.wait_for()
    page.get_by_role("button", name="Find tiles").click()
    page.locator(".toast.bad", has_text="Keep its shape").wait_for()
    assert "picture" in page.url
    page.get_by_role("button", name="Undo").click()
    said.wait_for(state="detached")
    studio.until(lambda: studio.project(own)["pins"] is None)
    stroke(page, "canvas.reading", (0.2, 0.3), (0.3, 0.4))
    studio.until(lambda: studio.project(own)["pins"])
    page.get_by_role("button", name="Undo").click()
    studio.until(lambda: studio.project(own)["pins"] is None)


def test_sliders_and_starting_over_can_be_undone_and_done_again(page, drawing, studio) -> None:
    own = begun(page, drawing)
    page.get_by_role("radio", name="Matters most").check()
    stroke(page, "canvas.reading", (0.2, 0.3), (0.3, 0.4))
    page.get_by_label("Smoothing").focus()
    for _ in range(5):
        page.keyboard.press("ArrowRight")
    studio.until(lambda: studio.project(own)["reading"]["smooth"] == 0.01)
    page.get_by_role("button", name="Start over").click()
    studio.until(lambda: not studio.project(own)["emphasis"])
    studio.until(lambda: studio.project(own)["reading"]["smooth"] == 0)
    undo = page.get_by_role("button", name="Undo")
    undo.click()
    studio.until(lambda: studio.project(own)["emphasis"])
    studio.until(lambda: studio.project(own)["reading"]["smooth"] == 0.01)
    assert page.get_by_label("Smoothing").input_value() == "0.01"
    undo.click()  # the slider went in one go
    studio.until(lambda: studio.project(own)["reading"]["smooth"] == 0)
    assert studio.project(own)["emphasis"]
    undo.click()
    studio.until(lambda: not studio.project(own)["emphasis"])
    assert undo.is_disabled()
    page.keyboard.press("Control+y")
    studio.until(lambda: studio.project(own)["emphasis"])


def test_what_is_painted_while_the_picture_is_nearer_is_where_it_was_painted(
    page, drawing, studio: RunningStudio
) -> None:
    own = begun(page, drawing)
    canvas = page.locator("canvas.reading")
    box = canvas.bounding_box()
    page.mouse.move(box["x"] + 0.2 * box["width"], box["y"] + 0.3 * box["height"])
    page.mouse.wheel(0, -600)  # what is under the mouse stays there
    page.get_by_role("radio", name="Keep its shape").check()
    stroke(page, "canvas.reading", (0.2, 0.3))
    address = studio.until(lambda: studio.project(own)["pins"])
    mask = Image.open(io.BytesIO(studio.client.get(f"{studio.address}{address}").content))
    white = np.argwhere(np.asarray(mask.convert("L")) > 127)
    (upper, left), (lower, right) = white.min(axis=0), white.max(axis=0) + 1
    assert (left + right) / 2 == pytest.approx(0.2 * mask.width, abs=2)
    assert (upper + lower) / 2 == pytest.approx(0.3 * mask.height, abs=2)
    assert right - left < 0.75 * 0.04 * mask.width  # the nearer, the finer
    near = canvas.evaluate("canvas => canvas.toDataURL()")
    page.get_by_role("button", name="Fit").click()
    assert canvas.evaluate("canvas => canvas.toDataURL()") != near
    canvas.focus()
    for key in ("+", "0"):
        page.keyboard.press(key)


@pytest.mark.parametrize("how", ["mouse", "keyboard"])
def test_a_shape_can_be_drawn_and_is_searched_for_at_once(page, studio, how) -> None:
    small_searches(page, "IH4")
    page.goto("/")
    page.get_by_role("button", name="Draw a shape").click()
    sheet = "dialog canvas"
    if how == "mouse":
        stroke(page, sheet, (0.2, 0.2), (0.8, 0.3), (0.7, 0.8), (0.5, 0.5), (0.3, 0.8))
    else:
        page.focus(sheet)
        keys = ["Space", *["Shift+ArrowRight"] * 4, *["Shift+ArrowDown"] * 4]
        for key in [*keys, *["Shift+ArrowLeft"] * 6, "Space"]:
            page.keyboard.press(key)
    page.get_by_role("button", name="Use this shape").click()
    page.get_by_role("heading", name="Tiles").wait_for()
    own = studio.project(own_project(page))
    assert area_of(own) > 10_000
    assert own["tasks"][0]["operation"] == "search"


def test_a_page_that_was_left_while_it_came_is_not_waited_for(page, studio: RunningStudio) -> None:
    own, held = studio.with_picture(), list[Any]()
    page.goto("/")
    page.wait_for_selector(".drop")
    page.route(f"**/api/projects/{own}", lambda route: held.append(route))
    with page.expect_request(f"**/api/projects/{own}"):
        page.evaluate(f"location.hash = '#/p/{own}/picture'")
    page.evaluate("location.hash = '#/none'")
    heading = page.get_by_role("heading", name="This page cannot be shown")
    heading.wait_for()
    page.evaluate("new Promise((done) => setTimeout(done, 350))")  # after the other's patience
    assert heading.is_visible()
    for route in held:
        route.continue_()


def test_pictures_are_dropped_and_pasted(page, drawing) -> None:
    for event, holder in (("drop", "dataTransfer"), ("paste", "clipboardData")):
        page.goto("/#/")
        page.wait_for_selector(".drop")
        page.evaluate(
            """([event, holder, bytes]) => {
                const files = new DataTransfer();
                files.items.add(new File([new Uint8Array(bytes)], "beast.png", { type: "image/png" }));
                const given = new Event(event, { bubbles: true, cancelable: true });
                Object.defineProperty(given, holder, { value: files });
                document.body.dispatchEvent(given);
            }""",
            [event, holder, list(drawing.read_bytes())],
        )
        page.wait_for_selector(READ)


def test_what_cannot_be_read_is_refused_in_words_where_it_was_chosen(
    page, studio, tmp_path
) -> None:
    before = studio.client.get("projects").json()
    Image.new("L", (90, 90), 255).save(tmp_path / "white.png")
    (tmp_path / "notes.png").write_bytes(b"this is no picture")
    (tmp_path / "old.orbiflow").write_bytes(b"this is no project")
    page.goto("/")
    saved = "input[accept='.orbiflow']"
    files = [("#file", "notes.png"), ("#file", "white.png"), (saved, "old.orbiflow")]
    for field, name in files * 2:  # each may be chosen again
        page.set_input_files(field, tmp_path / name)
        said = "not a project" if field == saved else name
        page.locator(".drop .told .error").filter(has_text=said).wait_for()
        assert "Reading" not in page.locator("#page").inner_text()
    assert page.url.endswith(("/", "#/"))
    assert studio.client.get("projects").json() == before


def test_a_picture_that_failed_before_says_so_and_leads_back(page, studio) -> None:
    own = studio.client.post("projects", json={"kind": "tile"}).json()["id"]
    studio.client.put(f"projects/{own}/input?name=notes.png", content=b"this is no picture")
    studio.until(lambda: studio.project(own)["tasks"][0]["state"] == "failed")
    page.goto(f"/#/p/{own}/picture")
    page.get_by_text("notes.png").wait_for()
    assert "Reading" not in page.locator("#page").inner_text()
    assert not page.get_by_role("button", name="Find tiles").is_visible()
    page.get_by_role("button", name="Choose another picture").click()
    page.wait_for_selector(".drop")
    assert studio.client.get(f"projects/{own}").status_code == 404


def test_an_animal_is_taken_by_keyboard_and_the_project_renamed(page, studio) -> None:
    small_searches(page, "IH4")
    page.goto("/")
    page.locator(".animal").first.press("Enter")
    page.get_by_role("heading", name="Tiles").wait_for()
    own = own_project(page)
    page.get_by_label("Name of the project").fill("My beast")
    studio.until(lambda: studio.project(own)["name"] == "My beast")
    page.goto("/#/")
    page.get_by_role("button", name="Rename My beast").click()
    page.get_by_label("Its name").fill("Your beast")
    page.keyboard.press("Enter")
    page.get_by_role("link", name="Your beast").wait_for()
    assert studio.project(own)["name"] == "Your beast"


def test_a_project_is_deleted_when_the_page_is_left_unless_that_is_taken_back(page, studio) -> None:
    def there(own: str) -> bool:
        return studio.client.get(f"projects/{own}").status_code == 200

    own, other = (studio.with_picture(name=f"{name}.json") for name in ("keep me", "drop me"))
    page.goto("/")
    for name in ("keep me", "drop me"):
        page.get_by_role("button", name=f"Delete {name}", exact=True).click()
    assert there(own)
    assert there(other)
    page.locator(".gone", has_text="keep me").get_by_role("button", name="Undo").click()
    page.get_by_role("link", name="keep me").click()
    page.wait_for_selector(READ)
    studio.until(lambda: not there(other))
    assert there(own)
    page.goto("/#/")
    page.get_by_role("button", name="Delete keep me", exact=True).click()
    page.reload()
    studio.until(lambda: not there(own))


def test_no_table_no_project(page, studio: RunningStudio) -> None:
    count = len(studio.client.get("projects").json())
    page.goto("/")
    page.get_by_role("button", name="Numbers instead of animals").click()
    page.get_by_text("Drop a table here").wait_for()
    page.go_back()
    page.get_by_role("heading", name="Turn an animal into a tile").wait_for()
    studio.until(lambda: len(studio.client.get("projects").json()) == count)


def test_pages_are_for_everyone(page, studio: RunningStudio) -> None:
    own = studio.with_picture()
    for path, ready in (("/", ".project"), (f"/#/p/{own}/picture", READ)):
        page.set_viewport_size({"width": 1280, "height": 900})
        page.goto(path)
        page.wait_for_selector(ready)
        assert serious_issues(page) == []
        page.set_viewport_size({"width": 360, "height": 700})
        assert untidy_parts(page) == []
    page.goto("/")
    page.get_by_role("button", name="Draw a shape").click()
    assert serious_issues(page) == []


def test_pages_are_light(studio: RunningStudio) -> None:
    """What a browser fetches of all pages together."""
    total = 0
    for file in filter(Path.is_file, STATIC.rglob("*")):
        where = f"{studio.address}/{file.relative_to(STATIC).as_posix()}"
        with studio.client.stream("GET", where, headers={"Accept-Encoding": "gzip"}) as answer:
            assert answer.status_code == 200
            total += len(b"".join(answer.iter_raw()))
    assert total < 165_000
    assert sum(file.stat().st_size for file in STATIC.rglob("*") if file.is_file()) < 417_000


def test_icons_that_buttons_name_are_drawn() -> None:
    """A name that `icons.svg` lacks would show nothing, without an error."""
    scripts = "".join(file.read_text() for file in STATIC.rglob("*.js"))
    named = re.findall(r'(?:icon\(|image: |printed\("[\w ]+", |solid\("[\w ]+", )"(\w+)"', scripts)
    drawn = re.findall(r'<path id="(\w+)"', (STATIC / "icons.svg").read_text())
    assert len(set(named)) > 20
    assert not set(named) - set(drawn)


def test_faults_are_found(page: Any) -> None:
    page.goto("/")
    page.wait_for_selector(".drop")
    assert untidy_parts(page) == []
    page.evaluate(
        """() => {
            const [one, other, third] = document.querySelectorAll(".drop .button");
            one.style.minWidth = "3000px";
            other.style.overflow = third.style.overflow = "hidden";
            other.style.width = "20px";
            third.style.marginLeft = "-30px";
        }"""
    )
    found = " ".join(untidy_parts(page))
    for fault in ("beyond the window", "cut off", "one over another", "wider than the window"):
        assert fault in found
