"""Points of a ring by arc length."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.tiles import points_along, resampled, ring_length
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
