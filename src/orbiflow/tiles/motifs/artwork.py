"""Drawings that are carried: their paths as curves, or what a render shows where they are more."""

from __future__ import annotations

import io
import math
from itertools import pairwise
from typing import Literal, Protocol
from xml.etree.ElementTree import Element, tostring
from xml.sax.saxutils import quoteattr

import numpy as np
import shapely
import svgelements
from PIL import Image
from shapely.errors import GEOSException
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array
from orbiflow.errors import InputFileError
from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.page import INK, Curve, PathPart, Style, TooTangled, boundary, fill
from orbiflow.tiles.silhouette import Covered, Drawing, FileContent, Rgba, picture_size

MOST_POINTS = 200_000
"""The most points of all curves of a drawing, flattened."""

MOST_ELEMENTS = 20_000
"""The most elements of a drawing that are read as paths, those drawn again counted again."""

FARTHEST = 1e6
"""The greatest reach of a drawing, in sizes of the silhouette."""

COMPARED_PIXELS = 300
"""The longer side of the pictures by which it is judged whether the paths are all of a drawing."""

MAX_CHANNEL_DIFFERENCE = 64
"""Of 255: a pixel that differs by more shows something else."""

MAX_DIFFERING_SHARE = 0.004
"""Of what is painted: so much may differ, as the ends of fine lines do."""

PICTURE_PIXELS = 3000
"""The longer side of the picture that is carried in place of paths."""

ARC_PIECE = math.tau / 16
"""Radians of an arc that are one cubic, right to 1e-7 of the radius."""

_CURRENT = "#010203"
"""What stands for `currentColor` where no colour is set: that of what shows on what lies below."""

_PEN = ("stroke-linecap", "stroke-linejoin", "stroke-miterlimit")
_CAPS: dict[str, Literal["round", "square"]] = {"round": "round", "square": "square"}
_JOINS: dict[str, Literal["round", "bevel"]] = {"round": "round", "bevel": "bevel"}
_DAMAGED = (
    *(ValueError, TypeError, IndexError, AttributeError, ZeroDivisionError, OverflowError),
    RecursionError,  # of references in a circle
)


class Carry(Protocol):
    """A map of a drawing's points.

    - `size`: The size of the whole, in the units of the images.
    - `scale`: The units of the images in one of the drawing's.
    - `widest`: The widest stroke that stays a line, in the drawing's units.
    - `tolerance`: The greatest distance of flattened curves from the drawing's, in its units.
    """

    size: float
    scale: float
    widest: float
    tolerance: float

    def __call__(self, points: Array, *, closed: bool) -> Array:
        """Return the images (M, 2) of a line's points (N, 2), and of some between them."""
        ...


class TooManyPoints(Exception):
    """Flattening would make more points than a drawing may have."""


class _Line:
    """A sub-path, flattened to points (N, 2), the last of which is not the first again."""

    def __init__(self, points: Array, closed: bool) -> None:
        self.points, self.closed = points, closed

    def string(self) -> BaseGeometry:
        """The line, which ends where it began if it is closed."""
        points = np.vstack([self.points, self.points[:1]]) if self.closed else self.points
        return shapely.LineString(points)


class _Painted:
    """A fill or a stroke of a shape: its lines, and a region where it is no line of a pen."""

    def __init__(self, colour: svgelements.Color, width: float, lines: list[_Line]) -> None:
        self.colour, self.opacity = colour.hexrgb, float(colour.opacity)
        self.width, self.lines, self.pen = width, lines, ""
        self.region: BaseGeometry = shapely.Polygon()


def read_parts(drawing: Drawing, carry: Carry) -> list[PathPart] | None:
    """Return the fills and strokes of a drawing, carried; None if they are not all that is seen of it.

    What is seen is what a renderer shows: clips, masks, gradients, texts, pictures and filters are
    more than fills and strokes, and are found by comparing.

    Raises:
        InputFileError: If the drawing reaches too far, or is too intricate.
    """
    try:
        painted = _painted(drawing, carry)
        if painted is None or not _is_all(drawing, painted):
            return None
        return [part for paint in painted if (part := _part(paint, carry)).curves]
    except (TooManyPoints, TooTangled, GEOSException) as error:
        raise InputFileError(
            f"{drawing.path}: the drawing is too intricate to be carried, or much too long; simplify it"
        ) from error


def page_picture(content: FileContent, covered: Covered, size: tuple[int, int]) -> Image.Image:
    """Return what an SVG drawing shows of a rectangle of its user units, as RGBA pixels.

    Args:
        content: The drawing's file.
        covered: The rectangle, with y down.
        size: The width and height of the picture.

    Raises:
        InputFileError: If it is no drawing, or one that is refused.
    """
    (left, top), (right, bottom) = covered.low.tolist(), covered.high.tolist()
    return Image.fromarray(Drawing(content).pixels((left, top, right, bottom), size))


