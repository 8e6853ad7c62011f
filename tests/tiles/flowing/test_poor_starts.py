"""Targets to which the outline gives few or poor starts, exact ones, and ones of many vertices."""

import numpy as np

from orbiflow.tiles import ClassFailure, OverlapSearch, Target, escherize_class

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
