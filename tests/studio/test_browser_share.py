"""What is shared and taken away of a tile, in a real browser: pages opened from a disk, and offers."""

import base64
import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from PIL import Image

from artworks import EYE, size_of, squirrel
from bent_tiles import bent_tile
from exported import tile_of
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import ignore
from orbiflow.studio.project_file import write_project
from orbiflow.studio.tile_files import put_tile
from orbiflow.tiles import (
    ISOHEDRAL_TYPES,
    EscherTile,
    ExportSettings,
    Tiling,
    colouring,
    export,
    tiling_json,
)
from orbiflow.tiles.write import write_scene
from studio.browser import RunningStudio
from studio_checks import serious_issues

MOST_BYTES = 60_000  # of a page beside its pictures
WIDE, HIGH = 700, 500
COPIES = """async ([tiles, width, height]) => {
  const { Camera, Tiling } = await import("/drawing/js/tiling.js");
  return tiles.map((tile) => {
    const tiling = new Tiling(tile);
    const camera = Camera.fit(tiling, width, height, 6);
    return tiling.copies(camera, width, height).map(({ matrix, colour, figure }) =>
      [matrix, colour, figure]);
  });
}"""


def placed(ring: Any, matrix: Any) -> shapely.Polygon:
    """Return where a canvas matrix takes a polygon."""
    a, b, c, d, e, f = matrix
    return shapely.Polygon(np.asarray(ring) @ np.array([[a, b], [c, d]]) + (e, f))


def check_colours(
    found: list[shapely.Polygon], colours: Sequence[Any], width: int, height: int
) -> None:
    """Assert that tiles cover a canvas once, and that those that share an edge differ in colour."""
    window = shapely.box(0, 0, width, height)
    assert shapely.union_all(found, grid_size=1e-6).area >= 0.999 * window.area
    inside = shapely.intersection(found, window)
    assert shapely.area(inside).sum() == pytest.approx(window.area, rel=2e-3)
    shared = 0
    for k, j in shapely.STRtree(found).query(found, "dwithin", 0.05).T.tolist():
        if k < j and (found[k].buffer(0.05) & found[j].buffer(0.05)).area > 0.5:
            shared += 1
            assert colours[k] != colours[j]
    assert shared > 20


def test_every_type_is_coloured_as_in_the_library(page: Any) -> None:
    tilings = [Tiling(own.group(), [own.template()]) for own in ISOHEDRAL_TYPES.values()]
    told = [tiling_json(own, colouring(own), y_down=True) for own in tilings]
    page.goto("/")
    shown = page.evaluate(COPIES, [told, WIDE, HIGH])
    assert len(shown) == 81
    for own, tile, copies in zip(tilings, told, shown, strict=True):
        found = [placed(tile["polygon"], matrix) for matrix, _, _ in copies]
        colours = [colour for _, colour, _ in copies]
        check_colours(found, colours, WIDE, HIGH)
        assert set(colours) == set(range(colouring(own).count))


@pytest.fixture(name="alone")
def alone_fixture(browser: Any) -> Iterator[Any]:
    """A page in a browser without a network, on which nothing may go wrong."""
    context = browser.new_context(offline=True, viewport={"width": 900, "height": 640})
    own, wrong = context.new_page(), list[str]()
    own.on("pageerror", lambda error: wrong.append(str(error)))
    own.on("console", lambda said: said.type == "error" and wrong.append(said.text))
    near = ("file:", "data:", "blob:")
    own.on("request", lambda asked: asked.url.startswith(near) or wrong.append(asked.url))
    yield own
    context.close()
    assert wrong == []


def opened(page: Any, file: Path) -> None:
    page.goto(file.as_uri())
    page.wait_for_selector("#colours input")
    page.wait_for_timeout(50)


