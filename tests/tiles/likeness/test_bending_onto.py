"""Silhouettes laid onto given outlines, and the correspondence that this starts from."""

import numpy as np
import pytest
import shapely

from orbiflow.tiles import arc_lengths, plane_points, resampled
from orbiflow.tiles.likeness import Elastic, bent_onto, mutual_iou
from orbiflow.tiles.likeness.bending_onto import _separated, corresponding
from outlines import animal

RING = resampled(animal("squirrel.dat").normal, 120)
BODY = Elastic(RING)


def waved(amount: float) -> np.ndarray:
    x, y = RING.T
    return np.stack([x + amount * np.sin(5 * y), y + amount * np.cos(4 * x)], axis=-1)


@pytest.mark.parametrize("shift", [0, 7, 61])
def test_an_outline_corresponds_to_itself(shift: int) -> None:
    at = corresponding(RING, np.roll(RING, shift, axis=0))
    size = arc_lengths(RING)[-1]
    expected = arc_lengths(np.roll(RING, shift, axis=0))[(np.arange(120) + shift) % 120]
    apart = (at - expected + size / 2) % size - size / 2
    assert abs(apart).max() < 0.03 * size


def test_points_lie_on_the_ring_in_order() -> None:
    ring = resampled(waved(0.1), 90)
    z = bent_onto(BODY, ring)
    outline = plane_points(z[:120])
    scale = np.sqrt(shapely.Polygon(outline).area / shapely.Polygon(ring).area)
    line = shapely.LinearRing(ring * scale)
    assert shapely.distance(shapely.points(outline), line).max() < 0.03
    assert shapely.is_valid(shapely.Polygon(outline))


def test_it_costs_no_more_than_the_known_way_and_less_for_less() -> None:
    costs = []
    for amount in (0.02, 0.05, 0.1):
        ring = waved(amount)
        known = BODY.pulled(BODY.rest[:, None], (ring @ [1, 1j])[:, None], 1e6, 60)
        laid = bent_onto(BODY, ring)[:, None]
        costs.append(float(BODY.forgiving_energy(laid)[0]))
        assert costs[-1] < 1.05 * BODY.forgiving_energy(known)[0]
    assert costs == sorted(costs)


def test_places_moved_apart_keep_their_order_and_stay_where_they_are_if_they_can() -> None:
    at = np.array([0.0, 1.0, 2.0, 3.0])
    assert _separated(at, 4.0) == pytest.approx(at)
    mixed = _separated(np.array([0.0, 2.5, 1.5, 5.0]), 4.0)
    assert (np.diff(np.append(mixed, mixed[0] + 4.0)) > 0).all()


def test_mutual_iou_is_that_of_the_best_overlay() -> None:
    turned = RING @ np.array([[np.cos(0.15), -np.sin(0.15)], [np.sin(0.15), np.cos(0.15)]])
    alike = mutual_iou([RING, 2 * turned + 3, waved(0.15)])
    assert alike(0, 1) == pytest.approx(1, abs=1e-3)
    assert alike(1, 0) == alike(0, 1)
    assert alike(0, 2) < 0.9
    plain = shapely.Polygon(RING), shapely.Polygon(waved(0.15))
    assert alike(0, 2) > plain[0].intersection(plain[1]).area / plain[0].union(plain[1]).area - 0.1
