"""Sub-paths of a drawing, flattened with a bounded error, and the regions that fills and pens cover."""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely
import svgelements
from numpy.typing import NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array, Integers

if TYPE_CHECKING:
    from orbiflow.tiles.silhouette.readers.svg_shapes import DrawnShape

MAX_POINTS = 200_000
ARC_PIECE = math.tau / 16  # radians of an arc that are one cubic, right to 1e-7 of the radius


class TooManyPoints(Exception):
    """Flattening would make more than `MAX_POINTS` points."""


@dataclass
class SubPath:
    """A connected run of curves from `start`.

    A curve is its control points (K, 2) after the first: 1 of a line, 2 of a quadratic, 3 of a cubic,
    and 3 for each of several cubics in a row, which an elliptic arc is.
    """

    start: Array
    curves: list[Array] = field(default_factory=list[Array])
    closed: bool = False

    @property
    def ends(self) -> Array:
        """Where it begins and where each curve ends (N, 2)."""
        return np.array([self.start, *(control[-1] for control in self.curves)])

    def reach(self) -> Array:
        """Return points (M, 2) that span about as much as its curves do."""
        return np.vstack([self.start, *self.curves])

    def flatten(self, tolerance: float) -> Array:
        """Return the polyline (N, 2) within `tolerance` of the curves. Raises `TooManyPoints`."""
        parts, count = [self.start[None]], 1
        for control in self.curves:
            for piece in np.split(control, range(3, len(control), 3)):
                parts.append(_flattened(np.vstack([parts[-1][-1:], piece]), tolerance))
                count += len(parts[-1])
                if count > MAX_POINTS:
                    raise TooManyPoints
        return np.concatenate(parts)


def _flattened(points: Array, tolerance: float) -> Array:
    """Return points after the first on a Bezier curve, whose polyline is within `tolerance` of it."""
    degree = len(points) - 1
    if degree == 1:
        return points[1:]
    # Bound of the chord error by the second differences: G. Wang, "The subdivision method for
    # finding the intersection between two Bezier curves or surfaces" (1984).
    bend = float(np.hypot(*np.diff(points, n=2, axis=0).T).max())
    steps = math.sqrt(degree * (degree - 1) / 8 * bend / tolerance)
    if not steps <= MAX_POINTS:
        raise TooManyPoints
    t = np.arange(1, max(1, math.ceil(steps)) + 1)[:, None] / max(1, math.ceil(steps))
    level: list[Array] = list(points)
    while len(level) > 1:  # de Casteljau, at all parameters at once
        level = [(1 - t) * a + t * b for a, b in pairwise(level)]
    return level[0]


def sub_paths(shape: svgelements.Shape, matrix: Array) -> list[SubPath]:
    """Return the sub-paths of a shape, mapped by the affine `matrix` (3, 3)."""

    def mapped(*points: svgelements.Point) -> Array:
        xy = np.array([(point.x, point.y) for point in points], dtype=np.float64)
        return xy @ matrix[:2, :2].T + matrix[:2, 2]

    found: list[SubPath] = []
    for segment in svgelements.Path(shape):
        if isinstance(segment, svgelements.Move):
            found.append(SubPath(mapped(segment.end)[0]))
            continue
        if not found or found[-1].closed:
            # After a close without a move the next sub-path begins where the last one began.
            found.append(SubPath(found[-1].start if found else mapped(segment.start)[0]))
        if isinstance(segment, svgelements.Close):
            found[-1].closed = True
        else:
            found[-1].curves.append(mapped(*_control(segment)))
    return [path for path in found if path.curves]


def _control(segment: svgelements.PathSegment) -> list[svgelements.Point]:
    """Return the control points of a segment after the first; an arc of no radius is a line."""
    if isinstance(segment, svgelements.CubicBezier):
        return [segment.control1, segment.control2, segment.end]
    if isinstance(segment, svgelements.QuadraticBezier):
        return [segment.control, segment.end]
    if isinstance(segment, svgelements.Arc) and segment.center not in (segment.prx, segment.pry):
        count = math.ceil(abs(segment.sweep or 0.0) / ARC_PIECE)
        pieces = segment.as_cubic_curves(count)
        return [point for piece in pieces for point in _control(piece)] or [segment.end]
    return [segment.end]


