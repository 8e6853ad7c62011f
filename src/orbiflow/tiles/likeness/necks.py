"""The narrowest neck and slit of a polygon.

Two points of the outline face each other across a neck if the segment between them is inside and at
most `MAX_NECK_WIDTH` long, and both ways along the outline between them are long: at least
`OUTLINE_PER_WIDTH` times the segment and at least `MIN_OUTLINE`. So the tip of a corner is a neck
only if it is sharper than 23 degrees; its width is then taken where the outline beyond is
`MIN_OUTLINE` long. A slit is the same with the segment outside.
"""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

import math
from collections.abc import Callable
from typing import Any, NamedTuple, cast

import numpy as np
import shapely
from numpy.typing import ArrayLike
from scipy.spatial import KDTree

from orbiflow.arrays import Array, Integers
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_array
from orbiflow.tiles.geometry import arc_lengths, orient, ring_length

# the least length of the outline beyond a neck, in its widths: 1 / sin(11.5 degrees)
OUTLINE_PER_WIDTH = 5.0
MIN_OUTLINE = 0.1  # the least length of the outline beyond a neck, in square roots of the area
MAX_NECK_WIDTH = 0.5  # the largest width of a neck, in square roots of the area
# the share of the silhouette's narrowest neck below which a tile looks cut through
PINCHED_SHARE = 0.25
# the tolerance, in that unit, for simplifying a silhouette before necks are searched
SIMPLIFICATION = 0.003
SAFE_NECK_WIDTH = 0.05  # width, in square roots of the area, above which no neck looks cut through
# the distance of points on the outline, in square roots of the area: the error for tapering parts
POINT_SPACING = 0.0125


class Thinnest(NamedTuple):
    """The narrowest place of a polygon.

    - `width`: The width in the polygon's own units.
    - `share`: The width in square roots of the polygon's area.
    - `ends`: The two points (2, 2) of the outline at this distance.
    """

    width: float
    share: float
    ends: Array

    @property
    def place(self) -> Array:
        """The middle (2,) of the narrowest place."""
        return self.ends.mean(axis=0)


def neck_factor(share: float, min_neck: float) -> float:
    """Return the factor of a score for a narrowest neck of `share` square roots of the area.

    >>> neck_factor(0.02, 0.01), neck_factor(0.002, 0.01)
    (1.0, 0.2)
    """
    return 1.0 if share >= min_neck else share / min_neck


def least_neck(silhouette: ArrayLike, min_neck: float) -> float:
    """Return how wide the necks of a silhouette's tiles should be, in square roots of the area.

    It is the larger of `min_neck` and `PINCHED_SHARE` times the silhouette's own narrowest neck,
    the latter at most `SAFE_NECK_WIDTH`; 0 if `min_neck` is 0.

    >>> bar = [[0.0, 0.0], [20.0, 0.0], [20.0, 0.2], [0.0, 0.2]]
    >>> least_neck(bar, 0.01), least_neck(bar, 0.1), least_neck(bar, 0.0)
    (0.025, 0.1, 0.0)
    """
    if not min_neck:
        return 0.0
    _, polygon = _checked(silhouette)
    # a photo's outline may have 20,000 vertices, whose pairs fill gigabytes
    plain = shapely.simplify(polygon, SIMPLIFICATION * math.sqrt(polygon.area))
    ring = shapely.get_coordinates(plain.exterior)[:-1]
    return max(min_neck, min(PINCHED_SHARE * narrowest_neck(ring).share, SAFE_NECK_WIDTH))


def narrowest_neck(ring: ArrayLike) -> Thinnest:
    """Return the narrowest neck of a polygon; without a neck, the diameter of its largest disc.

    The result is exact if the sides of the neck are parallel or a vertex is at its narrowest place;
    if it tapers, the place is found to two `POINT_SPACING`s along the outline, and never too
    narrow.

    Args:
        ring: The vertices (n, 2) of a simple polygon, in either orientation.

    Raises `OrbiflowError` for a polygon that crosses itself or has no area.

    >>> bar = [[0.0, 0.0], [8.0, 0.0], [8.0, 0.5], [0.0, 0.5]]
    >>> narrowest_neck(bar).width, narrowest_neck(bar).share
    (0.5, 0.25)
    """
    points, polygon = _checked(ring)
    size = math.sqrt(polygon.area)
    shapely.prepare(polygon)
    neck = _facing(orient(points), size, _inside(polygon))
    if neck is not None:
        return neck
    radius = shapely.maximum_inscribed_circle(polygon, tolerance=1e-4 * size)
    center, touch = shapely.get_coordinates(radius)
    width = float(2 * np.linalg.norm(touch - center))
    return Thinnest(width, float(width / size), np.array([touch, 2 * center - touch]))


def neck_up_to(ring: ArrayLike, share: float) -> float:
    """Return the share of the `narrowest_neck`, or `share` if no neck is narrower, which is faster.

    Arguments and errors are those of `narrowest_neck`; `share` is in square roots of the area.

    >>> bar = [[0.0, 0.0], [8.0, 0.0], [8.0, 0.5], [0.0, 0.5]]
    >>> neck_up_to(bar, 0.3), neck_up_to(bar, 0.1)
    (0.25, 0.1)
    """
    points, polygon = _checked(ring)
    size = math.sqrt(polygon.area)
    shapely.prepare(polygon)
    neck = _facing(orient(points), size, _inside(polygon), share * size)
    return share if neck is None else neck.share


