"""The regions of the plane that the fills, strokes, clips and masks of a drawing cover."""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

from collections.abc import Callable, Iterable
from itertools import groupby
from typing import Literal, NamedTuple

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array
from orbiflow.drawing import rgb
from orbiflow.errors import InputFileError
from orbiflow.tiles.silhouette.outlines import MAX_COORDINATE
from orbiflow.tiles.silhouette.readers.svg_paint import Brush, brushes
from orbiflow.tiles.silhouette.readers.svg_paths import (
    MAX_POINTS,
    SubPath,
    TooManyPoints,
    check_tangle,
    fill,
)
from orbiflow.tiles.silhouette.readers.svg_shapes import Clip, Drawing, DrawnShape, Pen

CAPS: dict[str, Literal["flat", "round", "square"]] = {
    "butt": "flat",
    "round": "round",
    "square": "square",
}
WIGGLE = 1 / 500  # of half a pen's width: lines are simplified by as much
SMOOTH = 0.999  # the cosine of half the turn above which a corner needs no mitre
FINER = 8  # the paths of strokes are flattened as much finer, as a wide pen magnifies what is left


class Layer(NamedTuple):
    """A region that is painted, and with what."""

    region: BaseGeometry
    brush: Brush


class Regions:
    """The regions that a drawing's shapes cover.

    Paths are flattened to within `tolerance`, a function of points that span them, and come to `most`
    points at most.
    """

    def __init__(self, drawing: Drawing, tolerance: Callable[[Array], float], most: int) -> None:
        self.drawing, self.tolerance, self.most = drawing, tolerance, most
        self._clips: dict[Clip, BaseGeometry] = {}
        self._count = 0

    def lines(self, shape: DrawnShape, finer: float = 1.0) -> list[tuple[Array, SubPath]]:
        """Return each sub-path of a shape with its polyline (N, 2)."""
        if not shape.paths:
            return []
        reach = np.concatenate([path.reach() for path in shape.paths])
        if not (np.abs(reach) <= MAX_COORDINATE).all():  # NaN, too
            reason = f"a path reaches beyond {MAX_COORDINATE:g} user units; rescale the drawing"
            raise InputFileError(f"{self.drawing.path}: {reason}")
        tolerance = self.tolerance(reach) / finer
        if not tolerance > 0:
            return []
        lines = [(path.flatten(tolerance), path) for path in shape.paths]
        self._count += sum(len(points) for points, _ in lines)
        if self._count > self.most:
            raise TooManyPoints
        return lines

    def fill(self, shape: DrawnShape, rule: str = "fill-rule") -> BaseGeometry:
        """Return what the fill of a shape covers, before clips."""
        rings = [points for points, _ in self.lines(shape)]
        return fill(rings, shape.paint.get(rule, "nonzero").strip().lower())

    def stroke(self, shape: DrawnShape) -> BaseGeometry:
        """Return what the stroke of a shape covers, before clips."""
        pen, linear, offset = shape.pen, shape.matrix[:2, :2], shape.matrix[:2, 2]
        back = np.linalg.inv(linear).T
        lines = [
            ((points - offset) @ back, path.closed) for points, path in self.lines(shape, FINER)
        ]
        region = stroked(lines, pen)
        return shapely.transform(region, lambda points: points @ linear.T + offset)

    def clipped(self, shape: DrawnShape, region: BaseGeometry) -> BaseGeometry:
        """Return the part of a region that the clips and masks of a shape leave."""
        for clip in shape.clips:
            if clip not in self._clips:
                self._clips[clip] = self._clip(clip)
            if not self._clips[clip].covers(region):
                region = shapely.intersection(region, self._clips[clip])
        return region

    def layers(self, shape: DrawnShape) -> list[Layer]:
        """Return what a shape paints, from bottom to top."""
        of = {"fill": self.fill, "stroke": self.stroke}
        found = [
            Layer(self.clipped(shape, of[kind](shape)), brush)
            for kind, brush in brushes(self.drawing, shape).items()
        ]
        return [layer for layer in found if layer.region.area > 0]

    def _clip(self, clip: Clip) -> BaseGeometry:
        if clip.kind == "clip":
            shapes = (s for s in clip.shapes if s.paint.get("visibility") != "hidden")
            return shapely.union_all(
                [self.clipped(shape, self.fill(shape, "clip-rule")) for shape in shapes]
            )

        def effect(layer: Layer) -> int:
            colour, opacity = layer.brush
            light = 1.0 if clip.kind == "alpha" else lightness(colour)
            return 1 if light * opacity >= 0.5 else -1 if opacity > 0.5 else 0

        return painted([layer for shape in clip.shapes for layer in self.layers(shape)], effect)


