"""Copies as integers are the copies that isometries make."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from exported import tile_of, tiles
from orbiflow.tiles import CLASSES, Tile, colouring, copies_inside, copies_meeting, edges, patch
from orbiflow.tiles.tilings.tiling import coset_and_cell
from refusals import refused


def window_of(tile: Tile, shift: tuple[float, float], size: tuple[float, float]) -> tuple:
    middle = tile.center + tile.radius * np.array(shift)
    half = tile.radius * np.array(size)
    return (*(middle - half), *(middle + half))


shifts = st.tuples(st.floats(-5, 5), st.floats(-5, 5))
sizes = st.tuples(st.floats(0.05, 4), st.floats(0.05, 4))


@settings(max_examples=20, deadline=None)
@given(tiles, shifts, sizes)
def test_those_that_meet_a_window_are_its_patch(tile, shift, size) -> None:
    window = window_of(tile, shift, size)
    found = copies_meeting(tile, window)
    ours = set(zip(found.cosets.tolist(), map(tuple, found.cells.tolist()), strict=True))
    assert ours == {coset_and_cell(tile.group, g) for g in patch(tile, window)}
    assert len(ours) == len(found)


@settings(max_examples=20, deadline=None)
@given(tiles, shifts, sizes)
def test_those_inside_are_those_of_the_patch_that_are_whole(tile, shift, size) -> None:
    window = window_of(tile, shift, size)
    found = copies_inside(tile, window)
    rings = [g(tile.polygon) for g in patch(tile, window)]
    low, high = np.array(window).reshape(2, 2)
    rounding = 1e-9 * (tile.radius + float(np.abs(window).max()))
    # those that only touch the window's border are inside or not, as rounding has it
    surely, perhaps = (
        sum(bool((r >= low + by).all() and (r <= high - by).all()) for r in rings)
        for by in (rounding, -rounding)
    )
    assert surely <= len(found) <= perhaps
    for k, ring in enumerate(found.images(tile.polygon)):
        np.testing.assert_allclose(ring, found.isometry(k)(tile.polygon), atol=1e-9 * tile.radius)
        assert (ring >= low - rounding).all()
        assert (ring <= high + rounding).all()


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