def drawing(page: Any) -> tuple[list[shapely.Polygon], list[str]]:
    """Return the tiles, and the colour of each, of the SVG that the page saves."""
    with page.expect_download() as waited:
        page.click("#svg")
    text = waited.value.path().read_text("utf-8")
    symbols = dict(re.findall(r'<g id="(\w+)"><polygon points="([^"]+)"', text))
    fills = dict(re.findall(r'<g id="(\w+)"><polygon [^>]*?fill="(#\w+)"', text))
    rings = {name: [p.split(",") for p in own.split()] for name, own in symbols.items()}
    uses = re.findall(r'<use href="#(\w+)" transform="matrix\(([^)]+)\)"', text)
    matrices = [[float(v) for v in matrix.split()] for _, matrix in uses]
    found = [
        placed(np.array(rings[own], float), m) for (own, _), m in zip(uses, matrices, strict=True)
    ]
    return found, [fills[name] for name, _ in uses]


@pytest.mark.parametrize("name", ["IH1", "IH5", "IH21"])
def test_page_of_each_class_opens_from_a_disk(alone: Any, tmp_path: Path, name: str) -> None:
    out = tmp_path / "tile.html"
    export(tile_of(name), out, ExportSettings(purpose="share"))
    assert out.stat().st_size < MOST_BYTES
    opened(alone, out)
    check_colours(*drawing(alone), 900, 640)


def opened_tile(page: Any, folder: Path, settings: ExportSettings | None = None) -> None:
    """Export a tile as a page and open it."""
    export(tile_of("IH4"), folder / "tile.html", settings or ExportSettings())
    opened(page, folder / "tile.html")


def test_page_is_moved_far_coloured_anew_and_turned(alone: Any, tmp_path: Path) -> None:
    opened_tile(alone, tmp_path)
    before = drawing(alone)
    alone.locator("#view").focus()
    for _ in range(120):
        alone.keyboard.press("ArrowLeft")
    alone.locator("#turn").fill("30")
    alone.mouse.move(300, 300)
    alone.mouse.wheel(0, 300)
    alone.click("#order")
    after = drawing(alone)
    check_colours(*after, 900, 640)
    assert set(after[1]) != set(before[1])
    alone.locator("#colours input").first.fill("#ff0000")
    assert "#ff0000" in drawing(alone)[1]
    alone.click("#again")
    assert drawing(alone)[1] == before[1]
    assert serious_issues(alone) == []


def test_picture_and_eyes_are_in_the_file_and_can_be_hidden(alone: Any, tmp_path: Path) -> None:
    tile, picture, out = squirrel("IH4"), tmp_path / "picture.png", tmp_path / "tile.html"
    Image.new("RGB", size_of(tile), "#d02020").save(picture)
    export(tile, out, ExportSettings(tint=0.0, outline=0, eyes=(EYE,)), picture=picture)
    text = out.read_text("utf-8")
    pictures = re.findall(r"data:image/webp;base64,[^\"]+", text)
    assert len(pictures) == 1
    assert len(text) - sum(map(len, pictures)) < MOST_BYTES
    opened(alone, out)
    assert reddish(alone) > 0.9
    alone.uncheck("#skin")
    alone.wait_for_timeout(60)
    assert reddish(alone) == 0


def reddish(page: Any) -> float:
    """Return the share of the canvas that is as red as the picture."""
    return page.locator("#view").evaluate("""(canvas) => {
      const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
      let count = 0;
      for (let k = 0; k < data.length; k += 4) {
        count += Math.abs(data[k] - 0xd0) < 20 && data[k + 1] < 60 && data[k + 2] < 60;
      }
      return (4 * count) / data.length;
    }""")


def test_engraved_lines_are_on_the_page_and_can_be_hidden(alone: Any, tmp_path: Path) -> None:
    opened_tile(alone, tmp_path, ExportSettings(engrave=True, outline=0))
    shown = "document.querySelector('#view').toDataURL()"
    alone.uncheck("#skin")
    alone.evaluate("new Promise((r) => requestAnimationFrame(() => requestAnimationFrame(r)))")
    plain = alone.evaluate(shown)
    alone.check("#skin")
    alone.wait_for_function(f"plain => {shown} !== plain", arg=plain)
    engraved = picture_of(alone.evaluate(shown))
    assert 0.05 < (np.abs(engraved - picture_of(plain)).max(axis=-1) > 30).mean() < 0.8


def picture_of(address: str) -> np.ndarray:
    """Return the pixels of a picture in an address."""
    data = base64.b64decode(address.partition(",")[2])
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)


