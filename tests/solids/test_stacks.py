"""Stacks of copies, their pictures, and the page that turns them."""

import base64
import io
import json
import re
from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import label

from orbiflow.solids import Mesh, solid_gif, solid_sheet, stack_data, stack_page
from orbiflow.solids.bodies import as_body, common_volume, moved_body
from orbiflow.solids.pictures import figure_axes
from orbiflow.solids.stacks import copy_colour, lighter, stack_of
from orbiflow.solids.web_page import KINDS
from orbiflow.symmetry import CrystallographicGroup, Isometry
from solids.mesh_files import ball, box, bumpy_cell, cubic_group, space_tile


def with_a_ball(tile: Mesh | None = None) -> Any:
    """A tile that fills space, with a ball as its figure."""
    return space_tile(tile or bumpy_cell(steps=8), figure=ball(0.6, (0.5, 0.5, 0.5)))


def mirrored_cells() -> CrystallographicGroup:
    """Unit cubes, of which each second one along x is a mirror image."""
    mirror = Isometry(np.diag([-1.0, 1.0, 1.0]), np.zeros(3))
    return CrystallographicGroup.generate(np.diag([2.0, 1.0, 1.0]), [mirror], name="Pm")


@pytest.mark.parametrize("group", [cubic_group(), mirrored_cells()])
def test_a_stack_is_compact_does_not_overlap_and_has_colours(group: CrystallographicGroup) -> None:
    copies = stack_of(group, box(), 8)
    assert np.array_equal(copies[0].linear, np.eye(3))
    assert not copies[0].shift.any()
    bodies = [moved_body(as_body(box()), own.linear, own.shift) for own in copies]
    assert all(common_volume(a, b) < 1e-9 for k, a in enumerate(bodies) for b in bodies[:k])
    places = np.concatenate([np.reshape(b.bounding_box(), (2, 3)) for b in bodies])
    assert np.ptp(places, axis=0).round(9).tolist() == [2, 2, 2]
    again = stack_of(group, box(), 8)
    assert [own.shift.tolist() for own in again] == [own.shift.tolist() for own in copies]
    for own in copies:
        coset = group.cosets[own.coset]
        assert own.linear == pytest.approx(coset.linear)
        assert own.shift == pytest.approx(coset.translation + group.lattice @ own.cell)
        assert own.is_mirrored == (np.linalg.det(own.linear) < 0)
    for one, other in product(stack_of(group, box(), 27), repeat=2):  # side by side: other colours
        step = (one.linear - other.linear) @ np.full(3, 0.5) + one.shift - other.shift
        if np.abs(step).sum() == pytest.approx(1):
            assert copy_colour(group, one) != copy_colour(group, other)


def test_a_figure_is_seen_from_its_broad_side() -> None:
    axes = figure_axes(box(3, 1, 2))
    assert np.abs(axes) == pytest.approx(np.eye(3), abs=0.1)
    assert np.linalg.det(axes) == pytest.approx(1)
    assert np.abs(figure_axes(box(1, 1.2, 5))[:, 2]) == pytest.approx([0, 0, 1], abs=0.1)
    assert len(lighter(ball(segments=60), 400).faces) <= 400


def test_a_sheet_shows_figure_tile_and_stack() -> None:
    sheet = solid_sheet(with_a_ball(), width=400, copies=8)
    assert sheet.size == (400, 175)
    pixels = np.asarray(sheet, float)
    left, right = pixels[:, :225], pixels[:, 225:]
    assert 0.2 < (left < 240).any(axis=2).mean() < 0.8
    some = right[20:150:9, 20:150:9].reshape(-1, 3)
    hues = np.unique((some / some.max(axis=1, keepdims=True) * 3).round(), axis=0)
    assert len(hues) >= 4  # white, and the colours of four kinds of copies
    again = np.asarray(solid_sheet(with_a_ball(), width=400, copies=8), float)
    assert np.array_equal(again, pixels)


def test_a_film_opens_the_stack_and_closes_it() -> None:
    told = list[float]()
    content = solid_gif(with_a_ball(), size=80, frames=6, copies=8, progress=told.append)
    film: Any = Image.open(io.BytesIO(content))
    assert film.n_frames == 6
    assert film.info["loop"] == 0
    assert told == pytest.approx([k / 6 for k in range(1, 7)])
    seams = list[int]()
    for frame in (0, 3):
        film.seek(frame)
        seams.append(label(np.asarray(film.convert("RGB")).min(axis=2) > 250)[1])
    assert seams[0] == 1 < seams[1]  # one sees through it


