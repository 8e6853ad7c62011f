"""Patches cover their window, with nothing too much."""

from __future__ import annotations

import numpy as np
import pytest

from orbiflow.symmetry import identity, translation
from orbiflow.tiles import Tile, aspects, isohedral_class, patch
from refusals import refused

WINDOW = (-4.0, -3.0, 5.0, 2.5)


def test_window_inside_one_tile() -> None:
    tile = Tile(isohedral_class("IH7").template(), isohedral_class("IH7").group())
    (only,) = patch(tile, (0.1, 0.1, 0.2, 0.2))
    assert only.is_close(identity(2))


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
