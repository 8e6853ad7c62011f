"""Polygons that become tiles on a sheet, and worlds as pages that are turned."""

import io
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy.spatial import KDTree

from orbiflow.tiles import CLASSES, ArtSettings, EscherTile, art, isohedral_class, read_result
from orbiflow.tiles.result_file import read_tiles
from orbiflow.tiles.worlds import (
    Unfolding,
    best_in_world,
    best_to_become,
    in_world,
    unfolded,
    world_of,
)
from orbiflow.tiles.worlds.choosing import WorldLikeness, flip_of
from orbiflow.tiles.worlds.developing import Development
from orbiflow.tiles.worlds.metamorphosis import Metamorphosis
from refusals import refused
from runtime.searches import boot_call
from small_searches import small_searches
from swirled_tiles import is_sound, swirled_tile

FEW = st.just(5)  # sides along each edge
tiles = st.builds(
    swirled_tile,
    st.sampled_from(list(CLASSES)),
    st.integers(0, 999),
    st.floats(0.05, 0.25),
    per_edge=FEW,
).filter(is_sound)


@settings(max_examples=2)
@given(tiles, st.sampled_from(["right", "down", "middle"]), st.integers(1, 2))
def test_nothing_gaps_or_overlaps(tile: Any, goes: Any, stages: int) -> None:
    chosen = ArtSettings(metamorphosis=goes, stages=stages, area=(90.0, 60.0))
    found, notes = world_of(EscherTile(tile), chosen)
    assert isinstance(found, Metamorphosis)
    assert ("edges cross" in notes[-1]) == (not found.is_sound)
    rings = [curve.flattened(1.0) for _, curve in found.outlines(0)]
    polygons = [shapely.Polygon(ring) for ring in rings]
    assume(found.is_sound)
    sheet = shapely.box(0, 0, 90, 60)
    inside = [shapely.intersection(own, sheet) for own in polygons]
    assert shapely.union_all(inside).area == pytest.approx(sheet.area, rel=1e-9)
    assert sum(own.area for own in inside) == pytest.approx(sheet.area, rel=1e-9)
    # every vertex on the sheet is a vertex of a neighbour, too
    points = np.concatenate(rings)
    owner = np.repeat(np.arange(len(rings)), [len(ring) for ring in rings])
    within = ((points > 2) & (points < (88, 58))).all(axis=1)
    near: Any = KDTree(points).query_ball_point(points[within], 1e-6)
    assert all(len({int(owner[j]) for j in own}) > 1 for own in near)


def test_one_end_is_polygons_and_the_other_the_tile() -> None:
    tile = swirled_tile("IH4", 7, 0.15)
    found, _ = world_of(
        EscherTile(tile), ArtSettings(metamorphosis="right", area=(300.0, 60.0), tile_size=16.0)
    )
    assert isinstance(found, Metamorphosis)
    corners = len(isohedral_class("IH4").template())
    straight = whole = 0
    for _, curve in found.outlines(0):
        ring = curve.flattened(1.0)
        if ring[:, 0].max() < 0.12 * 300:
            hull = shapely.Polygon(ring).simplify(0.05)
            straight += len(shapely.get_coordinates(hull)) - 1 <= corners + 1
        if ring[:, 0].min() > 0.88 * 300:
            area = shapely.Polygon(ring).area
            whole += abs(area - found.page.tiling.tile_area) < 1e-6 * area
    assert straight > 0
    assert whole > 0


def test_stages_go_there_and_back() -> None:
    tile = EscherTile(swirled_tile("IH4", 7, 0.15))
    page: Any = {"metamorphosis": "right", "area": (300.0, 60.0), "tile_size": 16.0}
    found, _ = world_of(tile, ArtSettings(stages=2, **page))
    assert isinstance(found, Metamorphosis)
    shares = found.shares(np.array([[0.0, 30.0], [150.0, 30.0], [300.0, 30.0], [75.0, 30.0]]))
    assert shares == pytest.approx([0, 1, 0, 0.5])
    with refused("stages", "metamorphosis"):
        ArtSettings(stages=2)