def lightness(colour: str) -> float:
    """Return how light a colour is, from 0 to 1."""
    return float(np.dot(rgb(colour), [0.2126, 0.7152, 0.0722])) / 255 if colour[0] == "#" else 0.0


def painted(
    layers: Iterable[Layer], effect: Callable[[Layer], int], grid: float | None = None
) -> BaseGeometry:
    """Paint layers one over the other, and return the region that is left.

    `effect` says whether a layer adds its region (1), takes it away (-1) or changes nothing (0).
    """
    found: BaseGeometry = Polygon()
    acting = ((effect(layer), layer.region) for layer in layers)
    for sign, run in groupby(((s, r) for s, r in acting if s), key=lambda pair: pair[0]):
        regions = [region for _, region in run]
        if sign > 0:
            regions += [found] * (not found.is_empty)
            found = shapely.union_all(regions, grid_size=grid)
        elif not found.is_empty:
            away = shapely.union_all(regions, grid_size=grid)
            found = shapely.difference(found, away, grid_size=grid)
    return found


def stroked(lines: list[tuple[Array, bool]], pen: Pen) -> BaseGeometry:
    """Return the region that a pen covers along polylines (N, 2), each with whether it is closed."""
    half = pen.width / 2
    pieces = [piece for points, closed in lines for piece in _pieces(points, closed, pen)]
    if not pieces or not all(np.isfinite(points).all() for points, _ in pieces):
        return Polygon()
    cap = CAPS.get(pen.cap, "flat")
    join = "round" if pen.join == "round" else "bevel"
    strings = [shapely.LineString(points) for points, _ in pieces]
    simple = shapely.simplify(strings, WIGGLE * half)
    runs = [shapely.get_coordinates(line) for line in simple]
    check_tangle(np.concatenate([np.stack([p[:-1], p[1:]], axis=1) for p in runs]), half)
    regions = [shapely.buffer(simple, half, cap_style=cap, join_style=join)]
    if pen.join not in ("round", "bevel"):
        regions += [_mitres(*piece, half, pen.miter_limit) for piece in pieces if len(piece[0]) > 2]
    return shapely.union_all(np.concatenate(regions))


def _pieces(points: Array, closed: bool, pen: Pen) -> list[tuple[Array, bool]]:
    """Return the dashes of a polyline; or its whole, ending where it began if it is closed."""
    points = np.vstack([points, points[:1]]) if closed else points
    steps = np.hypot(*np.diff(points, axis=0).T)
    points = points[np.r_[True, steps > 0]]
    if not pen.dashes:
        return [(points if len(points) > 1 else np.repeat(points, 2, axis=0), closed)]
    along: Array = np.r_[0.0, np.cumsum(steps[steps > 0])]
    edges: Array = np.r_[0.0, np.cumsum(pen.dashes)]
    total, period = float(along[-1]), float(edges[-1])
    if not (total / period + 2) * len(pen.dashes) < MAX_POINTS:
        raise TooManyPoints
    first = -(pen.offset % period)
    turns: Array = np.arange(first, total, period)[:, None]
    starts: Array = (turns + edges[:-1:2]).ravel()
    ends: Array = (turns + edges[1::2]).ravel()
    shown = (starts < total) & ((ends > 0) | (starts == ends) & (starts >= 0))
    return [
        (_between(points, along, max(start, 0.0), min(end, total)), False)
        for start, end in zip(starts[shown].tolist(), ends[shown].tolist(), strict=True)
    ]


def _between(points: Array, along: Array, start: float, end: float) -> Array:
    """Return the part of a polyline (N, 2) between two arc lengths."""
    at: Array = np.r_[start, along[(along > start) & (along < end)], end]
    both: list[Array] = [np.interp(at, along, points[:, k]) for k in (0, 1)]
    return np.stack(both, axis=1)


def _mitres(points: Array, closed: bool, half: float, limit: float) -> Array:
    """Return polygons that sharpen the bevelled corners of a polyline (N, 2), within the limit."""
    if closed:
        points = np.vstack([points, points[1:2]])
    along = np.diff(points, axis=0)
    along /= np.hypot(*along.T)[:, None]
    first, last = along[:-1], along[1:]
    dot = (first * last).sum(axis=1)
    cosine = np.sqrt(np.maximum(1 + dot, 0) / 2)  # of half the turn
    sharp = (cosine * limit >= 1) & (cosine < SMOOTH)
    outward = -half * np.sign(first[:, 0] * last[:, 1] - first[:, 1] * last[:, 0])[sharp, None]
    before, after = (outward * side[sharp][:, ::-1] * [-1, 1] for side in (first, last))
    corner, tip = points[1:-1][sharp], (before + after) / (1 + dot[sharp, None])
    tips = np.stack([corner, corner + before, corner + tip, corner + after], axis=1)
    return np.asarray(shapely.polygons(tips))
