"""Cells that repeat: laid side by side they are the plane itself."""

from dataclasses import replace

import numpy as np
import pytest

from artworks import art_settings, checkerboard, squirrel
from orbiflow.symmetry import rotation_matrix
from orbiflow.tiles import Over, Page, artwork, render_artwork
from orbiflow.tiles.make.repeats import rectangle
from orbiflow.tiles.page import Box
from refusals import refused


def two_by_two(page: Page) -> Page:
    """The same tiling on a page twice as wide and high."""
    width, height = page.size
    return replace(page, size=(2 * width, 2 * height), box=Box(0.0, 0.0, 2 * width, 2 * height))


@pytest.mark.parametrize("how", ["aspect", "neighbour", "one"])
@pytest.mark.parametrize("name", ["IH1", "IH5", "IH21", "IH28"])
def test_two_by_two_is_the_same_plane(name: str, how) -> None:
    tile = squirrel(name)
    settings = art_settings(repeat="basic", tile_size="60px", colour=how, stretch=0.05)
    art = artwork(tile, settings, None if how == "one" else Over(checkerboard(tile)))
    cell = render_artwork(art)
    twice = render_artwork(replace(art, page=two_by_two(art.page)))
    apart = np.abs(np.tile(cell, (2, 2, 1)).astype(int) - twice)
    assert apart.max() <= 1


@pytest.mark.parametrize("name", ["IH1", "IH5"])
@pytest.mark.parametrize("repeat", ["brick", "half-drop"])
def test_rows_or_columns_moved_by_half_are_the_same_plane(repeat, name: str) -> None:
    tile = squirrel(name)
    settings = art_settings(repeat=repeat, tile_size="60px", stretch=0.05)
    art = artwork(tile, settings, Over(checkerboard(tile)))
    cell = render_artwork(art)
    height, width = cell.shape[:2]
    if repeat == "brick":
        moved = np.roll(cell, width // 2, axis=1)
        pasted = np.vstack([np.hstack([cell, cell]), np.hstack([moved, moved])])
    else:
        moved = np.roll(cell, height // 2, axis=0)
        pasted = np.hstack([np.vstack([cell, cell]), np.vstack([moved, moved])])
    twice = render_artwork(replace(art, page=two_by_two(art.page)))
    assert np.abs(pasted.astype(int) - twice).max() <= 1


@pytest.mark.parametrize("repeat", ["brick", "half-drop"])
@pytest.mark.parametrize("turn", [0.0, 0.3, -1.2])
def test_half_the_cell_where_the_lattice_has_it(turn: float, repeat) -> None:
    basis = rotation_matrix(turn) @ np.array([[1.0, 0.5], [0.0, 0.9]])
    basic = rectangle(basis, 100.0, 0.0, flipped=False)
    found = rectangle(basis, 100.0, 0.0, flipped=False, repeat=repeat)
    assert (basic.cells, found.cells) == (2, 1)
    assert found.exact
    # what repeats are vectors of the lattice: a side, and the other with half of it
    width, height = found.width, found.height
    assert (width if repeat == "brick" else height) % 2 == 0
    brick, drop = [[width, 0], [width / 2, height]], [[0, height], [width, height / 2]]
    ways = np.array(brick if repeat == "brick" else drop, dtype=float)
    steps = np.linalg.solve(basis, np.linalg.solve(found.linear, ways.T))
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)
    assert abs(round(np.linalg.det(steps))) == 1


@pytest.mark.parametrize("turn", [0.0, 0.3, -1.2])
@pytest.mark.parametrize(
    ("lattice", "cells"),
    [
        ([[1.0, 0.0], [0.0, 0.7]], 1),
        ([[1.0, 0.5], [0.0, 0.75**0.5]], 2),
        ([[2.0, 1.0], [0, 0.4]], 2),
    ],
)
def test_known_lattices(lattice, cells: int, turn: float) -> None:
    basis = rotation_matrix(turn) @ np.array(lattice)
    found = rectangle(basis, 200.0, 0.0, flipped=False)
    assert found.cells == cells
    assert abs(found.turn) <= 45
    corners = np.linalg.inv(found.linear) @ np.diag([found.width, found.height])
    steps = np.linalg.solve(basis, corners)
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)
    assert abs(round(np.linalg.det(steps))) == cells


def test_oblique_lattices_need_a_tolerance() -> None:
    lattice = np.array([[1.0, 0.331], [0.0, 1.0]])
    with refused("tolerance"):
        rectangle(lattice, 100.0, 0.0, flipped=False)
    found = rectangle(lattice, 100.0, 0.02, flipped=True)
    assert found.strain < 0.021
    assert not found.exact
    assert np.linalg.det(found.linear) < 0
