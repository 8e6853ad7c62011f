"""Sub-paths of an SVG drawing and their flattening into polygons with a bounded error."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import shapely
import svgelements
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array, Integers

MAX_POINTS = 200_000
DIRECTION_TOLERANCE = 1e-6  # of a curve's size: its chords at the ends stray by less


class TooManyPoints(Exception):
    """Flattening would make more than `MAX_POINTS` points."""


@dataclass(frozen=True)
class Bezier:
    """A line, quadratic or cubic: its control points after the first, (1, 2, or 3; 2)."""

    control: Array

    @property
    def end(self) -> Array:
        return self.control[-1]

    def reach(self) -> Array:
        """Return control points: they span as much as the curve, but for a small factor."""
        return self.control

    def flatten(self, start: Array, tolerance: float) -> Array:
        """Return points after `start`, on the curve, whose polyline is within `tolerance` of it."""
        if len(self.control) == 1:
            return self.control
        points = np.vstack([start, self.control])
        degree = len(self.control)
        # Bound of the chord error by the second differences: G. Wang, "The subdivision method for
        # finding the intersection between two Bezier curves or surfaces" (1984).
        bend = float(np.hypot(*np.diff(points, n=2, axis=0).T).max())
        steps = _steps(math.sqrt(degree * (degree - 1) / 8 * bend / tolerance))
        t = np.arange(1, steps + 1)[:, None] / steps
        level: list[Array] = list(points)
        while len(level) > 1:  # de Casteljau, at all parameters at once
            level = [(1 - t) * a + t * b for a, b in pairwise(level)]
        return level[0]


@dataclass(frozen=True)
class EllipticArc:
    """Points `centre + cos(t) u + sin(t) v`, t from `t0` over `sweep` radians, up to `end`."""

    centre: Array
    u: Array
    v: Array
    t0: float
    sweep: float
    end: Array

    def reach(self) -> Array:
        """Return the middle and the end of the arc."""
        t = self.t0 + self.sweep / 2
        return np.stack([self.centre + np.cos(t) * self.u + np.sin(t) * self.v, self.end])

    def flatten(self, start: Array, tolerance: float) -> Array:  # noqa: ARG002
        """Return points after the first, on the arc, whose polyline is within `tolerance` of it."""
        radius = math.hypot(*self.u, *self.v)
        half_step = math.acos(max(1 - tolerance / radius, 0.0)) if radius > 0 else math.pi
        steps = _steps(abs(self.sweep) / max(2 * half_step, 1e-9))
        t = self.t0 + self.sweep * np.arange(1, steps + 1)[:, None] / steps
        points = self.centre + np.cos(t) * self.u + np.sin(t) * self.v
        points[-1] = self.end
        return points


def _steps(needed: float) -> int:
    if not needed <= MAX_POINTS:
        raise TooManyPoints
    return max(1, math.ceil(needed))


@dataclass
class SubPath:
    """A connected run of curves from `start`."""

    start: Array
    curves: list[Bezier | EllipticArc] = field(default_factory=list[Bezier | EllipticArc])
    closed: bool = False

    def gap(self) -> float:
        """Return the distance of the last point from the first."""
        return float(np.hypot(*(self.curves[-1].end - self.start)))

    def reach(self) -> Array:
        """Return points (M, 2) that span about as much as its curves do."""
        return np.vstack([self.start, *(curve.reach() for curve in self.curves)])

    def flatten(self, tolerance: float) -> Array:
        """Return the polyline (N, 2) within `tolerance` of the curves. Raises `TooManyPoints`."""
        parts, last, count = [self.start[None]], self.start, 1
        for curve in self.curves:
            parts.append(curve.flatten(last, tolerance))
            last = curve.end
            count += len(parts[-1])
            if count > MAX_POINTS:
                raise TooManyPoints
        return np.concatenate(parts)


def sub_paths(path: svgelements.Path, matrix: Array) -> list[SubPath]:
    """Return the sub-paths of `path`, mapped by the affine `matrix` (2, 3)."""

    def mapped(*points: svgelements.Point) -> Array:
        xy = np.array([(point.x, point.y) for point in points], dtype=np.float64)
        return xy @ matrix[:, :2].T + matrix[:, 2]

    found: list[SubPath] = []
    for segment in path:
        if isinstance(segment, svgelements.Move):
            found.append(SubPath(mapped(segment.end)[0]))
            continue
        if not found or found[-1].closed:
            # After a close without a move the next sub-path begins where the last one began.
            found.append(SubPath(found[-1].start if found else mapped(segment.start)[0]))
        if isinstance(segment, svgelements.Close):
            found[-1].closed = True
        elif isinstance(segment, svgelements.Arc):
            centre, u, v, end = mapped(segment.center, segment.prx, segment.pry, segment.end)
            if segment.center in (segment.prx, segment.pry):  # an arc of no radius is a line
                found[-1].curves.append(Bezier(end[None]))
                continue
            t0, sweep = float(segment.get_start_t()), float(segment.sweep or 0.0)
            arc = EllipticArc(centre, u - centre, v - centre, t0, sweep, end)
            found[-1].curves.append(arc)
        elif isinstance(segment, svgelements.CubicBezier):
            control = mapped(segment.control1, segment.control2, segment.end)
            found[-1].curves.append(Bezier(control))
        elif isinstance(segment, svgelements.QuadraticBezier):
            found[-1].curves.append(Bezier(mapped(segment.control, segment.end)))
        else:
            found[-1].curves.append(Bezier(mapped(segment.end)))
    return [path for path in found if path.curves]


def corners(paths: list[SubPath], matrix: Array) -> Iterator[tuple[str, Array, float]]:
    """Yield "start", "mid" or "end", the point and angle of each corner, mapped by a matrix (2, 3)."""
    found: list[tuple[Array, Array, Array]] = []
    for path in paths:
        close = [Bezier(path.start[None])] * (path.closed and path.gap() > 0)
        last, into = path.start, [np.zeros(2)]
        out: list[Array] = []
        for curve in [*path.curves, *close]:
            size = float(np.ptp([last, *curve.reach()], axis=0).max()) or 1.0
            along = np.diff([last, *curve.flatten(last, DIRECTION_TOLERANCE * size)], axis=0)
            out.append(along[along.any(axis=1).argmax()])
            into.append(along[::-1][along[::-1].any(axis=1).argmax()])
            found.append((last, into[-2], out[-1]))
            last = curve.end
        found.append((last, into[-1], out[0] * path.closed))
        if path.closed:
            found[-len(into)] = (path.start, into[-1], out[0])
    for k, (point, *sides) in enumerate(found):
        key = "start" if k == 0 else "end" if k == len(found) - 1 else "mid"
        before, after = (matrix[:, :2] @ side for side in sides)
        x, y = before / (np.hypot(*before) or 1.0) + after / (np.hypot(*after) or 1.0)
        yield key, matrix[:, :2] @ point + matrix[:, 2], math.atan2(y, x)


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
