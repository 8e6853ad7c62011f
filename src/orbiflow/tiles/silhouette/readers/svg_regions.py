"""The regions of the plane that a drawing paints, cut by its clips and masks, and their colours."""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

from collections.abc import Callable
from itertools import groupby
from typing import NamedTuple

import numpy as np
import shapely
import svgelements
from numpy.typing import NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array
from orbiflow.drawing import rgb
from orbiflow.errors import InputFileError
from orbiflow.tiles.geometry import complex_points
from orbiflow.tiles.silhouette.outlines import MAX_COORDINATE
from orbiflow.tiles.silhouette.readers.svg_paths import (
    MAX_POINTS,
    SubPath,
    TooManyPoints,
    check_tangle,
    fill,
)
from orbiflow.tiles.silhouette.readers.svg_shapes import Clip, Drawing, DrawnShape, as_number

WIGGLE = 1 / 500  # of half a pen's width: lines are simplified by as much
SMOOTH = 0.999  # the cosine of half the turn above which a corner needs no mitre
FINER = 8  # the paths of strokes are flattened as much finer, as a wide pen magnifies what is left

CURRENT = "currentColor"
"""The colour of what is drawn in `currentColor` where no colour is set."""


class Brush(NamedTuple):
    """A colour, #rrggbb or `CURRENT`, and its opacity, 0 to 1."""

    colour: str
    opacity: float


def brushes(drawing: Drawing, shape: DrawnShape) -> dict[str, Brush]:
    """Return what paints the "fill" and "stroke" of a shape, without what does not show, in order."""
    if shape.paint.get("visibility") in ("hidden", "collapse"):
        return {}
    found: dict[str, Brush] = {}
    order = shape.paint.get("paint-order", "fill").split()
    for kind in ("stroke", "fill") if "stroke" in order[:1] else ("fill", "stroke"):
        text = shape.paint.get(kind, "#000000" if kind == "fill" else "none")
        brush = _brush(text, drawing, shape.paint.get("color", CURRENT))
        if brush and (kind == "fill" or shape.width > 0):
            own = min(max(as_number(shape.paint.get(f"{kind}-opacity"), 1.0), 0.0), 1.0)
            found[kind] = Brush(brush.colour, shape.opacity * brush.opacity * own)
    return {kind: brush for kind, brush in found.items() if brush.opacity > 0}


def _brush(text: str, drawing: Drawing, current: str) -> Brush | None:
    text = text.strip()
    if text.lower() in ("none", "transparent", ""):
        return None
    if text.lower() == CURRENT.lower():
        # without a colour it is the one that shows on what lies below
        return Brush(CURRENT, 1.0) if current.lower() == CURRENT.lower() else _colour(current)
    if text.startswith("url("):
        return _gradient(text, drawing) or _brush(text.partition(")")[2], drawing, current)
    return _colour(text)


def _colour(text: str) -> Brush:
    try:
        colour = svgelements.Color(text[:60])
        red, green, blue = (int(getattr(colour, name)) for name in ("red", "green", "blue"))
        return Brush(f"#{red:02x}{green:02x}{blue:02x}", float(colour.opacity or 0.0))
    except (ValueError, TypeError, AttributeError):
        return Brush("#000000", 1.0)


def _gradient(text: str, drawing: Drawing) -> Brush | None:
    """Return the mean colour of a gradient's stops; a pattern is gray."""
    element = drawing.referred(text)
    for _ in range(5):  # gradients may refer to each other for their stops
        if element is None or any(child.tag == "stop" for child in element):
            break
        if element.tag == "pattern":
            return Brush("#808080", 1.0)
        element = drawing.by_id.get(element.get("href", "").strip().removeprefix("#"))
    if element is None:
        return None
    stops = [drawing.styles.properties(child) for child in element if child.tag == "stop"]
    colours = [_colour(stop.get("stop-color", "#000000")).colour for stop in stops]
    if not colours:
        return None
    red, green, blue = np.mean([rgb(colour) for colour in colours], axis=0).round().astype(int)
    return Brush(f"#{red:02x}{green:02x}{blue:02x}", 1.0)


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
        linear, offset = shape.matrix[:2, :2], shape.matrix[:2, 2]
        back = np.linalg.inv(linear).T
        lines: list[Line] = []
        for points, path in self.lines(shape, FINER):
            ends = np.array([path.start, *(curve.end for curve in path.curves)])
            corners = np.isin(complex_points(points), complex_points(ends))
            lines.append(Line((points - offset) @ back, corners, path.closed))
        region = stroked(lines, shape)
        return shapely.transform(region, lambda points: points @ linear.T + offset)

    def clipped(self, shape: DrawnShape, region: BaseGeometry) -> BaseGeometry:
        """Return the part of a region that the clips and masks of a shape leave."""
        for clip in shape.clips:
            if clip not in self._clips:
                self._clips[clip] = self._clip(clip)
            if not self._clips[clip].covers(region):
                region = shapely.intersection(region, self._clips[clip])
        return region

    def has_plain_stroke(self, shape: DrawnShape) -> bool:
        """Return whether a shape's stroke is one whole line, everywhere as wide as the pen."""
        most, least = np.linalg.svd(shape.matrix[:2, :2])[1]
        if shape.dashes or most - least >= 1e-3 * most:
            return False
        return not shape.clips or self.clipped(shape, whole := self.stroke(shape)) is whole

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

        layers = [layer for shape in clip.shapes for layer in self.layers(shape)]
        return painted(layers, [_shows(layer.brush, clip.kind) for layer in layers])


