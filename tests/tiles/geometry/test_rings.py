"""Area, centroid and sense of rings, and the evenly divided sides."""

import numpy as np
import pytest
import shapely
import torch
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.symmetry import CrystallographicGroup
from orbiflow.tiles import (
    Tile,
    centroid,
    orient,
    resampled,
    reverse,
    ring_length,
    signed_area,
    subdivided,
)
from strategies import dyadic_rings

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
offsets = st.tuples(*[st.integers(-(10**8), 10**8)] * 2).map(lambda pair: np.array(pair, float))


@pytest.mark.parametrize("offset", [0.0, 1e4, 1e8, 1e12])
def test_a_unit_square_has_area_one_wherever_it_lies(offset: float) -> None:
    group = CrystallographicGroup.generate(np.eye(2), [])
    assert Tile(SQUARE + offset, group).signed_area == 1.0
    assert signed_area(SQUARE + offset) == 1.0
    assert np.array_equal(centroid(SQUARE + offset), [offset + 0.5, offset + 0.5])


@given(dyadic_rings(), offsets)
def test_area_and_centroid_move_along(ring: np.ndarray, offset: np.ndarray) -> None:
    moved = ring + offset  # exact: the coordinates have few digits
    assert signed_area(moved) == pytest.approx(signed_area(ring), rel=1e-9, abs=0)
    size = np.ptp(ring, axis=0).max()
    eps = np.finfo(float).eps * np.abs(offset).max()
    assert np.abs(centroid(moved) - offset - centroid(ring)).max() <= 1e-9 * size + 2 * eps


@given(dyadic_rings())
def test_as_shapely_has_it(ring: np.ndarray) -> None:
    polygon = shapely.Polygon(ring)
    assert abs(signed_area(ring)) == pytest.approx(polygon.area, rel=1e-12)
    assert (signed_area(ring) > 0) == polygon.exterior.is_ccw
    middle = np.asarray(polygon.centroid.coords[0])
    assert np.abs(centroid(ring) - middle).max() < 1e-12 * np.ptp(ring, axis=0).max() + 1e-12


@given(dyadic_rings())
def test_reversing_changes_the_sign_alone(ring: np.ndarray) -> None:
    back = reverse(ring)
    assert np.array_equal(back[0], ring[0])
    assert np.array_equal(reverse(back), ring)
    assert signed_area(back) == pytest.approx(-signed_area(ring), rel=1e-12)
    for sense in (True, False):
        assert (signed_area(orient(ring, counter_clockwise=sense)) > 0) == sense


@given(dyadic_rings(), st.integers(1, 4))
def test_stacks_and_tensors_give_the_same(ring: np.ndarray, count: int) -> None:
    stack = np.stack([ring + k for k in range(count)])
    areas = signed_area(stack)
    assert areas.shape == (count,)
    assert np.allclose(areas, signed_area(ring), rtol=1e-12)
    assert np.allclose(centroid(stack), [centroid(r) for r in stack], rtol=1e-12)
    assert np.array_equal(subdivided(stack, 3)[-1], subdivided(stack[-1], 3))
    tensor = torch.tensor(stack)
    assert np.allclose(signed_area(tensor).numpy(), areas, rtol=1e-12)


def test_the_area_has_its_gradient_in_torch() -> None:
    ring = torch.tensor(SQUARE, requires_grad=True)
    (gradient,) = torch.autograd.grad(signed_area(ring), ring)
    outward = torch.tensor([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=torch.float64)
    assert torch.allclose(gradient, 0.5 * outward)


@given(dyadic_rings(), st.integers(1, 5))
def test_subdividing_keeps_the_vertices_and_the_region(ring: np.ndarray, pieces: int) -> None:
    points = subdivided(ring, pieces)
    assert np.array_equal(points[::pieces], ring)
    assert signed_area(points) == pytest.approx(signed_area(ring), rel=1e-9)
    steps = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1).reshape(-1, pieces)
    assert np.allclose(steps, steps[:, :1], atol=1e-12 * np.abs(ring).max())


@given(dyadic_rings(), st.integers(3, 80), st.floats(0, 1))
def test_points_are_evenly_spaced_on_the_ring(ring: np.ndarray, count: int, phase: float) -> None:
    line = shapely.LinearRing(ring)
    points = resampled(ring, count, phase)
    assert points.shape == (count, 2)
    spacing = line.length / count
    assert ring_length(ring) == pytest.approx(line.length, rel=1e-12)
    expected = [line.interpolate((k + phase) * spacing).coords[0] for k in range(count)]
    assert np.abs(points - expected).max() < 1e-9 * line.length
