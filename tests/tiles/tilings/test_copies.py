"""Patches cover their window with nothing too much, and copies as integers are theirs."""

from __future__ import annotations

import numpy as np
import pytest

from exported import tile_of
from orbiflow.symmetry import identity, translation
from orbiflow.tiles import (
    CLASSES,
    Tile,
    aspects,
    colouring,
    copies_inside,
    copies_meeting,
    edges,
    isohedral_class,
    patch,
)
from orbiflow.tiles.tilings.tiling import coset_and_cell
from refusals import refused


def window_of(tile: Tile, shift: tuple[float, float], size: tuple[float, float]) -> tuple:
    middle = tile.center + tile.radius * np.array(shift)
    half = tile.radius * np.array(size)
    return (*(middle - half), *(middle + half))


@pytest.mark.parametrize("name", CLASSES)
def test_neighbours_and_colours(name: str) -> None:
    tile = tile_of(name)
    copies = copies_meeting(tile, window_of(tile, (0, 0), (3, 3)))
    own, colours = edges(tile), colouring(tile)
    beyond = copies.neighbours(own.across).copy
    table = colours.colours(copies)
    known = {
        (int(c), *map(int, cell)): k
        for k, (c, cell) in enumerate(zip(copies.cosets, copies.cells, strict=True))
    }
    for k in range(len(copies)):
        g = copies.isometry(k)
        assert table[k] == colours.colour(g)
        for edge, element in enumerate(own.across):
            coset, cell = coset_and_cell(tile.group, g @ element)
            assert beyond[k, edge] == known.get((coset, *cell), -1)
            if beyond[k, edge] >= 0:
                assert table[k] != table[beyond[k, edge]]


def test_an_empty_window_of_whole_tiles() -> None:
    tile = tile_of("IH5")
    found = copies_inside(tile, window_of(tile, (0, 0), (0.1, 0.1)))
    assert len(found) == 0
    assert found.neighbours(edges(tile).across).copy.shape == (0, 6)


def test_too_many() -> None:
    tile = tile_of("IH1")
    with refused("window", 20000):
        copies_inside(tile, window_of(tile, (0, 0), (200, 200)))


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
