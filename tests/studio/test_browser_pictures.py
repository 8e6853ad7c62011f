"""The user's own picture on the tiles: on cards, close up and in what is taken away, tinted alike."""

import io
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageDraw

from studio.browser import RunningStudio

RED, BLUE = (200, 60, 40), (40, 60, 200)  # green is the same in all that mixes them
CANVAS = ".closeup-canvas"
OUTLINE = [(30, 40), (170, 30), (180, 110), (130, 120), (130, 180), (70, 180), (75, 120), (30, 110)]
MIDDLE_PIXELS = """(canvas, side) => {
    const [x, y] = [canvas.width / 2 - side / 2, canvas.height / 2 - side / 2].map(Math.round);
    return [...canvas.getContext("2d").getImageData(x, y, side, side).data];
}"""


def picture_of(*colours: tuple[int, int, int]) -> bytes:
    """Return a picture of a shape on white, its left half in one colour and the right in another."""
    picture = Image.new("RGB", (240, 210), "white")
    mask = Image.new("L", picture.size)
    ImageDraw.Draw(mask).polygon(OUTLINE, fill=255)
    halves = Image.new("RGB", picture.size, colours[0])
    halves.paste(colours[-1], (105, 0, 240, 210))
    picture.paste(halves, mask=mask)
    file = io.BytesIO()
    picture.save(file, "PNG")
    return file.getvalue()


@pytest.fixture(scope="module", name="coloured")
def coloured_fixture(studio: RunningStudio) -> str:
    """A project with a coloured picture and tiles of one class."""
    own = studio.with_picture(picture_of(RED, BLUE), "beast.png")
    studio.search(own, "IH4")
    assert studio.found(own)
    return own


@pytest.fixture(name="tile")
def tile_fixture(studio: RunningStudio, coloured: str) -> Iterator[int]:
    """The best tile of that project, whose look is as it came."""
    yield studio.project(coloured)["tiles"][0]["id"]
    studio.client.patch(f"projects/{coloured}", json={"view": {"look": {}}})


def pixels(page: Any, selector: str, side: int = 60) -> np.ndarray:
    """Return what a canvas shows in its middle, (N, 3)."""
    found = page.locator(selector).first.evaluate(MIDDLE_PIXELS, side)
    return np.array(found).reshape(-1, 4)[:, :3]


def shows_picture(page: Any, selector: str) -> bool:
    """Return whether nearly all that a canvas shows in its middle is of the picture, untinted."""
    own = pixels(page, selector)
    return bool((abs(own[:, 1] - 60) <= 3).mean() > 0.7)


def close_up(page: Any, project: str, tile: int, **look: Any) -> None:
    """Show a tile close up, with a look that was chosen before."""
    page.goto("/")
    page.evaluate(
        """async ([project, look]) => fetch(`api/projects/${project}`, {
            method: "PATCH",
            headers: {"X-Orbiflow": "1", "Content-Type": "application/json"},
            body: JSON.stringify({ view: { look } }),
        })""",
        [project, look],
    )
    page.goto(f"/#/p/{project}/t/{tile}")
    page.wait_for_selector(".badge[data-kind=proved]")
    page.wait_for_timeout(200)


def test_what_is_added_of_the_background_is_no_colour(studio: RunningStudio) -> None:
    plain = studio.with_picture(picture_of((20, 20, 20)), "black.png")
    size = [studio.project(plain)["silhouette"][name] for name in ("width", "height")]
    mask, file = Image.new("LA", size), io.BytesIO()
    ImageDraw.Draw(mask).rectangle((100, 60, size[0] - 30, 100), fill=(255, 255))
    mask.save(file, "PNG")
    before = studio.project(plain)["silhouette"]["mark"]
    studio.client.put(f"projects/{plain}/mend", content=file.getvalue()).raise_for_status()
    studio.until(lambda: studio.project(plain)["silhouette"]["mark"] != before)
    assert studio.project(plain)["silhouette"]["coloured"] is False


def test_it_is_there_by_default_and_no_seam_shows(browser, studio, coloured, tile) -> None:
    for ratio in (1, 1.5):
        size = {"viewport": {"width": 700, "height": 500}, "device_scale_factor": ratio}
        context = browser.new_context(base_url=studio.address, reduced_motion="reduce", **size)
        own = context.new_page()
        close_up(own, coloured, tile, tint=0)
        assert own.get_by_label("Show my picture on the tiles").is_checked()
        for zoom in range(5):
            shown = pixels(own, CANVAS)
            assert (abs(shown[:, 1] - 60) > 2).mean() < (0.3 if zoom < 2 else 1e-9)
            own.get_by_role("button", name="Nearer").click()
            own.wait_for_timeout(120)
        context.close()


def test_one_look_for_all_pages(page: Any, studio: RunningStudio, coloured: str, tile: int) -> None:
    close_up(page, coloured, tile)
    page.get_by_role("radio", name="lagoon").check()
    page.get_by_label("Colour over it").fill("0")
    page.goto(f"/#/p/{coloured}")
    page.wait_for_selector(".card canvas")
    assert page.get_by_label("Colours", exact=True).input_value() == "lagoon"
    studio.until(lambda: page.wait_for_timeout(50) or shows_picture(page, ".card canvas"))
    page.goto(f"/#/p/{coloured}/take/{tile}")
    page.get_by_role("radio", name="Print or cut").check()
    assert page.get_by_label("Colours", exact=True).input_value() == "lagoon"
    assert page.get_by_label("With your picture").is_checked()
    page.get_by_label("Colours", exact=True).select_option("earth")
    page.get_by_label("With your picture").uncheck()
    page.goto(f"/#/p/{coloured}/t/{tile}")
    page.wait_for_selector(".badge[data-kind=proved]")
    assert page.get_by_role("radio", name="earth").is_checked()
    assert not page.get_by_label("Show my picture on the tiles").is_checked()


def test_a_preview_follows_each_setting(page: Any, coloured: str, tile: int) -> None:
    page.goto(f"/#/p/{coloured}/take/{tile}")
    page.get_by_role("radio", name="Print or cut").check()
    image = page.locator(".live img")
    image.wait_for()

    def changed(deed: Any) -> str:
        before = image.get_attribute("src")
        deed()
        page.wait_for_function("old => document.querySelector('.live img').src !== old", arg=before)
        return image.get_attribute("src")

    picture = page.get_by_label("With your picture")
    plain = changed(lambda: picture.uncheck())
    assert changed(lambda: picture.check()) != plain
    purpose = page.get_by_label("What is it for?")
    changed(lambda: purpose.select_option("laser"))
    assert not picture.is_checked()  # it would be engraved
    changed(lambda: purpose.select_option("print"))
    assert picture.is_checked()
    page.get_by_label("How long is one tile?").fill("99999")
    page.get_by_label("How long is one tile?").press("Tab")
    page.get_by_text("must be above 0 and at most 20000").wait_for()
    size = page.get_by_label("How long is one tile?")
    assert size.evaluate("box => box !== document.activeElement")
    changed(lambda: page.get_by_role("radio", name="Film").check())
    page.get_by_text("One moment of the animation").wait_for()
    page.wrong[:] = [said for said in page.wrong if "422" not in said]
