"""Two animals in one tiling, in a real browser: a second picture, and the pages of a tile of both."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from orbiflow.arrays import Array
from orbiflow.drawing import PALETTES
from orbiflow.runtime import ignore
from orbiflow.studio.project_file import write_project
from orbiflow.studio.tile_files import put_tile
from orbiflow.studio.tile_view import tile_card
from orbiflow.symmetry import Isometry
from orbiflow.tiles import EscherTile, colouring
from outlines import FOLDER
from small_pairs import NAMES, pair_result
from studio.browser import RunningStudio
from studio.test_browser_start import READ, begun
from studio_checks import serious_issues, untidy_parts

PLACE = """async (address) => {
    const { Camera, Tiling } = await import("/drawing/js/tiling.js");
    const [view, space] = await Promise.all(
        ["", "/space"].map(async (end) => (await fetch(address + end)).json()));
    const { x, y, width, height } = document.querySelector(".closeup-canvas").getBoundingClientRect();
    const [a, b, c, d, e, f] = Camera.fit(new Tiling(view), width, height, 4).matrix(width, height);
    const inner = space.polygon.slice(space.outer);
    const [u, v] = inner[inner.length >> 1];
    return [x + a * u + c * v + e, y + b * u + d * v + f];
}"""


def whole(matrix: list[float]) -> Array:
    """Return a matrix of a canvas in homogeneous coordinates."""
    return np.array([matrix[0::2], matrix[1::2], [0, 0, 1]])


@pytest.fixture(scope="module", name="pair")
def pair_fixture() -> EscherTile:
    return pair_result().tiles[0]


@pytest.fixture(name="project")
def project_fixture(studio: RunningStudio, pair: EscherTile, tmp_path: Path) -> dict[str, Any]:
    """A project of two pictures with a tile of both."""
    inputs = dict(zip(("input.dat", "input-2.dat"), NAMES, strict=True))
    for file, name in inputs.items():
        (tmp_path / file).write_bytes((FOLDER / name).read_bytes())
    put_tile(tmp_path, 7000, "final", pair, ignore)
    one, two = ({"input": {"name": name}, "reading": {}} for name in inputs.values())
    tiles = [{"id": 7000, "parent": None}]
    document = {"name": "both", "kind": "tile", "view": {}, "tiles": tiles, **one, "second": two}
    write_project(tmp_path, document, tmp_path / "both.orbiflow")
    content = (tmp_path / "both.orbiflow").read_bytes()
    return studio.client.post("projects/open", content=content).json()


def test_a_second_picture_is_added_seen_and_taken_away(page, drawing, studio) -> None:
    own = begun(page, drawing)
    page.get_by_role("button", name="Add a second picture").click()
    page.get_by_role("dialog").get_by_role("button", name="Bat", exact=True).click()
    page.wait_for_url("**/picture/2")
    page.get_by_role("heading", name="Is this your second animal?").wait_for()
    page.wait_for_selector(READ)
    page.locator(".figures img >> nth=1").wait_for()
    assert studio.project(own)["second"]["input"]["name"] == "Bat.png"
    assert (untidy_parts(page, 1280, 360), serious_issues(page)) == ([], [])
    before = studio.project(own)["silhouette"]
    page.get_by_label("Smoothing").focus()
    for _ in range(12):
        page.keyboard.press("ArrowRight")
    studio.until(lambda: studio.project(own)["second"]["reading"]["smooth"])
    assert studio.project(own)["silhouette"] == before
    page.get_by_role("button", name="Take the second picture away").click()
    page.get_by_role("button", name="Take it away").click()
    page.get_by_role("heading", name="Is this your animal?").wait_for()
    page.get_by_role("button", name="Add a second picture").click()
    page.get_by_role("button", name="The same picture again").click()
    page.get_by_role("heading", name="Is this your second animal?").wait_for()
    assert studio.project(own)["second"]["silhouette"]["outline"] == before["outline"]


def test_a_pair_is_drawn_as_the_library_has_it(page, pair: EscherTile) -> None:
    page.goto("/")
    told = page.evaluate(
        """async (card) => {
            const { Camera, shaded, Tiling } = await import("/drawing/js/tiling.js");
            const tiling = new Tiling(card);
            const scale = 60 / Math.sqrt(tiling.area);
            const camera = new Camera({ ...tiling.middle, scale, turn: 0.3, yDown: false });
            const { palettes } = await (await fetch("/api/about")).json();
            return {
                copies: tiling.copies(camera, 300, 200),
                view: camera.matrix(300, 200),
                shades: palettes.map((own) => shaded(own, card.colours).colours),
            };
        }""",
        tile_card(pair, 1, "final"),
    )
    colours, tiling = colouring(pair.tiling), pair.tiling
    shares = [own.shaded(colours.shares).colours for own in PALETTES.values()]
    assert told["shades"] == [list(own) for own in shares]
    view, seen = whole(told["view"]), list[shapely.Polygon]()
    for copy in told["copies"]:
        matrix, figure = whole(copy["matrix"]), copy["figure"]
        polygon = tiling.prototiles[figure].polygon
        seen.append(shapely.Polygon(polygon @ matrix[:2, :2].T + matrix[:2, 2]))
        element = np.linalg.solve(view, matrix)
        isometry = Isometry(element[:2, :2], element[:2, 2])
        aspect, cell, _ = tiling.aspects.find(tiling.group, isometry, figure)
        assert (aspect, list(cell)) == (copy["aspect"], copy["cell"])
    window = shapely.box(0, 0, 300, 200)
    assert window.difference(shapely.union_all(seen, grid_size=1e-6)).area < 0.01


def test_both_figures_are_shown_pulled_drawn_on_and_taken_away(page, project, studio) -> None:
    own, tile = project["id"], project["tiles"][0]["id"]
    page.goto(f"/#/p/{own}")
    page.locator(".card canvas").wait_for()
    names = [figure["name"] for figure in project["tiles"][0]["figures"]]
    stars = page.locator(".stars").first
    assert all(name[:9] in stars.inner_text() for name in names)
    assert all(name in stars.get_attribute("aria-label") for name in names)
    page.get_by_text("How long").wait_for()
    assert page.get_by_text("What counts").count() == 0
    page.goto(f"/#/p/{own}/t/{tile}")
    page.get_by_label("Show my pictures on the tiles").check()
    page.get_by_label("From your pictures to the tile").press("ArrowLeft")
    page.get_by_role("radio", name="Pull", exact=True).check()
    page.wait_for_selector("[data-ready=pull]")
    x, y = page.evaluate(PLACE, f"/api/projects/{own}/tiles/{tile}")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 8, y + 5, steps=4)
    page.mouse.up()
    page.wait_for_url(lambda url: not url.endswith(f"/{tile}"))
    page.wait_for_selector(".badge[data-kind=proved]")
    page.get_by_role("radio", name="Draw", exact=True).check()
    page.get_by_role("radio", name="Eye", exact=True).check()
    for step in (-20, 20):  # to both sides of the path
        page.mouse.click(x + step, y + step)
        page.mouse.click(x + step, y - step)

    def both() -> bool:
        drawn = studio.project(own)["view"].get("drawing", {})
        return bool(drawn.get("eyes") and drawn.get("second", {}).get("eyes"))

    studio.until(both)
    page.get_by_role("link", name="Take away").click()
    page.get_by_label("With what you drew on it").wait_for()
    page.get_by_text("the larger one").wait_for()
    page.get_by_role("button", name="Download").click()
    page.locator(".preview img").wait_for()
