"""Patches cover their window, with nothing too much."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely

from orbiflow.symmetry import identity, translation
from orbiflow.tiles import IsohedralClass, Tile, aspects, isohedral_class, patch
from refusals import refused

WINDOW = (-4.0, -3.0, 5.0, 2.5)


def test_patch_is_exactly_the_tiles_that_meet_the_window(
    kind: IsohedralClass, make_tile: Any
) -> None:
    tile = make_tile(kind, 6, stretch=0.3, per_edge=10)
    elements = patch(tile, WINDOW)
    images = shapely.polygons(np.stack([g(tile.polygon) for g in elements]))
    box = shapely.box(*WINDOW)
    assert shapely.intersects(box, images).all()
    covered = shapely.union_all(shapely.buffer(images, 1e-9)).intersection(box).area
    assert covered == pytest.approx(box.area, rel=1e-9)


def test_window_inside_one_tile() -> None:
    tile = Tile(isohedral_class("IH7").template(), isohedral_class("IH7").group())
    (only,) = patch(tile, (0.1, 0.1, 0.2, 0.2))
    assert only.is_close(identity(2))


def test_aspects(kind: IsohedralClass, make_tile: Any) -> None:
    tile = make_tile(kind)
    elements = patch(tile, WINDOW)
    found = aspects(tile, elements)
    assert set(found) == set(range(tile.group.order))
    for element, aspect in zip(elements, found, strict=True):
        np.testing.assert_allclose(element.linear, tile.group.cosets[aspect].linear)


def test_foreign_isometry() -> None:
    tile = Tile(isohedral_class("IH1").template(), isohedral_class("IH1").group())
    with refused("Isometry", "p1"):
        aspects(tile, [translation((0.1, 0.0))])


@pytest.mark.parametrize("window", [(0, 0, 0, 1), (1, 0, 0, 1), (0, 0, np.nan, 1), (0, 0, 1)])
def test_windows_that_are_none(window: tuple[float, ...]) -> None:
    tile = Tile(isohedral_class("IH1").template(), isohedral_class("IH1").group())
    with refused("window"):
        patch(tile, window)


def test_a_long_thin_window() -> None:
    tile = Tile(isohedral_class("IH1").template(), isohedral_class("IH1").group())
    found = patch(tile, (0.1, 0.1, 9000.1, 0.1 + 1e-9))
    assert len(found) == pytest.approx(9000 / 1.5, abs=2)


@pytest.mark.parametrize("window", [(-500, -500, 500, 500), (0, 0, 1e9, 1)])
def test_too_many_tiles(window: tuple[float, ...]) -> None:
    tile = Tile(isohedral_class("IH1").template(), isohedral_class("IH1").group())
    with refused("window", 20000):
        patch(tile, window)
