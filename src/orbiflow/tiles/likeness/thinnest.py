"""Where a polygon is thin: its narrowest neck and slit, and how much of its outline is hair.

Two points of the outline face each other across a neck if the segment between them runs inside, and
both ways along the outline from one to the other are long: at least `FAR` times the segment, and at
least `APART`; it is at most `WIDE`. So the tip of a corner is no neck unless it is sharper than 23
degrees, and then its width is taken where the outline beyond is `APART` long. A slit is the same with
the segment outside.
"""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, cast

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import KDTree

from orbiflow.arguments import number, numbers
from orbiflow.arrays import Array, Integers
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.geometry import arc_lengths, orient, polygons_in, ring_length

FAR = 5.0
"""Length of the outline beyond a neck, in its widths: 1 / sin(11.5 degrees)."""

APART = 0.1
"""Length of the outline beyond a neck, in square roots of the area."""

WIDE = 0.5
"""Width beyond which nothing is a neck, in square roots of the area."""

PINCHED = 0.25
"""Part of the silhouette's narrowest neck below which a tile's looks cut through."""

COARSE = 0.003
"""How far a silhouette's outline may be moved before its necks are looked for, in the same unit."""

SOUND = 0.05
"""Width above which no neck does, in square roots of the area."""

STEP = 0.0125
"""Distance of points on the outline, in square roots of the area: how exact tapering parts are."""

ROUND = 16
"""Sides of a quarter of a disc."""

SLACK = 0.005
"""What discs of `ROUND` reach beyond themselves, in radii."""


class Thinnest(NamedTuple):
    """The narrowest place of a polygon.

    - `width`: in the polygon's own units.
    - `share`: the width in square roots of the polygon's area.
    - `ends`: (2, 2), the two points of the outline that are as far apart.
    """

    width: float
    share: float
    ends: Array

    @property
    def place(self) -> Array:
        """(2,) the middle."""
        return self.ends.mean(axis=0)


def neck_factor(share: float, min_neck: float) -> float:
    """Return the factor of a score for a narrowest neck of `share` square roots of the area.

    >>> neck_factor(0.02, 0.01), neck_factor(0.002, 0.01)
    (1.0, 0.2)
    """
    return 1.0 if share >= min_neck else share / min_neck


def least_neck(silhouette: ArrayLike, min_neck: float) -> float:
    """Return how wide the necks of a silhouette's tiles should be, in square roots of the area.

    `min_neck`, or `PINCHED` times the silhouette's own narrowest but at most `SOUND`, if that is more;
    0 if `min_neck` is 0.

    >>> bar = [[0.0, 0.0], [20.0, 0.0], [20.0, 0.2], [0.0, 0.2]]
    >>> least_neck(bar, 0.01), least_neck(bar, 0.1), least_neck(bar, 0.0)
    (0.025, 0.1, 0.0)
    """
    if not min_neck:
        return 0.0
    _, polygon = _checked(silhouette)
    # a photo's outline may have 20,000 vertices, whose pairs fill gigabytes
    plain = shapely.simplify(polygon, COARSE * math.sqrt(polygon.area))
    ring = shapely.get_coordinates(plain.exterior)[:-1]
    return max(min_neck, min(PINCHED * narrowest_neck(ring).share, SOUND))


def narrowest_neck(ring: ArrayLike) -> Thinnest:
    """Return the narrowest neck of a polygon; without a neck, the diameter of its largest disc.

    Exact where the sides of the neck are parallel or a vertex is at its narrowest; where it tapers, the
    place is found to two `STEP`s along the outline, never too narrow.

    Args:
        ring: (n, 2) vertices of a simple polygon, in either sense.

    Raises:
        OrbiflowError: for a polygon that crosses itself or has no area.

    >>> bar = [[0.0, 0.0], [8.0, 0.0], [8.0, 0.5], [0.0, 0.5]]
    >>> narrowest_neck(bar).width, narrowest_neck(bar).share
    (0.5, 0.25)
    """
    points, polygon = _checked(ring)
    size = math.sqrt(polygon.area)
    shapely.prepare(polygon)
    found = _facing(orient(points), size, lambda lines: cast(Any, polygon.contains_properly(lines)))
    if found is not None:
        return found
    radius = shapely.maximum_inscribed_circle(polygon, tolerance=1e-4 * size)
    center, touch = shapely.get_coordinates(radius)
    width = float(2 * np.linalg.norm(touch - center))
    return Thinnest(width, float(width / size), np.array([touch, 2 * center - touch]))


def narrowest_slit(ring: ArrayLike) -> Thinnest | None:
    """Return the narrowest gap between parts of a polygon, outside of it; None if there is none.

    As `narrowest_neck`.
    """
    points, polygon = _checked(ring)
    shapely.prepare(polygon)
    outside = orient(points, counter_clockwise=False)
    size = math.sqrt(polygon.area)
    return _facing(outside, size, lambda lines: ~cast(Any, polygon.intersects(lines)))


