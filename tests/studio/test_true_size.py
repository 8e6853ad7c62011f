"""The rectangle by which the page shows how large a tile will be, run by node: it is the export's."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from bent_tiles import bent_tile
from orbiflow.arrays import Array
from orbiflow.symmetry import rotation_matrix
from orbiflow.tiles import CLASSES
from orbiflow.tiles.page import rectangle_sides
from studio.test_pull_module import CLOSEUP, run_in_node

SMALLEST = f"""
import {{ smallest }} from "{(CLOSEUP.parent / "takeaway/truesize.js").as_uri()}";
const rings = JSON.parse((await import("node:fs")).readFileSync(0));
console.log(JSON.stringify(rings.map(smallest)));
"""


def check(rings: list[Array]) -> None:
    """Compare the page's rectangles with those of the export."""
    told = run_in_node(SMALLEST, [ring.tolist() for ring in rings])
    for ring, own in zip(rings, told, strict=True):
        assert (own["short"], own["long"]) == pytest.approx(rectangle_sides(ring), rel=1e-5)
        box, size = shapely.Polygon(own["corners"]), np.ptp(ring, axis=0).max()
        assert box.area == pytest.approx(own["short"] * own["long"], rel=1e-9)
        assert box.buffer(1e-9 * size).contains(shapely.MultiPoint(ring))


def test_tiles_are_measured_as_files_are() -> None:
    rings = [bent_tile(name, 30.0).polygon for name in CLASSES]
    check([*rings, *(ring @ rotation_matrix(0.4).T for ring in rings)])


@settings(max_examples=5, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_rings_of_any_shape_and_grid(seed: int) -> None:
    random = np.random.default_rng(seed)
    shapes = [
        random.normal(size=(count, 2)) @ random.normal(size=(2, 2)) for count in (3, 5, 40, 400)
    ]
    grid = np.stack(np.meshgrid(np.arange(5.0), np.arange(3.0)), axis=-1).reshape(
        -1, 2
    )  # doubled, in lines
    check([*shapes, grid, np.repeat(grid, 2, axis=0)])