def test_pinch_zooms_and_a_finger_moves(alone: Any, tmp_path: Path) -> None:
    opened_tile(alone, tmp_path)
    first = len(drawing(alone)[0])
    alone.evaluate("""() => {
      const canvas = document.getElementById("view");
      canvas.setPointerCapture = () => {};
      const touch = (kind, pointerId, clientX, clientY) => canvas.dispatchEvent(
        new PointerEvent(kind, { pointerId, clientX, clientY, pointerType: "touch" }));
      touch("pointerdown", 1, 300, 300);
      touch("pointerdown", 2, 340, 300);
      touch("pointermove", 2, 500, 300);
      touch("pointerup", 1, 300, 300);
      touch("pointerup", 2, 500, 300);
    }""")
    assert len(drawing(alone)[0]) < first / 4


def test_what_users_wrote_is_escaped(alone: Any, tmp_path: Path) -> None:
    evil = "</script><script>console.log('evil')</script><b>&"
    out = tmp_path / "tile.html"
    made = export(tile_of("IH4"), out)
    scene = replace(made.scenes[0], title=evil)
    out.write_text(str(write_scene(scene, "html")), "utf-8")
    opened(alone, out)
    assert alone.title() == evil
    assert alone.locator("b").count() == 0
    drawing(alone)


def test_prints_the_tiling_alone(browser: Any, tmp_path: Path) -> None:
    pdfium = pytest.importorskip("pypdfium2")
    page = browser.new_page(viewport={"width": 900, "height": 640})
    opened_tile(page, tmp_path, ExportSettings(palette="delft"))
    document = pdfium.PdfDocument(page.pdf(format="A4"))
    page.close()
    assert len(document) == 1
    assert document[0].get_textpage().get_text_bounded().strip() == ""  # no controls
    pixels = np.asarray(document[0].render(scale=0.5).to_pil().convert("RGB"))
    inner = pixels[20:-40, 20:-20].reshape(-1, 3)
    assert (inner.min(axis=1) > 250).mean() < 0.02  # all of the sheet is filled


def test_lines_alone_are_no_page(tmp_path: Path) -> None:
    with pytest.raises(OrbiflowError, match="html is a page with all tiles"):
        export(tile_of("IH4"), tmp_path / "cut.html", ExportSettings(cut="pieces"))
    with pytest.raises(OrbiflowError, match="has no edge"):
        export(tile_of("IH4"), tmp_path / "cut.html", ExportSettings(bed=(100, 100)))


GRANTED = ["clipboard-read", "clipboard-write"]


@pytest.fixture(name="taking")
def taking_fixture(page: Any, studio: RunningStudio, searched: str) -> Any:
    """The page where a tile is taken away."""
    page.context.grant_permissions(GRANTED)
    page.goto(f"/#/p/{searched}/take/{studio.project(searched)['tiles'][0]['id']}")
    page.wait_for_selector(".share")
    return page


def clipboard(page: Any) -> str:
    return page.evaluate("navigator.clipboard.readText()")


def test_copied_link_opens_the_tile_in_a_studio(taking, studio, searched) -> None:
    taking.get_by_role("button", name="Copy link").click()
    taking.get_by_text("without your picture and what you drew").wait_for()
    link = clipboard(taking)
    assert link.startswith(f"{studio.address}/#/open/")
    taking.goto("about:blank")
    taking.goto(link)
    taking.wait_for_url("**/t/*")
    taking.wait_for_selector(".closeup-canvas")
    opened = taking.url.split("/p/")[1].split("/")[0]
    assert opened != searched
    given, got = (studio.project(own)["tiles"][0] for own in (searched, opened))
    assert got["certified"]
    assert np.allclose(got["polygon"], given["polygon"], atol=1e-4)
    taking.goto("about:blank")  # nothing is still asked of what goes now
    studio.client.delete(f"projects/{opened}").raise_for_status()


def test_damaged_link_is_said_in_words(page: Any) -> None:
    page.goto("/#/open/abcd")
    page.get_by_text("The link is damaged or cut off").wait_for()
    page.wrong.clear()  # the refusal is what is wanted


