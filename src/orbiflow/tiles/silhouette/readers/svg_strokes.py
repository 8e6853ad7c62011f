"""The regions that pens cover: dashes, caps and joins."""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array
from orbiflow.tiles.silhouette.readers.svg_paths import MAX_POINTS, TooManyPoints, check_tangle
from orbiflow.tiles.silhouette.readers.svg_shapes import DrawnShape

SIMPLIFICATION_SHARE = 1 / 500  # of half a pen's width: lines are simplified by as much
MIN_SMOOTH_COSINE = 0.999  # the cosine of half the turn above which a corner needs no mitre


class Line(NamedTuple):
    """A polyline (N, 2), which of its vertices are corners, not on curves, and whether it is closed."""

    points: Array
    corners: NDArray[np.bool_]
    closed: bool


def stroked(lines: list[Line], shape: DrawnShape) -> BaseGeometry:
    """Return the region that a shape's pen covers along polylines."""
    half, unit = shape.width / 2, _dash_unit(lines, shape)
    dashes = [unit * dash for dash in shape.dashes] if unit else []
    offset, limit = shape.number("stroke-dashoffset", 0.0), shape.number("stroke-miterlimit", 4.0)
    offset *= unit
    pieces = [piece for line in lines for piece in _pieces(line, dashes, offset)]
    if not pieces or not all(np.isfinite(piece.points).all() for piece in pieces):
        return Polygon()
    cap = shape.paint.get("stroke-linecap")
    cap = cap if cap == "round" or cap == "square" else "flat"
    corner = shape.paint.get("stroke-linejoin", "miter")
    join = "round" if corner == "round" else "bevel"
    strings = [shapely.LineString(piece.points) for piece in pieces]
    simple = shapely.simplify(strings, SIMPLIFICATION_SHARE * half)
    runs = [shapely.get_coordinates(line) for line in simple]
    check_tangle(np.concatenate([np.stack([p[:-1], p[1:]], axis=1) for p in runs]), half)
    regions = [shapely.buffer(simple, half, cap_style=cap, join_style=join)]
    if join == "bevel":
        limit *= corner != "bevel"
        regions += [_joins(piece, half, limit) for piece in pieces if len(piece.points) > 2]
    return shapely.union_all(np.concatenate(regions))


def _dash_unit(lines: list[Line], shape: DrawnShape) -> float:
    """Return how long a unit of dashes is: more or less than 1 where an author gives the path's length.

    It is 0 where dashes are longer than any path.
    """
    if shape.path_length is None or not shape.dashes:
        return 1.0
    closed = [np.vstack([p, p[:1]]) if is_closed else p for p, _, is_closed in lines]
    total = sum(float(np.hypot(*np.diff(points, axis=0).T).sum()) for points in closed)
    return total / shape.path_length if shape.path_length > 0 else 0.0


def _pieces(line: Line, dashes: list[float], offset: float) -> list[Line]:
    """Return the dashes of a line; or its whole, ending where it began if it is closed."""
    points, corners, closed = line
    if closed:
        points, corners = np.vstack([points, points[:1]]), np.r_[corners, corners[:1]]
    steps = np.hypot(*np.diff(points, axis=0).T)
    points, corners = points[np.r_[True, steps > 0]], corners[np.r_[True, steps > 0]]
    if not dashes or len(points) == 1:
        return [Line(points if len(points) > 1 else np.repeat(points, 2, axis=0), corners, closed)]
    along: Array = np.r_[0.0, np.cumsum(steps[steps > 0])]
    edges: Array = np.r_[0.0, np.cumsum(dashes)]
    total, period = float(along[-1]), float(edges[-1])
    if not (total / period + 2) * len(dashes) < MAX_POINTS:
        raise TooManyPoints
    turns: Array = np.arange(-(offset % period), total, period)[:, None]
    starts: Array = (turns + edges[:-1:2]).ravel()
    ends: Array = (turns + edges[1::2]).ravel()
    shown = (starts < total) & ((ends > 0) | (starts == ends) & (starts >= 0))
    found: list[Line] = []
    for start, end in zip(starts[shown].clip(0), ends[shown].clip(max=total), strict=True):
        inner = (along > start) & (along < end)
        at: Array = np.r_[start, along[inner], end]
        both: list[Array] = [np.interp(at, along, points[:, k]) for k in (0, 1)]
        found.append(Line(np.stack(both, axis=1), np.r_[True, corners[inner], True], False))
    if closed and len(found) > 1 and (found[0].points[0] == found[-1].points[-1]).all():
        last, first = found.pop(), found[0]  # one dash around the start
        around = np.r_[last.corners[:-1], corners[:1], first.corners[1:]]
        found[0] = Line(np.vstack([last.points, first.points[1:]]), around, False)
    return found


def _joins(line: Line, half: float, limit: float) -> Array:
    """Return what sharpens the bevelled corners of a line within a limit, and rounds its curves."""
    points, corners, closed = line
    if closed:
        points, corners = np.vstack([points, points[1:2]]), np.r_[corners, corners[1:2]]
    along = np.diff(points, axis=0)
    along /= np.hypot(*along.T)[:, None]
    first, last = along[:-1], along[1:]
    dot = (first * last).sum(axis=1)
    cosine = np.sqrt(np.maximum(1 + dot, 0) / 2)  # of half the turn
    turn = np.arctan2(first[:, 0] * last[:, 1] - first[:, 1] * last[:, 0], dot)
    # from the centre of the pen to where its outer edge leaves one side and reaches the next
    outward = -half * np.sign(turn)[:, None]
    before, after = (outward * side[:, ::-1] * [-1, 1] for side in (first, last))
    sharp = corners[1:-1] & (cosine < MIN_SMOOTH_COSINE) & (cosine * limit >= 1)
    at, tip = points[1:-1], (before + after)[sharp] / (1 + dot[sharp, None])
    kites = np.stack([0 * tip, before[sharp], tip, after[sharp]], axis=1) + at[sharp, None]
    bent = ~corners[1:-1] & (cosine < MIN_SMOOTH_COSINE)
    angles = turn[bent, None] * np.linspace(0, 1, 9)
    around = np.stack([-before[bent][:, ::-1] * [1, -1], before[bent]], axis=1)
    arcs = np.stack([np.sin(angles), np.cos(angles)], axis=2) @ around
    fans = np.concatenate([at[bent, None], at[bent, None] + arcs], axis=1)
    return np.r_[shapely.polygons(kites), shapely.polygons(fans)]
