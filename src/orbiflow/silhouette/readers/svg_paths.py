"""Sub-paths of an SVG drawing and their flattening into polygons with a bounded error."""

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import svgelements
from numpy.typing import NDArray

MAX_POINTS = 200_000


class TooManyPoints(Exception):
    """Flattening would make more than `MAX_POINTS` points."""


@dataclass(frozen=True)
class Bezier:
    """A line, quadratic or cubic: its control points after the first, (1, 2, or 3; 2)."""

    control: NDArray[np.float64]

    @property
    def end(self) -> NDArray[np.float64]:
        return self.control[-1]

    def reach(self) -> NDArray[np.float64]:
        """Control points: they span as much as the curve, but for a small factor."""
        return self.control

    def flatten(self, start: NDArray[np.float64], tolerance: float) -> NDArray[np.float64]:
        """Points after `start`, on the curve, whose polyline is within `tolerance` of it."""
        if len(self.control) == 1:
            return self.control
        points = np.vstack([start, self.control])
        degree = len(self.control)
        # Bound of the chord error by the second differences: G. Wang, "The subdivision method for
        # finding the intersection between two Bezier curves or surfaces" (1984).
        bend = float(np.hypot(*np.diff(points, n=2, axis=0).T).max())
        steps = _steps(math.sqrt(degree * (degree - 1) / 8 * bend / tolerance))
        t = np.arange(1, steps + 1)[:, None] / steps
        level: list[NDArray[np.float64]] = list(points)
        while len(level) > 1:  # de Casteljau, at all parameters at once
            level = [(1 - t) * a + t * b for a, b in pairwise(level)]
        return level[0]


@dataclass(frozen=True)
class EllipticArc:
    """Points `centre + cos(t) u + sin(t) v`, t from `t0` over `sweep` radians, up to `end`."""

    centre: NDArray[np.float64]
    u: NDArray[np.float64]
    v: NDArray[np.float64]
    t0: float
    sweep: float
    end: NDArray[np.float64]

    def reach(self) -> NDArray[np.float64]:
        """The middle and the end of the arc."""
        t = self.t0 + self.sweep / 2
        return np.stack([self.centre + np.cos(t) * self.u + np.sin(t) * self.v, self.end])

    def flatten(self, start: NDArray[np.float64], tolerance: float) -> NDArray[np.float64]:  # noqa: ARG002
        """Points after the first, on the arc, whose polyline is within `tolerance` of it."""
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

    start: NDArray[np.float64]
    curves: list[Bezier | EllipticArc] = field(default_factory=list[Bezier | EllipticArc])
    closed: bool = False

    def reach(self) -> NDArray[np.float64]:
        """Points (M, 2) that span about as much as its curves do."""
        return np.vstack([self.start, *(curve.reach() for curve in self.curves)])

    def flatten(self, tolerance: float) -> NDArray[np.float64]:
        """Polyline (N, 2) within `tolerance` of the curves. Raises `TooManyPoints`."""
        parts, last, count = [self.start[None]], self.start, 1
        for curve in self.curves:
            parts.append(curve.flatten(last, tolerance))
            last = curve.end
            count += len(parts[-1])
            if count > MAX_POINTS:
                raise TooManyPoints
        return np.concatenate(parts)


def sub_paths(path: svgelements.Path, matrix: NDArray[np.float64]) -> list[SubPath]:
    """The sub-paths of `path`, mapped by the affine `matrix` (2, 3)."""

    def mapped(*points: svgelements.Point) -> NDArray[np.float64]:
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
            frame = mapped(segment.center, segment.prx, segment.pry, segment.end)
            found[-1].curves.append(_arc(segment, frame))
        elif isinstance(segment, svgelements.CubicBezier):
            control = mapped(segment.control1, segment.control2, segment.end)
            found[-1].curves.append(Bezier(control))
        elif isinstance(segment, svgelements.QuadraticBezier):
            found[-1].curves.append(Bezier(mapped(segment.control, segment.end)))
        else:
            found[-1].curves.append(Bezier(mapped(segment.end)))
    return [path for path in found if path.curves]


def _arc(arc: svgelements.Arc, points: NDArray[np.float64]) -> Bezier | EllipticArc:
    centre, u_end, v_end, end = points
    if arc.center == arc.prx or arc.center == arc.pry:
        return Bezier(end[None])  # an arc of no radius is a line
    t0, sweep = float(arc.get_start_t()), float(arc.sweep or 0.0)
    return EllipticArc(centre, u_end - centre, v_end - centre, t0, sweep, end)
