"""Curves along which a grid crosses a level part its nodes as they should."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from orbiflow.drawing import level_curves

GRIDS = arrays(
    np.float64, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.floats(-1, 1)
)


@given(GRIDS)
def test_nodes_above_the_level_are_inside(grid: np.ndarray) -> None:
    values, level = np.pad(grid, 1, constant_values=-2.0), 0.25
    curves = level_curves(values, level)
    assert all((curve[0] == curve[-1]).all() for curve in curves)
    rings = [shapely.LinearRing(curve) for curve in curves]
    area = shapely.build_area(shapely.GeometryCollection(rings))
    off = np.abs(values - level) > 1e-6  # a curve through a node has it on neither side
    nodes = shapely.points(np.argwhere(off).astype(float))
    assert (shapely.contains(area, nodes) == (values[off] > level)).all()


@given(
    arrays(np.int64, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.integers(0, 2))
)
def test_no_curve_touches_itself_or_another(grid: np.ndarray) -> None:
    # many nodes lie at the level itself
    curves = level_curves(np.pad(grid, 1), 1.0)
    lines = np.array([shapely.LinearRing(curve) for curve in curves], dtype=object)
    assert all(line.is_simple for line in lines)
    tree = shapely.STRtree(lines)
    first, second = tree.query(lines, predicate="intersects")
    assert (first == second).all()


def test_corners_do_not_hold_together() -> None:
    assert len(level_curves(np.pad(np.eye(2), 1), 0.5)) == 2


def test_a_ring_has_two_curves_and_nothing_none() -> None:
    values = np.pad(np.ones((3, 3)), 1)
    values[2, 2] = 0
    outer, inner = sorted(level_curves(values, 0.5), key=len, reverse=True)
    areas = [shapely.Polygon(curve).area for curve in (outer, inner)]
    assert areas == pytest.approx([8.5, 0.5])
    turns = [shapely.LinearRing(curve).is_ccw for curve in (outer, inner)]
    assert turns[0] != turns[1]
    assert level_curves(np.zeros((4, 4)), 0.5) == []
