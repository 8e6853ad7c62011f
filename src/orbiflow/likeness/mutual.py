"""How alike two tiles are as shapes, wherever they lie: their mutual IoU after the best similarity."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import shapely

from orbiflow.geometry import centroid, complex_points, orient, signed_area
from orbiflow.likeness.overlap import Overlap, overlaid
from orbiflow.likeness.ranking import Similarity
from orbiflow.symmetry.isometry import Array

CLOSER = 0.15
"""IoU that laying one tile over the other better is taken to add at most."""


def mutual_iou(tiles: Sequence[Array], decisive: float = 0.9) -> Similarity:
    """Mutual IoU of tiles by their indices, for `diverse`.

    The better overlay is looked for only where it may decide: between pairs whose IoU, as they lie
    and with equal areas and centroids, is at most `CLOSER` below `decisive`.

    Args:
        tiles: (n,) simple rings (N, 2), all laid over one silhouette.
        decisive: what the IoU is compared with.

    >>> square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    >>> turned = square @ [[0.98, 0.2], [-0.2, 0.98]] * 3 + 7
    >>> round(mutual_iou([square, turned])(0, 1), 3)
    1.0
    """
    rings = [_unit(tile) for tile in tiles]

    @cache
    def region(index: int) -> Overlap:
        return Overlap(rings[index])

    @cache
    def alike(i: int, j: int) -> float:
        shared = shapely.Polygon(rings[i]).intersection(shapely.Polygon(rings[j])).area
        plain = float(min(shared / (2 - shared), 1.0))
        if not decisive - CLOSER <= plain < decisive:
            return plain
        return max(plain, overlaid(complex_points(rings[i]), region(j))[2])

    return lambda i, j: alike(min(i, j), max(i, j))


def _unit(ring: Array) -> Array:
    ring = orient(np.asarray(ring, dtype=np.float64), counter_clockwise=True)
    return (ring - centroid(ring)) / np.sqrt(signed_area(ring))
