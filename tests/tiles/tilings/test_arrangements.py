"""How tiles lie, in words: from group and neighbours, whatever the tile is called."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.symmetry import rotation_matrix, wallpaper_group
from orbiflow.tiles import CLASSES, Tile, Tiling, arrangement, dirichlet_tile

WORDS = {
    **{"IH1": "rows, all alike", "IH2": "brick rows, every other row turned over"},
    "IH3": "rows, every other row facing the other way",
    "IH4": "rows, every other row upside down",
    "IH5": "rows, upside down and turned over by turns",
    **{"IH6": "every other one upside down, half turned over", "IH7": "three around a point"},
    **{"IH21": "six around a point", "IH28": "four around a point"},
}


@pytest.mark.parametrize("name", WORDS)
@settings(max_examples=5)
@given(degrees=st.floats(0, 360), log_size=st.floats(-9, 9), flip=st.booleans())
def test_words_do_not_depend_on_the_frame(
    name: str, degrees: float, log_size: float, flip: bool
) -> None:
    turn = rotation_matrix(np.radians(degrees)) @ np.diag([1.0, -1.0 if flip else 1.0])
    tile = Tile(CLASSES[name].template(), CLASSES[name].group())
    size = 10.0**log_size
    assert arrangement(tile.transformed(size * turn, size * np.array([3.0, -7.0]))) == WORDS[name]


@pytest.mark.parametrize(
    ("group", "point", "words"),
    [
        ("p1", (0.1, 0.2), "rows, all alike"),
        ("p6m", (0, 0), "rows, all alike"),  # hexagons with all the symmetry there is
        ("p4g", (0, 0), "every other one turned over"),  # a chessboard of whirls
        ("pm", (0.13, 0.21), "rows, every other row turned over"),
        ("p4m", (0.13, 0.21), "eight around a point, with their mirror images"),
        ("p6m", (0.13, 0.21), "twelve around a point, with their mirror images"),
        ("p4", (0.5, 0.0), "every other one turned a quarter"),
    ],
)
def test_cells_of_any_group(group: str, point: tuple[float, float], words: str) -> None:
    assert arrangement(dirichlet_tile(wallpaper_group(group), point)) == words


def test_several_shapes_are_counted() -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    left, right = square * (0.3, 1.0), square * (0.7, 1.0) + (0.3, 0.0)
    assert arrangement(Tiling(wallpaper_group("p1"), [left, right])) == "2 shapes, rows, all alike"
