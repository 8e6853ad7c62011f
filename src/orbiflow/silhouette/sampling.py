"""Points of a silhouette's outline: few for a search, many for the tile, corners among them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from orbiflow.errors import OrbiflowError
from orbiflow.geometry import arc_lengths, points_along, resampled, ring_length

Array = NDArray[np.float64]

PLAIN = 8.2
"""Length of an outline of area 1 up to which it is sampled with the fewest points; a disc has 3.5."""

FEW, MOST = 60, 120
"""Points for the search."""

DETAIL = 0.004
"""What a corner must stand out from the line past it to be kept, in square roots of the area."""

MULTIPLES = (4, 6)
"""Points of the tile for each point of the search."""

MIDDLE = 2
"""Points between the two for each point of the search; divides all `MULTIPLES` of use."""


class Samples(NamedTuple):
    """An outline (M, 2) of area 1, counter-clockwise, sampled three times.

    - `coarse`: (n, 2) points, evenly spaced.
    - `middle`: (2 n, 2) points, most of the outline's corners among them; or `fine` itself.
    - `fine`: (k n, 2) points; every k-th is near one of `coarse`; the outline's corners are among them.
    """

    coarse: Array
    middle: Array
    fine: Array


def sampled(ring: Array, phase: float = 0.0, multiples: tuple[int, ...] = MULTIPLES) -> Samples:
    """Sample an outline, more densely where it is long or rich in corners.

    Where twice the coarse points make no simple polygon, or do not divide the fine ones, `middle` is
    `fine`.

    Args:
        ring: (M, 2) of area about 1, counter-clockwise.
        phase: of the points, in coarse spacings.
        multiples: fine points for each coarse one, in the order in which they are tried.

    Raises:
        OrbiflowError: if no sampling is free of self-crossings: the silhouette has hairs.
    """
    longer = ring_length(ring) / PLAIN
    count = int(np.clip(6 * round(FEW * longer / 6), FEW, MOST))
    coarse = _simple_coarse(ring, count, phase)
    corners = important_vertices(ring, DETAIL)
    fine = None
    for multiple in multiples:
        points = with_corners(ring, corners, multiple * len(coarse), phase * multiple)
        if shapely.Polygon(points).is_valid:
            fine = points
            if 2 * len(corners) <= len(points):
                break
    if fine is None:
        raise OrbiflowError(
            "parts of the silhouette are too thin to be sampled: thicken or remove the hairs"
        )
    middle = with_corners(ring, corners, MIDDLE * len(coarse), phase * MIDDLE)
    if len(fine) % len(middle) or not shapely.Polygon(middle).is_valid:
        middle = fine
    return Samples(coarse, middle, fine)


def _simple_coarse(ring: Array, count: int, phase: float) -> Array:
    """As many points as it takes for a polygon that does not cross itself; hairs made thicker."""
    polygon = shapely.Polygon(ring)
    for width in (0.0, 0.01, 0.02, 0.04):
        thick = ring
        if width:
            grown = shapely.Polygon(polygon.buffer(width, join_style="mitre").exterior)
            thick = shapely.get_coordinates(grown.exterior)[:-1]
            thick = thick[::-1] if not grown.exterior.is_ccw else thick
            start = int(np.argmin(np.linalg.norm(thick - ring[0], axis=1)))
            thick = np.roll(thick, -start, axis=0)
        for points in dict.fromkeys((count, min(MOST, 3 * count // 2), MOST)):
            coarse = resampled(thick, points, phase)
            if shapely.Polygon(coarse).is_valid:
                return coarse
    raise OrbiflowError("the silhouette is too ragged to be sampled: simplify its outline")


def important_vertices(ring: Array, tolerance: float) -> list[int]:
    """Indices of the vertices that Douglas and Peucker's simplification keeps."""
    first = int(np.argmax(np.linalg.norm(ring - ring.mean(axis=0), axis=1)))
    turned = np.roll(ring, -first, axis=0)
    half = int(np.argmax(np.linalg.norm(turned - turned[0], axis=1)))
    kept: list[int] = []
    for start, part in ((0, turned[: half + 1]), (half, np.vstack([turned[half:], turned[:1]]))):
        line = shapely.LineString(part)
        points = shapely.get_coordinates(line.simplify(tolerance, preserve_topology=False))
        at = 0
        for point in points[:-1]:  # vertices are kept bit for bit and in order
            at += int(np.flatnonzero((part[at:] == point).all(axis=1))[0])
            kept.append((start + at + first) % len(ring))
    return sorted(kept)


def with_corners(ring: Array, corners: list[int], count: int, phase: float = 0.0) -> Array:
    """`count` points (count, 2) nearly evenly spaced, the nearest point moved to each corner.

    Point i stays within a spacing of where even spacing has it. Of corners that are nearest to the
    same point, the first is kept.
    """
    along = arc_lengths(ring)
    total = along[-1]
    at: Array = along[corners] / total * count - phase
    index = np.round(at).astype(int)
    order = np.argsort(index % count, kind="stable")
    slots, first = np.unique((index % count)[order], return_index=True)
    shifts = (at - index)[order][first]
    if not len(slots):
        return resampled(ring, count, phase)
    around = np.concatenate([slots - count, slots, slots + count])
    shift = np.interp(np.arange(count), around, np.tile(shifts, 3))
    return points_along(ring, (np.arange(count) + shift + phase) / count * total)