def corners(paths: list[SubPath], matrix: Array) -> Iterator[tuple[str, Array, float]]:
    """Yield "start", "mid" or "end", the point and angle of each corner, mapped by a matrix (3, 3)."""
    found: list[tuple[Array, Array, Array]] = []
    for path in paths:
        is_open = not path.closed or (path.ends[-1] == path.start).all()
        last, into = path.start, [np.zeros(2)]
        out: list[Array] = []
        for control in [*path.curves, *([] if is_open else [path.start[None]])]:
            along = np.diff([last, *control], axis=0)
            out.append(along[along.any(axis=1).argmax()])
            into.append(along[::-1][along[::-1].any(axis=1).argmax()])
            found.append((last, into[-2], out[-1]))
            last = control[-1]
        found.append((last, into[-1], out[0] * path.closed))
        if path.closed:
            found[-len(into)] = (path.start, into[-1], out[0])
    for k, (point, *sides) in enumerate(found):
        key = "start" if k == 0 else "end" if k == len(found) - 1 else "mid"
        before, after = (matrix[:2, :2] @ side for side in sides)
        x, y = before / (np.hypot(*before) or 1.0) + after / (np.hypot(*after) or 1.0)
        yield key, matrix[:2, :2] @ point + matrix[:2, 2], math.atan2(y, x)


# Of pairs of segments whose boxes overlap, in all and for each segment: the crossings of a scribble
# grow with the square of its length.
MAX_OVERLAPS = 200_000
MAX_OVERLAPS_EACH = 20
MAX_OVERLAPS_WIDE = 20  # as many times more of strokes, which are mostly beside each other
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


def check_tangle(segments: Array, half: float = 0.0) -> None:
    """Refuse segments (S, 2, 2), `half` of whose width is given, if a sample has too many overlaps."""
    sample = np.random.default_rng(0).permutation(len(segments))[:_SAMPLE_SIZE]
    for wider, most in ((0.0, 1), (half, MAX_OVERLAPS_WIDE)):
        low, high = segments.min(axis=1) - wider, segments.max(axis=1) + wider
        overlaps = sum(
            np.count_nonzero(((low <= high[i]) & (high >= low[i])).all(axis=1)) for i in sample
        )
        most *= MAX_OVERLAPS + MAX_OVERLAPS_EACH * len(segments)
        if overlaps / len(sample) * len(segments) > most:
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


SIMPLIFICATION_SHARE = 1 / 500  # of half a pen's width: lines are simplified by as much
MIN_SMOOTH_COSINE = 0.999  # the cosine of half the turn above which a corner needs no mitre


class Polyline(NamedTuple):
    """A polyline (N, 2), which of its vertices are corners, not on curves, and whether it is closed."""

    points: Array
    corners: NDArray[np.bool_]
    closed: bool


def stroked(lines: list[Polyline], shape: DrawnShape) -> BaseGeometry:
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


def _dash_unit(lines: list[Polyline], shape: DrawnShape) -> float:
    """Return how long a unit of dashes is: more or less than 1 where an author gives the path's length.

    It is 0 where dashes are longer than any path.
    """
    if shape.path_length is None or not shape.dashes:
        return 1.0
    closed = [np.vstack([p, p[:1]]) if is_closed else p for p, _, is_closed in lines]
    total = sum(float(np.hypot(*np.diff(points, axis=0).T).sum()) for points in closed)
    return total / shape.path_length if shape.path_length > 0 else 0.0


def _pieces(line: Polyline, dashes: list[float], offset: float) -> list[Polyline]:
    """Return the dashes of a line; or its whole, ending where it began if it is closed."""
    points, corners, closed = line
    if closed:
        points, corners = np.vstack([points, points[:1]]), np.r_[corners, corners[:1]]
    steps = np.hypot(*np.diff(points, axis=0).T)
    points, corners = points[np.r_[True, steps > 0]], corners[np.r_[True, steps > 0]]
    if not dashes or len(points) == 1:
        return [
            Polyline(points if len(points) > 1 else np.repeat(points, 2, axis=0), corners, closed)
        ]
    along: Array = np.r_[0.0, np.cumsum(steps[steps > 0])]
    edges: Array = np.r_[0.0, np.cumsum(dashes)]
    total, period = float(along[-1]), float(edges[-1])
    if not (total / period + 2) * len(dashes) < MAX_POINTS:
        raise TooManyPoints
    turns: Array = np.arange(-(offset % period), total, period)[:, None]
    starts: Array = (turns + edges[:-1:2]).ravel()
    ends: Array = (turns + edges[1::2]).ravel()
    shown = (starts < total) & ((ends > 0) | (starts == ends) & (starts >= 0))
    found: list[Polyline] = []
    for start, end in zip(starts[shown].clip(0), ends[shown].clip(max=total), strict=True):
        inner = (along > start) & (along < end)
        at: Array = np.r_[start, along[inner], end]
        both: list[Array] = [np.interp(at, along, points[:, k]) for k in (0, 1)]
        found.append(Polyline(np.stack(both, axis=1), np.r_[True, corners[inner], True], False))
    if closed and len(found) > 1 and (found[0].points[0] == found[-1].points[-1]).all():
        last, first = found.pop(), found[0]  # one dash around the start
        around = np.r_[last.corners[:-1], corners[:1], first.corners[1:]]
        found[0] = Polyline(np.vstack([last.points, first.points[1:]]), around, False)
    return found


def _joins(line: Polyline, half: float, limit: float) -> Array:
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
