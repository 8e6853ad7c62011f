"""The regions that curves fill and pens cover."""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array, Integers

# Of pairs of segments whose boxes overlap, in all and for each segment: the crossings of a scribble
# grow with the square of its length.
MAX_OVERLAPS = 200_000
MAX_OVERLAPS_EACH = 20
MAX_FACES = 50_000
_SAMPLE_SIZE = 400


class TooTangled(Exception):
    """The curves cross each other too often to be resolved."""


def fill(rings: list[Array], rule: str = "nonzero") -> BaseGeometry:
    """Return the region that closed `rings`, each (N, 2), fill under `rule` "nonzero" or "evenodd"."""
    rings = [ring for ring in rings if len(np.unique(ring, axis=0)) >= 3]
    if len(rings) == 1 and (single := Polygon(rings[0])).is_valid:
        return single
    if not rings:
        return Polygon()
    check_tangle(np.concatenate([np.stack([r, np.roll(r, -1, axis=0)], axis=1) for r in rings]))
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


def check_tangle(segments: Array) -> None:
    """Refuse segments (S, 2, 2) if a sample of them has too many overlaps. Raises `TooTangled`."""
    sample = np.random.default_rng(0).permutation(len(segments))[:_SAMPLE_SIZE]
    low, high = segments.min(axis=1), segments.max(axis=1)
    overlaps = sum(
        np.count_nonzero(((low <= high[i]) & (high >= low[i])).all(axis=1)) for i in sample
    )
    if overlaps / len(sample) * len(segments) > MAX_OVERLAPS + MAX_OVERLAPS_EACH * len(segments):
        raise TooTangled


def _winding(points: Array, ring: Array) -> Integers:
    """Return how often `ring` (N, 2) winds around each of `points` (P, 2)."""
    winding = np.zeros(len(points), dtype=np.int64)
    low, high = ring.min(axis=0), ring.max(axis=0)
    near = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
    start, end = ring, np.roll(ring, -1, axis=0)
    for i in near:
        x, y = points[i]
        up = (start[:, 1] <= y) & (end[:, 1] > y)
        down = (start[:, 1] > y) & (end[:, 1] <= y)
        dx, dy = (end - start).T
        side = dx * (y - start[:, 1]) - (x - start[:, 0]) * dy
        winding[i] = np.count_nonzero(up & (side > 0)) - np.count_nonzero(down & (side < 0))
    return winding