@settings(max_examples=2)
@given(st.sampled_from(["IH1", "IH4", "IH5", "IH7", "IH21", "IH28"]), st.data())
def test_a_tile_becomes_another_of_its_class(name: str, data: Any) -> None:
    shapes = st.integers(0, 999), st.floats(0.05, 0.25)
    drawn = st.builds(swirled_tile, st.just(name), *shapes, per_edge=FEW)
    first, last = (EscherTile(data.draw(drawn.filter(is_sound)), name=own) for own in "ab")
    chosen = ArtSettings(metamorphosis="right", area=(120.0, 60.0))
    found, notes = world_of(last, chosen, first)
    assert isinstance(found, Metamorphosis)
    assert "stretched" in notes[-1] or "cross" in notes[-1]
    assert found.before is not None
    # each end is its tile, but for the stretch; all between are tiles of one lattice
    for world, tile in ((found, last), (found.before, first)):
        ring = world.way[-1][: world.vertices]
        points = world.vectors(tile.tile.polygon)[:, :2]
        away = shapely.distance(shapely.points(points), shapely.LinearRing(ring))
        assert away.max() < 0.01 * np.sqrt(found.page.tiling.tile_area)
    for way in found.way:
        area = shapely.Polygon(way[: found.vertices]).area
        assert area == pytest.approx(found.page.tiling.tile_area, rel=1e-6)
    assume(found.is_sound)
    polygons = [shapely.Polygon(curve.flattened(1.0)) for _, curve in found.outlines(0)]
    sheet = shapely.box(0, 0, 120, 60)
    inside = [shapely.intersection(own, sheet) for own in polygons]
    assert shapely.union_all(inside).area == pytest.approx(sheet.area, rel=1e-9)
    assert sum(own.area for own in inside) == pytest.approx(sheet.area, rel=1e-9)


def test_tiles_of_two_classes_do_not_become_each_other() -> None:
    first, last = (EscherTile(swirled_tile(name, 7, 0.15), name=name) for name in ("IH4", "IH5"))
    with refused("IH4", "IH5"):
        world_of(last, ArtSettings(metamorphosis="right"), first)
    assert best_to_become([last], [first]) is None
    same = EscherTile(swirled_tile("IH5", 9, 0.15), name="same")
    assert best_to_become([first, last], [same]) is last


def test_drawings_appear_on_the_way(tmp_path: Path) -> None:
    tile = EscherTile(swirled_tile("IH4", 7, 0.15))
    chosen = ArtSettings(metamorphosis="right", area=(120.0, 60.0), dpi=60, engrave=True)
    done = art(tile, tmp_path / "a.png", chosen)
    assert done.summary["world"] == "metamorphosis"
    picture = np.asarray(Image.open(tmp_path / "a.png").convert("L")).astype(float)
    left, right = np.array_split(picture, 2, axis=1)
    assert np.abs(np.diff(right)).mean() > 1.3 * np.abs(np.diff(left)).mean()
    with refused("metamorphosis", "world"):
        ArtSettings(metamorphosis="right", world="disc")


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
    lowest = tiles[-1]
    assert [own.name for own in read_tiles(run / str(lowest.isohedral_class))] == [lowest.name]
    marks = {}
    for tile in tiles:
        if tile.isohedral_class != "IH4":
            marks[tile.isohedral_class] = WorldLikeness(tile).mark(in_world(tile, None, 1)[0])
    best = best_in_world(tiles, None, 1)
    assert best is not None
    assert marks[best.isohedral_class] == max(marks.values())
    done = art(run, tmp_path / "a.svg", ArtSettings(world="sphere", area=(30.0, 30.0)))
    assert done.summary["class"] == best.isohedral_class
    given = art(run, tmp_path / "b.svg", ArtSettings(world="disc", area=(30.0, 30.0)), tile="IH4")
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