@pytest.fixture(name="project")
def project_fixture(studio: RunningStudio, tmp_path: Path) -> dict[str, Any]:
    """A project with eight tiles, of which one goes to a sphere."""
    every = ["IH6", "IH4", "IH2", "IH1", "IH3", "IH5", "IH28", "IH4"]
    for place, name in enumerate(every):
        put_tile(tmp_path, 7000 + place, "final", EscherTile(bent_tile(name, 40.0)), ignore)
    tiles = [{"id": 7000 + place, "parent": None} for place in range(len(every))]
    document = {"name": "eight", "kind": "tile", "view": {}, "tiles": tiles}
    empty = {"input": None, "reading": {}, "second": None}
    write_project(tmp_path, {**document, **empty}, tmp_path / "eight.orbiflow")
    content = (tmp_path / "eight.orbiflow").read_bytes()
    return studio.client.post("projects/open", content=content).json()


def value(page: Any, name: str) -> str:
    return page.locator(f"[name={name}]").input_value()


def test_the_tile_that_can_is_one_click_away(page: Any, project: dict[str, Any]) -> None:
    able = next(own for own in project["tiles"] if own["class_name"] == "IH28")
    page.goto(f"/#/p/{project['id']}/take/{project['tiles'][0]['id']}")
    page.locator("label", has_text="Picture").click()
    offered = page.locator("[name=world] option")
    offered.first.wait_for(state="attached")
    assert "sphere" not in [own.get_attribute("value") for own in offered.all()]
    page.get_by_role("link", name="Take a tile that can").click()
    page.wait_for_url(f"**/take/{able['id']}")
    page.locator("[name=world] option[value=sphere]").wait_for(state="attached")
    assert value(page, "world") == "sphere"
    page.evaluate("document.querySelectorAll('.form details').forEach((own) => (own.open = true))")
    size = page.locator("[name=tile_size]")
    assert not size.is_visible()
    page.select_option("[name=world]", "")
    assert size.is_visible()


def test_back_leads_to_the_place_and_to_what_was_chosen(page: Any, project: dict[str, Any]) -> None:
    page.goto(f"/#/p/{project['id']}")
    card = page.locator(".card a.open").nth(6)
    card.scroll_into_view_if_needed()
    top, place = page.evaluate("scrollY"), card.get_attribute("href")
    assert top > 0
    card.click()
    page.wait_for_url(f"**/{place}")
    page.wait_for_selector("h1:focus")
    assert page.evaluate("scrollY") == 0
    page.go_back()
    page.wait_for_selector(f'a[href="{place}"]:focus')
    assert page.evaluate("scrollY") == pytest.approx(top, abs=2)
    page.goto(f"/#/p/{project['id']}/take/{project['tiles'][0]['id']}")
    page.get_by_role("radio", name="Print or cut").check()
    page.select_option("[name=purpose]", "stickers")
    page.locator("[name=tile_size]").fill("33")
    page.locator("[name=tile_size]").blur()
    page.goto(f"/#/p/{project['id']}")
    page.wait_for_selector(".card")
    page.go_back()
    page.wait_for_selector(".form")
    assert (value(page, "purpose"), value(page, "tile_size")) == ("stickers", "33")


def test_weak_tiles_and_those_like_a_better_one_are_folded_away(
    page: Any, project: dict[str, Any]
) -> None:
    stars = [4, 3, 2, 1.5, 1, 2, 1, 3]
    ids = [own["id"] for own in project["tiles"]]

    def rated(route: Any) -> None:
        shown = route.fetch().json()
        for own in shown["tiles"]:
            place = ids.index(own["id"])
            own |= {"stars": stars[place], "like": ids[0] if place == 7 else None}
        route.fulfill(json=shown)

    page.route(f"**/api/projects/{project['id']}", rated)
    page.goto(f"/#/p/{project['id']}")
    page.wait_for_selector(".card")
    seen = page.locator(".card:visible")
    assert [own.get_attribute("data-tile") for own in seen.all()] == [str(own) for own in ids[:2]]
    page.locator("summary", has_text=re.compile("^6 ")).click()
    assert seen.count() == 8
    page.unroute(f"**/api/projects/{project['id']}")