def unpacked(text: str, kind: str) -> Any:
    return np.frombuffer(base64.b64decode(text), kind)


def test_what_a_page_draws() -> None:
    own = with_a_ball()
    data = stack_data(own, copies=8)
    assert len(data["copies"]) == 8
    mesh = data["meshes"]["tile"]
    points = unpacked(mesh["points"], "<f4").reshape(-1, 3)
    triangles = unpacked(mesh["triangles"], "<u4").reshape(-1, 3)
    assert Mesh(points, triangles).volume == pytest.approx(1, abs=1e-6)
    normals = unpacked(mesh["normals"], "i1").reshape(-1, 3)
    assert len(normals) == len(points)
    assert np.linalg.norm(normals, axis=1) == pytest.approx(127, abs=2)
    ball_ = data["balls"]["stack"]
    assert ball_["opened"] > ball_["radius"] > 1
    page = stack_page(own, title="A <cell>", copies=8)
    assert "<title>A &lt;cell&gt;</title>" in page
    assert not re.search(r"(src|href)=|https?://|@import", page)
    (text,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)
    assert json.loads(text)["copies"] == data["copies"]
    assert all(words in page for words in KINDS.values())
    assert page.count("position ") == 4


@pytest.fixture(scope="module", name="page")
def page_fixture(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """The page in a browser that draws WebGL by itself, for a reader who wants calm."""
    file = tmp_path_factory.mktemp("page") / "stack.html"
    file.write_text(stack_page(with_a_ball(), copies=8), "utf-8")
    size = {"width": 600, "height": 600}
    page = browser.new_page(viewport=size, reduced_motion="reduce", color_scheme="dark")
    wrong = list[str]()
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("console", lambda said: wrong.extend([said.text] * (said.type == "error")))
    page.on("request", lambda asked: wrong.extend({asked.url} - {file.as_uri()}))
    page.goto(file.as_uri())
    yield page
    page.close()
    assert wrong == []


def seen(page: Any) -> Any:
    page.wait_for_timeout(250)
    content = page.locator("canvas").screenshot()
    return np.asarray(Image.open(io.BytesIO(content)).convert("RGB"), float)


def test_a_page_is_turned_and_opened(page: Any) -> None:
    assert page.locator("#wrong").is_hidden()
    closed = seen(page)
    ground = closed[3, 300]
    assert ground.max() < 60  # dark, as the reader likes it
    drawn = np.abs(closed - ground).max(axis=2) > 30
    assert 0.1 < drawn.mean() < 0.7
    page.locator("#view").focus()
    page.keyboard.press("ArrowLeft")
    assert np.abs(seen(page) - closed).mean() > 1
    page.keyboard.press("0")
    assert np.abs(seen(page) - closed).mean() < 0.5
    page.get_by_role("button", name="Open").click()
    opened = seen(page)
    assert np.abs(opened - closed).mean() > 3
    assert page.get_by_label("Apart").input_value() == "100"
    page.get_by_role("button", name="Close").click()
    assert np.abs(seen(page) - closed).mean() < 0.5
    page.get_by_label("the tile").check()
    tile = seen(page)
    assert np.abs(tile - closed).mean() > 3
    page.get_by_label("Apart").fill("40")
    assert page.get_by_label("the stack").is_checked()
    box_ = page.locator("canvas").bounding_box()
    page.mouse.move(box_["x"] + 200, box_["y"] + 100)
    before = seen(page)
    page.mouse.down()
    page.mouse.move(box_["x"] + 260, box_["y"] + 130)
    page.mouse.up()
    assert np.abs(seen(page) - before).mean() > 1
    page.mouse.wheel(0, 400)
    drawn = np.abs(seen(page) - ground).max(axis=2) > 30
    assert drawn.mean() < 0.3
    page.get_by_role("button", name="Start again").click()
    assert np.abs(seen(page) - closed).mean() < 0.5


def test_a_page_has_no_barriers(page: Any) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    found = axe.Axe().run(page)
    assert [own["id"] for own in found.response["violations"]] == []


def test_pages_are_small() -> None:
    assert len(stack_page(with_a_ball(bumpy_cell(steps=20))).encode()) < 700_000
