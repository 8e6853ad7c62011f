"""A world as a page of its own, turned without a network; which tile goes to which world."""

import io
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from orbiflow.tiles import ArtSettings, EscherTile, art, read_result
from orbiflow.tiles.result_file import read_tiles
from orbiflow.tiles.worlds import Unfolding, best_in_world, in_world, unfolded
from orbiflow.tiles.worlds.choosing import WorldLikeness, flip_of
from orbiflow.tiles.worlds.developing import Development
from refusals import refused
from runtime.searches import boot_call
from small_searches import small_searches
from swirled_tiles import swirled_tile


def seen(page: Any) -> np.ndarray:
    page.wait_for_function("document.querySelector('#view').dataset.drawn")
    page.evaluate("new Promise((r) => requestAnimationFrame(() => requestAnimationFrame(r)))")
    return np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB")).astype(int)


@pytest.mark.parametrize(("world", "order"), [("sphere", (2, 3, 4)), ("disc", (2, 3, 7))])
def test_a_world_is_turned(browser: Any, tmp_path: Path, world: Any, order: Any) -> None:
    tile = EscherTile(swirled_tile("IH28", 3, 0.1))
    chosen = ArtSettings(format="html", world=world, order=order, engrave=True, palette="lagoon")
    art(tile, tmp_path / "world.html", chosen)
    page, wrong = browser.new_page(viewport={"width": 500, "height": 400}), list[str]()
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on(
        "request", lambda asked: asked.url.startswith(("file:", "data:")) or wrong.append(asked.url)
    )
    page.goto(f"file://{tmp_path / 'world.html'}")
    first = seen(page)
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 20
    page.mouse.move(250, 200)
    page.mouse.down()
    page.mouse.move(330, 160, steps=4)
    page.mouse.up()
    second = seen(page)
    assert (np.abs(second - first).max(axis=-1) > 30).mean() > 0.1
    page.locator("#view").focus()
    for _ in range(30):
        page.keyboard.press("ArrowLeft")
    page.keyboard.press("+")
    third = seen(page)
    assert (np.abs(third - second).max(axis=-1) > 30).mean() > 0.1
    page.get_by_role("button", name="Fit").click()
    again = seen(page)
    assert (np.abs(again[:350] - first[:350]).max(axis=-1) > 30).mean() < 0.05
    page.close()
    assert wrong == []


def test_only_spheres_and_discs_are_pages(tmp_path: Path) -> None:
    with refused("world"):
        art(EscherTile(swirled_tile("IH28", 3, 0.1)), tmp_path / "a.html")


@pytest.fixture(name="run", scope="module")
def run_fixture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    with small_searches():
        boot_call(folder, "IH4", "IH28", "IH21").run()
    return folder / "out"


def test_a_run_gives_the_best_tile_of_each_class(run: Path) -> None:
    tiles = read_tiles(run)
    names = [own.isohedral_class for own in tiles]
    assert len(set(names)) == len(names)
    assert [own.score for own in tiles] == sorted((own.score for own in tiles), reverse=True)
    assert [own.name for own in read_tiles(run / names[-1])] == [tiles[-1].name]


def test_centres_get_their_orders_as_the_tile_looks_best(run: Path) -> None:
    tile = read_result(run, "IH28")
    seen, (found, notes) = WorldLikeness(tile), in_world(tile, (2, 4, 5), -1)
    assert "there" in notes[0]
    pattern = found.development.potential.pattern
    for orders in permutations((2, 4, 5)):
        other = Unfolding(found.tiling, Development.of(pattern, orders), found.tile)
        assert seen.mark(other) <= seen.mark(found) + 1e-9


def test_the_tile_whose_image_looks_best_is_drawn(run: Path, tmp_path: Path) -> None:
    tiles = read_tiles(run)
    marks = {}
    for tile in tiles:
        if tile.isohedral_class != "IH4":
            marks[tile.isohedral_class] = WorldLikeness(tile).mark(in_world(tile, None, 1)[0])
    best = best_in_world(tiles, None, 1)
    assert best is not None
    assert marks[best.isohedral_class] == max(marks.values())
    done = art(run, tmp_path / "a.svg", ArtSettings(world="sphere", area=(60.0, 60.0)))
    assert done.summary["class"] == best.isohedral_class
    given = art(run, tmp_path / "b.svg", ArtSettings(world="disc", area=(60.0, 60.0)), tile="IH4")
    assert given.summary["class"] == "IH4"


def test_nothing_else_of_a_run_goes_to_a_sphere(run: Path) -> None:
    assert best_in_world([read_result(run, "IH4")], None, 1) is None
    tile = read_result(run, "IH21")
    tiling = tile.tiling.transformed(np.diag(flip_of(tile)), np.zeros(2))
    least = unfolded(tiling, (2, 3, 5), 1)
    assert (
        WorldLikeness(tile).mark(least)
        <= WorldLikeness(tile).mark(in_world(tile, (2, 3, 5), 1)[0]) + 1e-9
    )


def test_orders_that_no_tile_takes_are_refused_for_what_they_are(run: Path, tmp_path: Path) -> None:
    with refused("4, 4, 2"):
        art(run, tmp_path / "a.svg", ArtSettings(world="disc", order=(4, 4, 2)))
    assert best_in_world([read_result(run, "IH4")], (4, 4, 2), -1) is None
