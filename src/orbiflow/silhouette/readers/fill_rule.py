"""The region that a set of closed curves fills, by the fill rules of SVG.

Source: SVG 2, section 13.4.2, the `fill-rule` property (https://www.w3.org/TR/SVG2/painting.html).
"""

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

# Of pairs of segments whose boxes overlap, in all and for each segment: the crossings of a scribble
# grow with the square of its length.
MAX_OVERLAPS = 200_000
MAX_OVERLAPS_EACH = 20
MAX_FACES = 50_000
_SAMPLE = 400


class TooTangled(Exception):
    """The curves cross each other too often to be resolved."""


def fill(rings: list[NDArray[np.float64]], rule: str = "nonzero") -> BaseGeometry:
    """Region filled by closed `rings`, each (N, 2), under `rule` "nonzero" or "evenodd".

    Raises `TooTangled` for curves with more crossings than can be resolved.

    >>> square = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
    >>> inner = square / 2 + 1
    >>> fill([square, inner]).area, fill([square, inner[::-1]]).area
    (16.0, 12.0)
    >>> fill([square, inner], "evenodd").area
    12.0
    """
    rings = [ring for ring in rings if len(np.unique(ring, axis=0)) >= 3]
    if len(rings) == 1 and (single := Polygon(rings[0])).is_valid:
        return single
    if not rings:
        return Polygon()
    _check_tangle(rings)
    lines = [shapely.LinearRing(ring) for ring in rings]
    faces = np.array(shapely.polygonize([shapely.unary_union(lines)]).geoms, dtype=object)
    if len(faces) > MAX_FACES:
        raise TooTangled
    if not len(faces):
        return Polygon()
    inside = shapely.get_coordinates(shapely.point_on_surface(faces))
    winding = sum(_winding(inside, ring) for ring in rings)
    kept = winding % 2 != 0 if rule == "evenodd" else winding != 0
    return shapely.union_all(faces[kept])


def _check_tangle(rings: list[NDArray[np.float64]]) -> None:
    """Estimate from a sample how many pairs of segments must be tested for a crossing."""
    ends = np.concatenate([np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) for ring in rings])
    low, high = ends.min(axis=1), ends.max(axis=1)
    sample = np.random.default_rng(0).permutation(len(ends))[:_SAMPLE]
    overlaps = sum(
        np.count_nonzero(((low <= high[i]) & (high >= low[i])).all(axis=1)) for i in sample
    )
    if overlaps / len(sample) * len(ends) > MAX_OVERLAPS + MAX_OVERLAPS_EACH * len(ends):
        raise TooTangled


def _winding(points: NDArray[np.float64], ring: NDArray[np.float64]) -> NDArray[np.int64]:
    """How often `ring` (N, 2) winds around each of `points` (P, 2)."""
    winding = np.zeros(len(points), dtype=np.int64)
    low, high = ring.min(axis=0), ring.max(axis=0)
    near = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
    start, end = ring, np.roll(ring, -1, axis=0)
    for i in near:
        x, y = points[i]
        up = (start[:, 1] <= y) & (end[:, 1] > y)
        down = (start[:, 1] > y) & (end[:, 1] <= y)
        side = (end[:, 0] - start[:, 0]) * (y - start[:, 1]) - (x - start[:, 0]) * (
            end[:, 1] - start[:, 1]
        )
        winding[i] = np.count_nonzero(up & (side > 0)) - np.count_nonzero(down & (side < 0))
    return winding