def whole_picture(drawing: Drawing) -> Image.Image:
    """Return what a drawing shows of its page, as RGBA pixels."""
    assert drawing.box is not None
    return Image.fromarray(drawing.pixels(drawing.box, picture_size(drawing.box, PICTURE_PIXELS)))


def _painted(drawing: Drawing, carry: Carry) -> list[_Painted] | None:
    """Return what is filled and stroked, from bottom to top; None if it cannot be read."""
    root = drawing.document.root
    left, top, right, bottom = drawing.box or (0.0, 0.0, 100.0, 100.0)
    page = {"width": repr(right - left), "height": repr(bottom - top)}
    page["viewBox"] = f"{left!r} {top!r} {right - left!r} {bottom - top!r}"
    before = dict(root.attrib)
    root.attrib.update(page, xmlns="http://www.w3.org/2000/svg", preserveAspectRatio="none")
    try:
        if _count(root) > MOST_ELEMENTS:
            return None
        text = tostring(root, encoding="unicode")
        tree = svgelements.SVG.parse(io.StringIO(text), reify=True, ppi=96, color=_CURRENT)
        shapes = [element for element in tree.elements() if isinstance(element, svgelements.Shape)]
        offset, count = np.array([left, top]), 0
        painted: list[_Painted] = []
        for shape in shapes:
            lines = _lines(shape, offset, carry.tolerance)
            reach = np.concatenate([line.points for line in lines] or [np.zeros((1, 2))])
            if not (np.abs(reach) < FARTHEST * carry.size / carry.scale).all():  # NaN, too
                raise InputFileError(
                    f"{drawing.path}: a path reaches much too far beyond the page; delete or shorten it"
                )
            count += len(reach)
            if count > MOST_POINTS:
                raise TooManyPoints
            painted += _paints(shape, lines, carry)
        return painted
    except _DAMAGED:
        return None
    finally:
        root.attrib.clear()
        root.attrib.update(before)


def _count(root: Element) -> int:
    """Return how many elements are drawn, those that others use counted for each use."""
    by_id = {item.get("id"): item for item in root.iter()}
    counts: dict[Element, int] = {}

    def count(element: Element) -> int:
        if element not in counts:
            counts[element] = 0  # until it is known: one in a circle draws nothing
            used = by_id.get(element.get("href", "")[1:]) if element.tag == "use" else None
            children = [*element] if used is None else [*element, used]
            counts[element] = 1 + sum(map(count, children))
        return counts[element]

    return count(root)


def _paints(shape: svgelements.Shape, lines: list[_Line], carry: Carry) -> list[_Painted]:
    values = shape.values
    if values.get("visibility", "visible") != "visible" or values.get("display") == "none":
        return []
    painted: list[_Painted] = []
    colour = svgelements.Color("black") if values.get("fill") is None else shape.fill
    if colour is not None and colour.value is not None:
        inside = _Painted(colour, 0.0, [])
        rings = [line.points for line in lines if len(line.points) > 2]
        inside.region = fill(rings, values.get("fill-rule", "nonzero"))
        painted.append(inside)
    width = float(shape.stroke_width or 0.0)
    if shape.stroke is not None and shape.stroke.value is not None and width > 0:
        pen = _Painted(shape.stroke, width, [line for line in lines if len(line.points) > 1])
        shown = ((key, values[key]) for key in _PEN if isinstance(values.get(key), str))
        pen.pen = "".join(f" {key}={quoteattr(value)}" for key, value in shown)
        keeps_width = values.get("vector-effect") == "non-scaling-stroke"
        if width > carry.widest and pen.lines and not keeps_width:
            cap, join = values.get("stroke-linecap", ""), values.get("stroke-linejoin", "")
            pen.region = shapely.union_all(
                shapely.buffer(
                    [line.string() for line in pen.lines],
                    width / 2,
                    cap_style=_CAPS.get(cap, "flat"),
                    join_style=_JOINS.get(join, "mitre"),
                    mitre_limit=float(values.get("stroke-miterlimit", 4)),
                )
            )
            pen.lines = []
        painted.append(pen)
    opacity = float(values.get("opacity", 1.0))
    for paint in painted:
        paint.opacity *= opacity
    return [paint for paint in painted if paint.opacity > 0]


def _lines(shape: svgelements.Shape, offset: Array, tolerance: float) -> list[_Line]:
    """Return the sub-paths of a shape within a tolerance of their curves."""
    runs: list[tuple[list[Array], bool]] = []
    for segment in svgelements.Path(shape):
        if isinstance(segment, svgelements.Move):
            runs.append(([_points([segment.end])], False))
            continue
        if not runs or runs[-1][1]:  # after a close without a move, from where the last one began
            runs.append(([runs[-1][0][0][:1] if runs else _points([segment.start])], False))
        parts = runs[-1][0]
        if isinstance(segment, svgelements.Close):
            runs[-1] = parts, True
            continue
        controls = _control(segment)
        for piece in [controls[k : k + 3] for k in range(0, len(controls), 3)]:
            parts.append(_flattened(np.vstack([parts[-1][-1:], _points(piece)]), tolerance))
    lines = [(np.concatenate(parts) + offset, closed) for parts, closed in runs if len(parts) > 1]
    ended = [closed and len(points) > 2 and bool((points[0] == points[-1]).all())
             for points, closed in lines]  # fmt: skip
    return [
        _Line(points[:-1] if again else points, closed)
        for (points, closed), again in zip(lines, ended, strict=True)
    ]


