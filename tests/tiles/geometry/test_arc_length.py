"""Points of a ring by arc length."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.errors import OrbiflowError
from orbiflow.tiles import points_along, resampled, resampled_with_corners, ring_length, signed_area
from strategies import dyadic_rings


@given(dyadic_rings(), st.integers(3, 80), st.floats(0, 1))
def test_points_are_evenly_spaced_on_the_ring(ring: np.ndarray, count: int, phase: float) -> None:
    line = shapely.LinearRing(ring)
    points = resampled(ring, count, phase)
    assert points.shape == (count, 2)
    spacing = line.length / count
    assert ring_length(ring) == pytest.approx(line.length, rel=1e-12)
    expected = [line.interpolate((k + phase) * spacing).coords[0] for k in range(count)]
    assert np.abs(points - expected).max() < 1e-9 * line.length


@given(dyadic_rings(), st.floats(-30, 30))
def test_lengths_go_round(ring: np.ndarray, at: float) -> None:
    total = ring_length(ring)
    once, again = points_along(ring, [at]), points_along(ring, [at + total])
    assert np.abs(once - again).max() < 1e-11 * (total + abs(at))
    assert np.allclose(points_along(ring, [0.0]), ring[:1])


@given(st.data())
def test_corners_are_kept_bit_for_bit(data: st.DataObject) -> None:
    ring = data.draw(dyadic_rings())
    corners = sorted(data.draw(st.sets(st.integers(0, len(ring) - 1), min_size=1)))
    count = data.draw(st.integers(len(corners), 90))
    points, at = resampled_with_corners(ring, corners, count)
    assert points.shape == (count, 2)
    assert at[0] == 0
    assert np.array_equal(points[at], ring[corners])
    line = shapely.LinearRing(ring)
    assert shapely.distance(shapely.points(points), line).max() < 1e-9 * line.length
    # evenly spaced from each corner to the next, none far from its fair share
    ends = [*at, count]
    where = np.array([line.project(shapely.Point(p)) for p in ring[corners]])
    lengths = np.diff(where, append=where[0] + line.length) % line.length
    lengths[lengths < 1e-9 * line.length] += line.length  # a single corner: all the way round
    fair = (count - len(corners)) * lengths / line.length
    assert np.abs(np.diff(ends) - 1 - fair).max() <= 1 + 1e-6


def test_every_vertex_a_corner_is_the_ring() -> None:
    ring = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0]])
    points, at = resampled_with_corners(ring, [0, 1, 2], 12)
    assert at == [0, 4, 7]  # 1 + 9 (4, 3, 5) / 12, the largest remainder first
    assert signed_area(points) == pytest.approx(6)


@pytest.mark.parametrize(
    ("corners", "count", "message"),
    [
        ([], 5, "increasing indices of the 4 vertices"),
        ([2, 1], 5, "increasing indices"),
        ([0, 4], 5, "increasing indices"),
        ([-1, 2], 5, "increasing indices"),
        ([0, 1, 2], 2, "count must be at least .* 3, got 2"),
    ],
)
def test_corners_that_cannot_be_kept(corners: list[int], count: int, message: str) -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    with pytest.raises(OrbiflowError, match=message):
        resampled_with_corners(square, corners, count)
