"""The silhouettes whose tiles are marked, how they are split, and what a judge is shown."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
NAMES = ("common", "likeness_methods", "likeness_shapes", "likeness_pool")


@pytest.fixture(name="load", scope="module")
def load_fixture(tmp_path_factory: pytest.TempPathFactory):
    """Benchmarks by name, imported anew, without the data that are not in the repository."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ORBIFLOW_DATA", str(tmp_path_factory.mktemp("data")))
        patch.syspath_prepend(str(BENCHMARKS))
        for name in NAMES:
            patch.delitem(sys.modules, name, raising=False)
        yield importlib.import_module
    for name in NAMES:
        sys.modules.pop(name, None)


def test_each_silhouette_is_one_sound_outline_with_its_licence(load) -> None:
    found = load("likeness_shapes").silhouettes()
    assert len(found) == 158
    for name, shape in found.items():
        polygon = shapely.Polygon(shape["outline"])
        assert polygon.is_valid, name
        assert polygon.area == pytest.approx(1, abs=1e-3), name
        assert 60 <= len(shape["outline"]) <= 120, name
        assert all(shape[key] for key in ("source", "by", "licence")), name


def test_a_third_is_kept_for_the_test(load) -> None:
    shapes = load("likeness_shapes")
    parts = [shape["part"] for shape in shapes.silhouettes().values()]
    names = ("test", "learn", "ranked", "fresh")
    assert [parts.count(part) for part in names] == [29, 59, 38, 32]
    names = [f"animal {k}" for k in range(25)]
    split = shapes.split(names, np.random.default_rng(3))
    assert list(split) == names
    assert list(split.values()).count("test") == 8
    assert split == shapes.split(names, np.random.default_rng(3))
    assert split != shapes.split(names, np.random.default_rng(4))


def test_gaps_are_closed_and_specks_are_left_out(load) -> None:
    shapes = load("likeness_shapes")
    mask = np.zeros((200, 300), dtype=bool)
    mask[40:160, 40:140] = mask[40:160, 145:240] = mask[5:25, 270:290] = True
    mask[80:100, 60:80] = False  # a hole
    ring = shapes.outline(mask)
    assert len(ring) == 80
    assert shapely.Polygon(ring).area == pytest.approx(120 * 200, rel=0.03)


@given(count=st.integers(1, 24), name=st.text(max_size=9))
def test_each_round_shows_every_tile_once_in_an_order_of_its_own(load, count, name) -> None:
    pool = load("likeness_pool")
    first, second = (pool.order(name, number, count) for number in (1, 2))
    assert sorted(first) == sorted(second) == list(range(count))
    assert first == pool.order(name, 1, count)
    assert count < 8 or first != second


@given(
    shifts=st.lists(st.lists(st.floats(0, 1), max_size=9), min_size=1, max_size=4),
    seed=st.integers(0, 99),
)
def test_tiles_that_are_shown_differ(load, shifts, seed) -> None:
    pool = load("likeness_pool")
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    groups = [
        [pool.Candidate(str(k), "IH4", at, square + np.array((at, 0))) for at in group]
        for k, group in enumerate(shifts)
    ]
    usual = [one for group in groups for one in group]
    found = pool.chosen(usual, groups, np.random.default_rng(seed))
    assert len(found) <= pool.COUNT
    if usual:
        assert found[0].score == max(one.score for one in usual)
    for k, one in enumerate(found):
        least = pool.SAME if k <= len(groups) else pool.ALIKE
        assert all(pool.iou(one.ring, other.ring) < least for other in found[:k])
    for group in groups:  # the best of each, or what looks the same
        best = max(group, key=lambda one: one.score, default=None)
        assert best is None or any(pool.iou(best.ring, one.ring) >= pool.SAME for one in found)


def test_a_sheet_has_the_target_and_as_many_tiles_as_there_are(load) -> None:
    pool = load("likeness_pool")
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    for count, rows in ((8, 2), (9, 3)):
        page = np.asarray(pool.sheet(square, [square] * count))
        assert page.shape == (rows * (pool.CELL + pool.HEAD), 6 * pool.CELL, 3)
        blue = (page == (0x1F, 0x5F, 0xBF)).all(axis=2).sum()
        black = (page == 0).all(axis=2).sum()
        # the numbers are black, too
        assert black / blue == pytest.approx(count / 4, rel=0.01)


def test_a_tile_of_others_is_laid_on_the_silhouette(load) -> None:
    pool = load("likeness_pool")
    target = load("common").goal("penguin_60")
    outline = np.asarray(target.normal)
    moved = 40 * outline @ np.array([[0.6, -0.8], [0.8, 0.6]]) * (-1, 1) + (300, 20)
    assert pool.iou(pool.laid(moved, target), outline) > 0.99