def _shows(brush: Brush, kind: str) -> int:
    """Return whether paint on a mask shows what is masked (1), hides it (-1) or neither (0)."""
    opacity = brush.opacity * (1.0 if kind == "alpha" else lightness(brush.colour))
    return 1 if opacity >= 0.5 else -1 if brush.opacity > 0.5 else 0


def lightness(colour: str) -> float:
    """Return how light a colour is, from 0 to 1."""
    return float(np.dot(rgb(colour), [0.2126, 0.7152, 0.0722])) / 255 if colour[0] == "#" else 0.0


def painted(layers: list[Layer], signs: list[int], grid: float | None = None) -> BaseGeometry:
    """Paint layers in turn, which add their region (sign 1), take it away (-1) or do nothing (0)."""
    found: BaseGeometry = Polygon()
    acting = [(sign, layer) for sign, layer in zip(signs, layers, strict=True) if sign]
    for sign, run in groupby(acting, key=lambda pair: pair[0]):
        regions = [layer.region for _, layer in run]
        if sign > 0:
            regions += [found] * (not found.is_empty)
            found = shapely.union_all(regions, grid_size=grid)
        elif not found.is_empty:
            away = shapely.union_all(regions, grid_size=grid)
            found = shapely.difference(found, away, grid_size=grid)
    return found


class Line(NamedTuple):
    """A polyline (N, 2), which of its vertices are corners, not on curves, and whether it is closed."""

    points: Array
    corners: NDArray[np.bool_]
    closed: bool


def stroked(lines: list[Line], shape: DrawnShape) -> BaseGeometry:
    """Return the region that a shape's pen covers along polylines."""
    half, dashes = shape.width / 2, shape.dashes
    offset, limit = shape.number("stroke-dashoffset", 0.0), shape.number("stroke-miterlimit", 4.0)
    pieces = [piece for line in lines for piece in _pieces(line, dashes, offset)]
    if not pieces or not all(np.isfinite(piece.points).all() for piece in pieces):
        return Polygon()
    cap = shape.paint.get("stroke-linecap")
    cap = cap if cap == "round" or cap == "square" else "flat"
    corner = shape.paint.get("stroke-linejoin", "miter")
    join = "round" if corner == "round" else "bevel"
    strings = [shapely.LineString(piece.points) for piece in pieces]
    simple = shapely.simplify(strings, WIGGLE * half)
    runs = [shapely.get_coordinates(line) for line in simple]
    check_tangle(np.concatenate([np.stack([p[:-1], p[1:]], axis=1) for p in runs]), half)
    regions = [shapely.buffer(simple, half, cap_style=cap, join_style=join)]
    if join == "bevel":
        limit *= corner != "bevel"
        regions += [_joins(piece, half, limit) for piece in pieces if len(piece.points) > 2]
    return shapely.union_all(np.concatenate(regions))


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
    sharp = corners[1:-1] & (cosine < SMOOTH) & (cosine * limit >= 1)
    at, tip = points[1:-1], (before + after)[sharp] / (1 + dot[sharp, None])
    kites = np.stack([0 * tip, before[sharp], tip, after[sharp]], axis=1) + at[sharp, None]
    bent = ~corners[1:-1] & (cosine < SMOOTH)
    angles = turn[bent, None] * np.linspace(0, 1, 9)
    around = np.stack([-before[bent][:, ::-1] * [1, -1], before[bent]], axis=1)
    arcs = np.stack([np.sin(angles), np.cos(angles)], axis=2) @ around
    fans = np.concatenate([at[bent, None], at[bent, None] + arcs], axis=1)
    return np.r_[shapely.polygons(kites), shapely.polygons(fans)]