def _points(points: list[svgelements.Point]) -> Array:
    return np.array([(point.x, point.y) for point in points], dtype=np.float64)


def _control(segment: svgelements.PathSegment) -> list[svgelements.Point]:
    """Return the control points of a segment after the first; an arc of no radius is a line."""
    if isinstance(segment, svgelements.CubicBezier):
        return [segment.control1, segment.control2, segment.end]
    if isinstance(segment, svgelements.QuadraticBezier):
        return [segment.control, segment.end]
    if isinstance(segment, svgelements.Arc) and segment.center not in (segment.prx, segment.pry):
        pieces = segment.as_cubic_curves(math.ceil(abs(segment.sweep or 0.0) / ARC_PIECE))
        return [point for piece in pieces for point in _control(piece)] or [segment.end]
    return [segment.end]


def _flattened(points: Array, tolerance: float) -> Array:
    """Return points after the first on a Bezier curve, whose polyline is within `tolerance` of it."""
    degree = len(points) - 1
    if degree == 1:
        return points[1:]
    # Bound of the chord error by the second differences: G. Wang, "The subdivision method for
    # finding the intersection between two Bezier curves or surfaces" (1984).
    bend = float(np.hypot(*np.diff(points, n=2, axis=0).T).max())
    steps = math.sqrt(degree * (degree - 1) / 8 * bend / tolerance)
    if not steps <= MOST_POINTS:
        raise TooManyPoints
    t = np.arange(1, max(1, math.ceil(steps)) + 1)[:, None] / max(1, math.ceil(steps))
    level: list[Array] = list(points)
    while len(level) > 1:  # de Casteljau, at all parameters at once
        level = [(1 - t) * a + t * b for a, b in pairwise(level)]
    return level[0]


def _is_all(drawing: Drawing, painted: list[_Painted]) -> bool:
    """Whether fills and strokes show what the drawing shows."""
    window = drawing.box or (0.0, 0.0, 100.0, 100.0)
    size = picture_size(window, COMPARED_PIXELS)
    body = "".join(map(_svg, painted))
    text = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1 1">{body}</svg>'
    alone = Drawing(FileContent(text.encode(), str(drawing.path)))
    alone.box = None  # so that it is drawn in the units of the other
    drawn, other = (_on_gray(each.pixels(window, size)) for each in (drawing, alone))
    apart = np.abs(drawn - other).max(axis=-1) > MAX_CHANNEL_DIFFERENCE
    whole = drawing.pixels(window, size)[..., 3] > 0
    return bool(apart.sum() <= MAX_DIFFERING_SHARE * max(whole.sum(), 1) + 2)


def _on_gray(pixels: Rgba) -> Array:
    opacity = pixels[..., 3:] / 255
    return pixels[..., :3] * opacity + 128 * (1 - opacity)


def _svg(painted: _Painted) -> str:
    """Return what is painted as an element of SVG."""
    style = f'fill="{painted.colour}" fill-opacity="{painted.opacity:g}" fill-rule="evenodd"'
    rings = [
        shapely.get_coordinates(ring)
        for polygon in polygons_in(painted.region)
        for ring in (polygon.exterior, *polygon.interiors)
    ]
    if painted.lines:
        style = f'fill="none" stroke="{painted.colour}" stroke-width="{painted.width:.9g}"'
        style += f' stroke-opacity="{painted.opacity:g}"{painted.pen}'
        rings = [shapely.get_coordinates(line.string()) for line in painted.lines]
    texts = ("M" + " ".join(f"{x:.9g},{y:.9g}" for x, y in ring.tolist()) for ring in rings)
    return f'<path d="{"".join(texts)}" {style}/>'


def _part(painted: _Painted, carry: Carry) -> PathPart:
    """Return a fill or a stroke, carried."""
    colour = INK if painted.colour == _CURRENT else painted.colour
    if painted.lines:
        style = Style(None, colour, painted.width * carry.scale)
        curves = [
            Curve.polyline(carry(line.points, closed=line.closed), closed=line.closed)
            for line in painted.lines
        ]
        return PathPart(tuple(curves), style, painted.opacity)
    curves: list[Curve] = []
    for polygon in polygons_in(painted.region):
        rings = [
            shapely.get_coordinates(ring)[:-1] for ring in (polygon.exterior, *polygon.interiors)
        ]
        outer, *holes = (carry(ring, closed=True) for ring in rings)
        curves += boundary(shapely.Polygon(outer, holes))
    return PathPart(tuple(curves), Style(colour), painted.opacity)
