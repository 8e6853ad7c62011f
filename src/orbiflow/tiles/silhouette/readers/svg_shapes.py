"""The shapes that a drawing shows: their geometry, where they stand, and how they are painted."""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from xml.etree.ElementTree import Element

import numpy as np
import svgelements

from orbiflow.arrays import Array, Window
from orbiflow.tiles.silhouette.outlines import MAX_COORDINATE
from orbiflow.tiles.silhouette.readers.svg_css import Style
from orbiflow.tiles.silhouette.readers.svg_paths import SubPath, sub_paths
from orbiflow.tiles.silhouette.readers.svg_values import (
    FONT_SIZE,
    as_number,
    length,
    shift,
    without_font_units,
)

MAX_DASHES = 1000  # lengths in one pattern
BOX_FLATNESS = 1e-4  # of the size of a shape: how exact its bounding box is
SHAPES = {"path", "line", "rect", "circle", "ellipse", "polygon", "polyline"}
MARKED = {"path", "line", "polygon", "polyline"}
BAD_VALUE = (ValueError, TypeError, IndexError, AttributeError, ZeroDivisionError, OverflowError)
_TOKEN = re.compile(r"[A-Za-z]|\.?\d+")


class BadElement(Exception):
    """An element cannot be read, for a reason."""

    def __init__(self, element: Element, reason: str) -> None:
        super().__init__(reason)
        name = f" id={element.get('id', '')[:40]!a}" if element.get("id") else ""
        self.message = f"<{element.tag}{name}>: {reason}"


@dataclass(frozen=True)
class DrawnShape:
    """One element's sub-paths in the drawing's user units, and how they are painted."""

    paths: list[SubPath]
    place: "ElementPlace"
    matrix: Array  # the map (3, 3) from the units of its pen to the drawing's
    path_length: float | None = None  # what its author takes for the length of its paths
    clips: tuple["Clip", ...] = ()  # what cuts it: it shows where all of these are
    tint: str | None = None  # the colour that a filter gives it, whatever its paint

    @property
    def paint(self) -> Style:
        """The properties that apply to it."""
        return self.place.style

    @property
    def scale(self) -> float:
        """The mean size of a unit of the pen in the drawing's units."""
        return float(abs(np.linalg.det(self.matrix[:2, :2])) ** 0.5)

    @property
    def width(self) -> float:
        """The width of its pen."""
        width = self.number("stroke-width", 1.0)
        return width if width >= 0 else 1.0

    @property
    def keeps_its_width(self) -> bool:
        """Whether its stroke is as wide wherever it is moved to, as `vector-effect` can say."""
        return self.paint.get("vector-effect") == "non-scaling-stroke"

    @property
    def dashes(self) -> list[float]:
        """The lengths of dashes and gaps in turn, an even number of them; none for a whole line."""
        words = self.paint.get("stroke-dasharray", "none").replace(",", " ").split()
        found = [as_number(word, -1.0, self.place.diagonal) for word in words[:MAX_DASHES]]
        return found * (1 + len(found) % 2) if sum(found) > 0 and min(found) >= 0 else []

    def number(self, key: str, usual: float) -> float:
        """Read a property as a length in units of the pen, or return the usual one."""
        return as_number(self.paint.get(key), usual, self.place.diagonal)


@dataclass(frozen=True, eq=False)
class Clip:
    """Shapes that say where others show: by their fills, or as a mask by what is light or opaque."""

    shapes: list[DrawnShape]
    kind: str = "clip"  # "clip", "luminance" or "alpha"


@dataclass(frozen=True, eq=False)
class PaintGroup:
    """An element that is painted as a whole and then laid over what is below with an opacity."""

    opacity: float


@dataclass(frozen=True)
class ElementPlace:
    """Where in the drawing an element stands: what it inherits."""

    matrix: Array  # (3, 3), to the drawing's user units
    viewport: tuple[float, float]  # what percentages refer to
    style: Style
    rem: float = FONT_SIZE
    depth: int = 0
    groups: tuple[PaintGroup, ...] = ()  # those around that are not opaque, the outermost first
    context: tuple[str, str] = ("none", "none")  # the fill and stroke around a marker or <use>
    decorates: bool = False  # as a marker does, which is not part of a shape's box

    @property
    def diagonal(self) -> float:
        """What percentages refer to that are of neither side."""
        return float(np.hypot(*self.viewport)) / 2**0.5

    @property
    def opacity(self) -> float:
        """The product of the opacities of all groups around."""
        return math.prod(group.opacity for group in self.groups)

    def moved(self, matrix: Array) -> "ElementPlace":
        return replace(self, matrix=self.matrix @ matrix)

    def styled(self, style: Style) -> "ElementPlace":
        """Return the place inside an element of a style."""
        share = min(max(as_number(style.get("opacity"), 1.0), 0.0), 1.0)
        known = {"context-fill": self.context[0], "context-stroke": self.context[1]}
        own = {
            key: known[text] for key in ("fill", "stroke") if (text := style.get(key, "")) in known
        }
        style = {**style, **own} if own else style
        groups = self.groups if share == 1 else (*self.groups, PaintGroup(share))
        return replace(self, depth=self.depth + 1, style=style, groups=groups)

    def length(self, element: Element, key: str, text: str | None, usual: float = 0.0) -> float:
        """Return a length of an element in user units. Raises `BadElement` for what is none."""
        if text is None or text.strip().lower() == "auto":
            return usual
        text = without_font_units(text, float(self.style.get("font-size", FONT_SIZE)), self.rem)
        along_x = key in {"x", "width", "cx", "rx", "x1", "x2", "refX", "markerWidth"}
        along_y = key in {"y", "height", "cy", "ry", "y1", "y2", "refY", "markerHeight"}
        width, height = self.viewport
        found = length(text, width if along_x else height if along_y else self.diagonal)
        if found is None:
            reason = f"{key} {text[:40]!a} is not a length in px, mm, in, pt, em or %"
            raise BadElement(element, reason)
        return found