def narrowest_slit(ring: ArrayLike) -> Thinnest | None:
    """Return the narrowest gap between parts of a polygon, outside of it; None if there is none.

    Arguments, accuracy and errors are those of `narrowest_neck`.
    """
    points, polygon = _checked(ring)
    shapely.prepare(polygon)
    outside = orient(points, counter_clockwise=False)
    size = math.sqrt(polygon.area)
    return _facing(outside, size, lambda lines: ~cast(Any, polygon.intersects(lines)))


def _checked(ring: ArrayLike) -> tuple[Array, shapely.Polygon]:
    points = as_array(ring, "the polygon", ("N", 2))
    polygon = shapely.Polygon(points) if len(points) > 2 else shapely.Polygon()
    if not polygon.is_valid or not polygon.area > 0:
        raise OrbiflowError("the polygon crosses itself or has no area: give a simple polygon")
    return points, polygon


def _inside(polygon: shapely.Polygon) -> Callable[[Any], Any]:
    return lambda lines: cast(Any, polygon.contains_properly(lines))


def _facing(
    ring: Array, size: float, runs_well: Callable[[Any], Any], widest: float = math.inf
) -> Thinnest | None:
    """Return the nearest two points that face each other on the left of the ring, if at all near."""
    dense = shapely.segmentize(shapely.LinearRing(ring), POINT_SPACING * size)
    points = shapely.get_coordinates(dense)[:-1]
    tree = KDTree(points)
    widest = min(widest, ring_length(ring) / 2 / OUTLINE_PER_WIDTH, MAX_NECK_WIDTH * size)
    reach = min(2 * POINT_SPACING * size, widest)
    while True:
        ends = _nearest_within(points, tree, reach, MIN_OUTLINE * size, runs_well)
        if ends is not None:
            width = float(np.linalg.norm(ends[1] - ends[0]))
            return Thinnest(width, float(width / size), ends)
        if reach == widest:
            return None
        reach = min(2 * reach, widest)


def _nearest_within(
    points: Array, tree: KDTree, reach: float, apart: float, runs_well: Callable[[Any], Any]
) -> Array | None:
    """Return ends (2, 2) of the shortest segment that counts, of those up to `reach` long."""
    knots = arc_lengths(points)
    steps = np.roll(points, -1, axis=0) - points
    lengths = np.diff(knots)
    pairs = tree.query_pairs(reach + lengths.max(), output_type="ndarray")
    i, j = np.concatenate([pairs, pairs[:, ::-1]]).T
    # no way along the outline is shorter than what the knots say, less a step
    way = abs(knots[i] - knots[j])
    far = np.minimum(way, knots[-1] - way) >= apart - lengths[j]
    i, j = i[far], j[far]
    along = ((points[i] - points[j]) * steps[j]).sum(axis=1) / lengths[j] ** 2
    along = np.clip(along, 0.0, 1.0)
    ends = points[j] + along[:, None] * steps[j]
    width = np.linalg.norm(points[i] - ends, axis=1)
    way = abs(knots[i] - knots[j] - along * lengths[j])
    beyond = np.minimum(way, knots[-1] - way) >= np.maximum(apart, OUTLINE_PER_WIDTH * width)
    counts = np.flatnonzero(beyond & (width <= reach))
    # a quick filter: segments that may leave point i, and reach side j, on the left
    segments, corner = (ends - points[i])[counts], (along[counts] <= 0) | (along[counts] >= 1)
    before, after, side = (steps[k[counts]] for k in (i - 1, i, j))
    leaves = np.maximum(_cross(after, segments), _cross(before, segments)) > 0
    counts = counts[leaves & (corner | (_cross(side, segments) < 0))]
    counts = counts[_local_minima(i[counts], j[counts], width[counts])]
    counts = counts[np.argsort(width[counts], kind="stable")]
    for start in range(0, len(counts), 256):
        part = counts[start : start + 256]
        both = np.stack([points[i[part]], ends[part]], axis=1)
        # the ends themselves lie on the outline
        inner = both + 1e-6 * (both[:, ::-1] - both)
        well = np.flatnonzero(runs_well(np.asarray(shapely.linestrings(inner))))
        if len(well):
            return both[well[0]]
    return None


def _local_minima(i: Integers, j: Integers, width: Array) -> Integers:
    """Return the segments from one point to successive sides that are shorter than the next ones."""
    order = np.lexsort((j, i))
    i, j, width = i[order], j[order], width[order]
    row = (i[1:] == i[:-1]) & (j[1:] == j[:-1] + 1)
    short = np.ones(len(order), dtype=bool)
    short[1:] &= ~row | (width[1:] <= width[:-1])
    short[:-1] &= ~row | (width[:-1] <= width[1:])
    return order[short]


def _cross(a: Array, b: Array) -> Array:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