def hair_share(ring: ArrayLike, width: float) -> float:
    """Return the share of a polygon's outline that bounds parts thinner than `width`.

    Thin is what no disc of that diameter inside the polygon covers (the residue of a morphological
    opening); a part counts if it has more than `FAR` widths of the outline, so that corners do not
    count unless they are sharper than 23 degrees.

    Args:
        ring: (n, 2) vertices of a simple polygon, in either sense.
        width: in the polygon's own units.

    Returns:
        From 0 to 1.

    Raises:
        OrbiflowError: for a polygon that crosses itself or has no area, or a width of 0 or less.

    >>> bar = [[0.0, 0.0], [9.5, 0.0], [9.5, 0.5], [0.0, 0.5]]
    >>> hair_share(bar, 0.4), hair_share(bar, 0.6)
    (0.0, 1.0)
    """
    _, polygon = _checked(ring)
    return _thin_share(polygon, polygon, number(width, "width", 0, above=True))


def slit_share(ring: ArrayLike, width: float) -> float:
    """Return the share of a polygon's outline that bounds gaps thinner than `width`."""
    _, polygon = _checked(ring)
    width = number(width, "width", 0, above=True)
    around = shapely.box(*polygon.buffer(2 * width).bounds)
    return _thin_share(polygon, around.difference(polygon), width)


def _checked(ring: ArrayLike) -> tuple[Array, shapely.Polygon]:
    points = numbers(ring, "the polygon", ("N", 2))
    polygon = shapely.Polygon(points) if len(points) > 2 else shapely.Polygon()
    if not polygon.is_valid or not polygon.area > 0:
        raise OrbiflowError("a polygon that crosses itself or has no area has no thinnest place")
    return points, polygon


def _facing(ring: Array, size: float, runs_well: Callable[[Any], Any]) -> Thinnest | None:
    """Return the nearest two points that face each other on the left of the ring."""
    points = _dense(ring, STEP * size)
    tree = KDTree(points)
    widest = min(ring_length(ring) / 2 / FAR, WIDE * size)
    reach = min(2 * STEP * size, widest)
    while True:
        found = _nearest_within(points, tree, reach, APART * size, runs_well)
        if found is not None:
            width = float(np.linalg.norm(found[1] - found[0]))
            return Thinnest(width, float(width / size), found)
        if reach == widest:
            return None
        reach = min(2 * reach, widest)


def _dense(ring: Array, step: float) -> Array:
    """Return the ring's vertices, and points on its sides at most `step` apart."""
    after = np.roll(ring, -1, axis=0)
    pieces = np.maximum(np.ceil(np.linalg.norm(after - ring, axis=1) / step), 1).astype(int)
    start = np.repeat(np.cumsum(pieces) - pieces, pieces)
    share = (np.arange(len(start)) - start) / np.repeat(pieces, pieces)
    return np.repeat(ring, pieces, axis=0) + share[:, None] * np.repeat(
        after - ring, pieces, axis=0
    )


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
    way = np.minimum(way, knots[-1] - way)
    counts = np.flatnonzero((way >= np.maximum(apart, FAR * width)) & (width <= reach))
    left = _on_the_left(steps, i[counts], j[counts], along[counts], (ends - points[i])[counts])
    counts = counts[left]
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


def _on_the_left(
    steps: Array, i: Integers, j: Integers, along: Array, segments: Array
) -> NDArray[np.bool_]:
    """Return which segments may leave point i, and reach side j, on the left (a quick filter)."""
    leaves = np.maximum(_cross(steps[i], segments), _cross(steps[i - 1], segments)) > 0
    within = (along > 0) & (along < 1)
    return leaves & (~within | (_cross(steps[j], segments) < 0))


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


def _thin_share(
    polygon: shapely.Polygon, region: shapely.geometry.base.BaseGeometry, width: float
) -> float:
    """Return the share of the polygon's outline on parts of the region that no disc in it covers."""
    eroded = region.buffer(-width / 2, quad_segs=ROUND)
    opened = eroded.buffer(width / 2 * (1 + SLACK), quad_segs=ROUND)
    parts = polygons_in(region.difference(opened))
    lines = shapely.get_parts(polygon.exterior.difference(opened))
    lengths = shapely.length(lines)
    lines, lengths = lines[lengths > 0], lengths[lengths > 0]
    if not parts or not len(lines):
        return 0.0
    own = shapely.STRtree(parts).nearest(
        shapely.line_interpolate_point(lines, 0.5, normalized=True)
    )
    totals = np.bincount(own, lengths)
    return float(totals[totals > FAR * width].sum() / polygon.exterior.length)