def path_tokens(element: Element, style: Style) -> int:
    """Return the number of commands and numbers in the path data of an element."""
    texts = (style.get("d", ""), element.get("points", ""))
    return sum(1 for text in texts for _ in _TOKEN.finditer(text))


def shape_paths(element: Element, place: ElementPlace) -> list[SubPath]:
    """Return the sub-paths of an element in the drawing's user units; none of what has no size."""
    try:
        shape = _shape(element, place)
        return [] if shape is None else sub_paths(shape, place.matrix)
    except BAD_VALUE as exc:
        raise BadElement(element, "its geometry cannot be read; redraw or delete it") from exc


def _shape(element: Element, place: ElementPlace) -> svgelements.Shape | None:
    tag, style = element.tag, place.style
    if tag == "path":
        return svgelements.Path({"d": style["d"]}) if style.get("d") else None
    if tag in ("polygon", "polyline"):
        kind = svgelements.Polygon if tag == "polygon" else svgelements.Polyline
        return kind({"points": element.get("points", "")}) if element.get("points") else None

    def number(key: str, usual: float = 0.0) -> float:
        text = element.get(key) if tag == "line" else style.get(key)
        return place.length(element, key, text, usual)

    if tag == "line":
        return svgelements.SimpleLine(*map(number, ("x1", "y1", "x2", "y2")))
    if tag == "circle":
        return ellipse(number("cx"), number("cy"), number("r"), number("r"))
    rx, ry = number("rx", -1.0), number("ry", -1.0)
    # each is the other where it is not given
    rx, ry = (rx if rx >= 0 else max(ry, 0.0)), (ry if ry >= 0 else max(rx, 0.0))
    if tag == "ellipse":
        return ellipse(number("cx"), number("cy"), rx, ry)
    x, y, width, height = map(number, ("x", "y", "width", "height"))
    return rectangle(x, y, width, height, rx, ry)


def ellipse(x: float, y: float, rx: float, ry: float) -> svgelements.Shape | None:
    """Return an ellipse by its middle and radii, if it has a size."""
    return svgelements.Ellipse(x, y, rx, ry) if rx > 0 and ry > 0 else None


def rectangle(
    x: float, y: float, width: float, height: float, rx: float = 0.0, ry: float = 0.0
) -> svgelements.Shape | None:
    """Return a rectangle with round corners, if it has a size."""
    if not (width > 0 and height > 0):
        return None
    corner = (min(rx, width / 2), min(ry, height / 2)) if rx > 0 and ry > 0 else ()
    return svgelements.Rect(x, y, width, height, *corner)


def bounds_of(shapes: Iterable[DrawnShape], matrix: Array) -> Window | None:
    """Return the box (xmin, ymin, xmax, ymax) of shapes without their pens.

    It is in the units that `matrix` maps to the drawing's, and exact but for `BOX_FLATNESS`.
    """
    back = np.linalg.inv(matrix)
    found: list[Array] = []
    for shape in shapes:
        for path in () if shape.place.decorates else shape.paths:
            reach = path.reach()
            size = float(np.ptp(reach, axis=0).max())
            exact = 0 < size < MAX_COORDINATE  # not NaN, either
            found.append(mapped(back, path.flatten(BOX_FLATNESS * size) if exact else reach))
    if not found:
        return None
    points = np.concatenate(found)
    (xmin, ymin), (xmax, ymax) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    return xmin, ymin, xmax, ymax


def unit_box_matrix(box: Window) -> Array:
    """Return the map (3, 3) from the unit square to a box: that of `objectBoundingBox`."""
    xmin, ymin, xmax, ymax = box
    return np.array([[xmax - xmin, 0, xmin], [0, ymax - ymin, ymin], [0, 0, 1.0]])


def mapped(matrix: Array, points: Array) -> Array:
    """Return points (N, 2) mapped by a matrix (3, 3)."""
    return points @ matrix[:2, :2].T + matrix[:2, 2]


def view_box(element: Element) -> Window | None:
    """Return the viewBox (x, y, width, height) of an element."""
    text = element.get("viewBox")
    if text is None:
        return None
    try:
        x, y, width, height = map(float, text.replace(",", " ").split())
    except ValueError as exc:
        raise BadElement(element, f"viewBox {text[:60]!a} is not four numbers") from exc
    if not (np.isfinite([x, y, width, height]).all() and width > 0 and height > 0):
        raise BadElement(element, f"viewBox {text[:60]!a} has no area")
    return x, y, width, height


def view_matrix(element: Element, frame: Window) -> tuple[Array, tuple[float, float]]:
    """Return the map (3, 3) of a viewBox into a frame, and what percentages refer to."""
    box = view_box(element)
    if box is None:
        return shift(*frame[:2]), frame[2:]
    words = (element.get("preserveAspectRatio") or "xMidYMid").lower().split()
    align, slices = words[words[:1] == ["defer"]], "slice" in words
    scale = np.array(frame[2:]) / box[2:]
    if align != "none":
        scale[:] = scale.max() if slices else scale.min()
    spare = np.array(frame[2:]) - scale * box[2:]
    share = [0.5 if f"{key}mid" in align else float(f"{key}max" in align) for key in "xy"]
    x, y = np.array(frame[:2]) - scale * box[:2] + share * spare
    return np.array([[scale[0], 0, x], [0, scale[1], y], [0, 0, 1.0]]), box[2:]
