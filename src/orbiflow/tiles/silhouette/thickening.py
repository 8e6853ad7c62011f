"""Thin parts of a shape grown to a width, along the middle lines of the parts and of the gaps.

The middle lines are ridges of the Voronoi diagram of points on the outline (the medial axis; Blum,
1967). A part grows by discs about its middle line. It never grows over the middle line of a gap, so
that legs that lie side by side stay apart and no hole is closed.
"""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

from typing import Any, NamedTuple, cast

import numpy as np
import shapely
from scipy.spatial import KDTree, Voronoi
from shapely.geometry import MultiLineString, Polygon
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array
from orbiflow.tiles.geometry import arc_lengths, polygons_in
from orbiflow.tiles.silhouette.outlines import DISC_OVERREACH, filled, opened, simplified

POINTS_PER_WIDTH = 16  # points on the outline for each width that is asked for
MAX_POINTS = 12_000  # points on the outline, however long it is
# The least distance of a ridge's two points of the outline, in radii. It is 2 along a leg and 1.4 in a
# right angle, so that only sharp corners have a middle line.
FACING_IN_PARTS, FACING_IN_GAPS = 1.7, 1.2
# Between two sides of a gap the outline is so many times longer: where a leg begins is no gap
OUTLINE_PER_GAP = 5.0
OUTLINE_PER_WIDTH = 3.0  # the least length of the outline of a part that grows, in widths
GAP_SHARE = 0.5  # of the width: the gaps that growing leaves, where there was as much
# A ridge is of a tuft of hair if a wider place, by this factor, is nearer than its radius and a share
# of the width
TUFT_RATIO, TUFT_SHARE = 2.0, 0.25


def thickened(shape: Polygon, width: float) -> Polygon:
    """Return a shape whose parts that are thinner than `width` are about as wide.

    Parts end in half a disc, so they become longer by as much as half the width. Corners of wide parts
    stay as they are.

    >>> body = [(0, 0), (4, 0), (4, 1.9), (9, 1.9), (9, 2.1), (4, 2.1), (4, 4), (0, 4)]
    >>> grown = thickened(Polygon(body), 1.0)
    >>> low, high = (grown.intersection(shapely.box(x, 0, x + 0.1, 4)).bounds for x in (1, 6))
    >>> round(low[3] - low[1], 1), round(high[3] - high[1], 1)
    (4.0, 1.0)
    """
    thin = _thin_parts(shape, width)
    if not thin:
        return shape
    ridges = _ridges(shape, width)
    inside = cast(Any, shapely).contains(shape, ridges.middles)
    parts = ridges.take(inside & (ridges.radii < width / 2) & (ridges.facing > FACING_IN_PARTS))
    parts = parts.take(~_are_tufts(parts, width))
    parts = parts.take(shapely.intersects(shapely.union_all(thin), parts.middles))
    gaps = ridges.take(
        ~inside & (ridges.facing > FACING_IN_GAPS) & (ridges.outline > OUTLINE_PER_GAP)
    )
    # what was nearer than this to the middle of a gap may stay, but nothing grows there
    grown = _about(parts.lines, width / 2).difference(_about(gaps.lines, GAP_SHARE * width / 2))
    whole = polygons_in(shapely.union(shape, grown))
    solid = filled(max(whole, key=lambda part: part.area))
    simpler = simplified(solid, width / 100)
    return simpler if simpler.is_valid and simpler.area >= shape.area else solid


def _thin_parts(shape: Polygon, width: float) -> list[Polygon]:
    """Return the parts that no disc of a width inside the shape covers, but for mere corners."""
    parts = polygons_in(shape.difference(opened(shape, width, DISC_OVERREACH)))
    return [part for part in parts if part.length > OUTLINE_PER_WIDTH * width]


class _Ridges(NamedTuple):
    """Middle lines of parts and gaps.

    - `lines`: R short straight lines.
    - `middles`: Their middle points (R,).
    - `radii`: Half of what is between the two sides (R,).
    - `facing`: The distance (R,) of the two points of the outline, in radii.
    - `outline`: The length (R,) of the outline between these, in their distances.
    """

    lines: Any
    middles: Any
    radii: Array
    facing: Array
    outline: Array

    def take(self, index: Any) -> "_Ridges":
        """Return those at an index or mask."""
        return _Ridges(*(values[index] for values in self))


def _ridges(shape: Polygon, width: float) -> _Ridges:
    """Return the middle lines, inside and outside, of what is narrower than a width and a half."""
    step = max(shape.length / MAX_POINTS, width / POINTS_PER_WIDTH)
    points = shapely.get_coordinates(shapely.segmentize(shape.exterior, step))[:-1]
    diagram = Voronoi(points)
    ends = np.array(diagram.ridge_vertices)
    finite = (ends >= 0).all(axis=1)
    ends, places = diagram.vertices[ends[finite]], diagram.ridge_points[finite]
    sides, along = points[places], arc_lengths(points)
    radii = np.linalg.norm(ends - sides[:, :1], axis=2).max(axis=1)
    gap = np.linalg.norm(sides[:, 0] - sides[:, 1], axis=1)
    way = abs(along[places[:, 0]] - along[places[:, 1]])
    outline = np.minimum(way, along[-1] - way) / gap
    lines, middles = cast(Any, (shapely.linestrings(ends), shapely.points(ends.mean(axis=1))))
    ridges = _Ridges(lines, middles, radii, gap / radii, outline)
    return ridges.take(radii < 0.75 * width)


def _are_tufts(ridges: _Ridges, width: float) -> Any:
    """Return which ridges (R,) are of tufts of hair on wider parts, or of the tips of claws."""
    places = shapely.get_coordinates(ridges.middles)
    tufts = np.zeros(len(places), dtype=bool)
    if len(places):
        reach = (0.5 + TUFT_SHARE) * width
        near = KDTree(places).query_pairs(reach, output_type="ndarray")
        i, j = np.concatenate([near, near[:, ::-1]]).T
        apart = np.linalg.norm(places[i] - places[j], axis=1)
        wider = ridges.radii[j]
        tufts[i[(wider > TUFT_RATIO * ridges.radii[i]) & (apart < wider + TUFT_SHARE * width)]] = (
            True
        )
    return tufts


def _about(lines: Any, radius: float) -> BaseGeometry:
    """Return all that is within a distance of lines."""
    joined = shapely.line_merge(MultiLineString(list(lines)))
    return joined.buffer(radius, quad_segs=8)
