"""Targets to which the outline gives few or poor starts, exact ones, and ones of many vertices."""

import numpy as np
import shapely

from orbiflow.tiles import (
    ClassFailure,
    Overlap,
    OverlapSearch,
    Target,
    escherize_class,
    prepared_region,
)
from orbiflow.tiles.likeness.metrics import MAX_REGION_VERTICES

FAST = OverlapSearch.for_effort("fast")


def test_a_square_stays_a_square() -> None:
    square = Target(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]), y_down=False)
    result = escherize_class(square, "IH1", FAST)
    assert not isinstance(result, ClassFailure)
    assert result.certificate.valid
    assert result.likeness.metrics.iou > 0.9999


def test_templates_join_where_the_outline_gives_poor_starts() -> None:
    teeth = [
        point
        for k in range(20)
        for point in ((k, 1.0), (k + 0.2, 1.0), (k + 0.2, 12.0), (k + 0.6, 12.0), (k + 0.6, 1.0))
    ]
    comb = Target(np.array([(0.0, 0.0), *teeth[1:], (20.0, 1.0), (20.0, 0.0)][::-1]), y_down=False)
    result = escherize_class(comb, "IH1", FAST)
    assert not isinstance(result, ClassFailure)
    assert result.likeness.metrics.iou > 0.2


def test_regions_of_many_vertices_are_simplified_for_choosing() -> None:
    t = np.linspace(0, 2 * np.pi, 2 * MAX_REGION_VERTICES, endpoint=False)
    radius = 0.56 + 0.002 * np.random.default_rng(0).normal(size=len(t))
    ring = np.stack([radius * np.cos(t), radius * np.sin(t)], axis=-1)
    simple = prepared_region(ring)
    assert len(simple.exterior.coords) < MAX_REGION_VERTICES
    assert abs(simple.area - shapely.Polygon(ring).area) < 0.01
    assert len(prepared_region(ring[::4]).exterior.coords) == len(ring[::4]) + 1
    assert Overlap(ring[::4]).region.area == shapely.Polygon(ring[::4]).area
