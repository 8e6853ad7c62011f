"""The shapes that an SVG drawing shows, with their transforms, found by a walk of its elements."""

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from xml.etree.ElementTree import Element

import numpy as np
import svgelements

from orbiflow.arrays import Array, Window
from orbiflow.errors import InputFileError
from orbiflow.tiles.silhouette.readers.reading import Source, read_bytes
from orbiflow.tiles.silhouette.readers.svg_paths import SubPath, corners, sub_paths
from orbiflow.tiles.silhouette.readers.svg_xml import MAX_DEPTH, StyleSheet, parse_xml

MAX_BYTES = 16 * 2**20
PIXELS_PER_INCH = 96
MAX_DRAWN = 10_000  # elements, those drawn again by <use>, clips, masks and markers counted again
MAX_TRANSFORM = 2000  # characters
MOST_DASHES = 1000  # lengths in one pattern
MAX_NUMBER = 1e9  # the largest width or opacity that is believed
MAX_TOKENS = 400_000  # commands and numbers in all path data; one with a fraction counts twice
_GROUPS = {"svg", "g", "a", "switch"}
_SHAPES = {
    "path": (svgelements.Path, ("d",)),
    "line": (svgelements.SimpleLine, ()),
    "rect": (svgelements.Rect, ("width", "height")),
    "circle": (svgelements.Circle, ("r",)),
    "ellipse": (svgelements.Ellipse, ("rx", "ry")),
    "polygon": (svgelements.Polygon, ("points",)),
    "polyline": (svgelements.Polyline, ("points",)),
}
_MARKED = {"path", "line", "polygon", "polyline"}
_GEOMETRY = {
    *("d", "points", "x", "y", "width", "height", "r", "rx", "ry", "cx", "cy"),
    *("x1", "y1", "x2", "y2"),
}
_BAD_VALUE = (ValueError, TypeError, IndexError, AttributeError, ZeroDivisionError, OverflowError)
_TOKEN = re.compile(r"[A-Za-z]|\.?\d+")
_LENGTH = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)(e[-+]?\d+)?(px|pt|pc|mm|cm|in|%)?", re.IGNORECASE)
_REFERENCE = re.compile(r"""\s*url\(\s*["']?#([^"')]+)""")
# properties of paint that elements have from those around them
PAINT = (
    *("fill", "fill-rule", "fill-opacity", "clip-rule", "color", "visibility", "paint-order"),
    *("stroke", "stroke-width", "stroke-opacity", "stroke-linecap", "stroke-linejoin"),
    *("stroke-miterlimit", "stroke-dasharray", "stroke-dashoffset"),
    *("marker", "marker-start", "marker-mid", "marker-end"),
)


@dataclass(frozen=True)
class DrawnShape:
    """One element's sub-paths in the drawing's user units, and how they are painted."""

    paths: list[SubPath]
    paint: Mapping[str, str]  # the properties of paint that apply to it, as they are written
    opacity: float  # its own times that of the groups around it
    matrix: Array  # the map (3, 3) from the units of its pen to the drawing's
    diagonal: float  # what percentages of the pen refer to, in units of the pen
    clips: tuple["Clip", ...] = ()  # what cuts it: it shows where all of these are

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
    def dashes(self) -> list[float]:
        """The lengths of dashes and gaps in turn, an even number of them; none for a whole line."""
        words = self.paint.get("stroke-dasharray", "none").replace(",", " ").split()
        found = [as_number(word, -1.0, self.diagonal) for word in words[:MOST_DASHES]]
        return found * (1 + len(found) % 2) if sum(found) > 0 and min(found) >= 0 else []

    def number(self, key: str, usual: float) -> float:
        """Read a property as a length in units of the pen, or return the usual one."""
        return as_number(self.paint.get(key), usual, self.diagonal)


@dataclass(frozen=True, eq=False)
class Clip:
    """Shapes that say where others show: by their fills, or as a mask by what is light or opaque."""

    shapes: list[DrawnShape]
    kind: str = "clip"  # "clip", "luminance" or "alpha"


@dataclass(frozen=True)
class _Place:
    """Where in the drawing an element stands: what it inherits."""

    matrix: Array  # (3, 3), to the drawing's user units
    viewport: tuple[float, float]  # what percentages refer to
    depth: int = 0
    paint: Mapping[str, str] = field(default_factory=dict[str, str])
    opacity: float = 1.0

    def moved(self, matrix: Array) -> "_Place":
        return replace(self, matrix=self.matrix @ matrix)

    def painted(self, properties: Mapping[str, str]) -> "_Place":
        own = {key: properties[key] for key in PAINT if properties.get(key, "inherit") != "inherit"}
        share = min(max(as_number(properties.get("opacity"), 1.0), 0.0), 1.0)
        return replace(
            self, depth=self.depth + 1, paint={**self.paint, **own}, opacity=self.opacity * share
        )


class Drawing:
    """The shapes of the SVG drawing in a file, and how many things of other kinds were met."""

    def __init__(self, path: Source) -> None:
        self.path, self.root = path, parse_xml(path, read_bytes(path, MAX_BYTES))
        self.shapes: list[DrawnShape] = []
        self.others = Counter[str]()
        self.visited = self.tokens = 0
        self.styles = StyleSheet(path, self.root)
        self.by_id = {key: item for item in self.root.iter() if (key := item.get("id"))}
        self.box = self._box()
        self._clips: dict[tuple[int, bytes], Clip] = {}
        xmin, ymin, xmax, ymax = self.box or (0.0, 0.0, 100.0, 100.0)
        properties = self.styles.properties(self.root)
        place = _Place(np.eye(3), (xmax - xmin, ymax - ymin), depth=-1).painted(properties)
        for child in self.root:
            self._visit(child, place)

    def left_out(self) -> list[str]:
        """Return a note of what was met and is not drawn."""
        left = [f"{count} {name}{'s' * (count > 1)}" for name, count in self.others.items()]
        return [f"left out {' and '.join(left)} of the drawing"] * bool(left)

    def referred(self, text: str | None) -> Element | None:
        """Return the element that the property `url(#id)` names."""
        found = _REFERENCE.match(text or "")
        return self.by_id.get(found[1].strip()) if found else None

    def _box(self) -> Window | None:
        """Return the visible part (xmin, ymin, xmax, ymax) in user units: the viewBox, or the size."""
        box = self._view_box(self.root)
        if box is not None:
            return box[0], box[1], box[0] + box[2], box[1] + box[3]
        width, height = (self._length(self.root, key) for key in ("width", "height"))
        if width is None or height is None or not (width > 0 and height > 0):
            return None
        return 0.0, 0.0, width, height

    def _view_box(self, element: Element) -> Window | None:
        """Return the viewBox (x, y, width, height) of `element`."""
        text = element.get("viewBox")
        if text is None:
            return None
        try:
            x, y, width, height = map(float, text.replace(",", " ").split())
        except ValueError as exc:
            raise self._refuse(element, f"viewBox {text[:60]!a} is not four numbers") from exc
        if not (np.isfinite([x, y, width, height]).all() and width > 0 and height > 0):
            raise self._refuse(element, f"viewBox {text[:60]!a} has no area")
        return x, y, width, height

    def _visit(self, element: Element, place: _Place) -> None:
        self.visited += 1
        if self.visited > MAX_DRAWN:
            raise InputFileError(
                f"{self.path}: draws more than {MAX_DRAWN} elements; keep only the silhouette"
            )
        if place.depth > MAX_DEPTH:
            raise InputFileError(
                f"{self.path}: <use> elements refer to each other in a circle or nest too deeply"
            )
        properties = self.styles.properties(element)
        if properties.get("display", "").lower() == "none":
            return
        place = place.moved(self._transform(element, properties, place)).painted(properties)
        first = len(self.shapes)
        if np.linalg.det(place.matrix) == 0:  # flat
            return
        if element.tag == "svg":
            self._visit_viewport(element, self._window(element, place), place)
        elif element.tag in _GROUPS:
            for child in element:
                self._visit(child, place)
        elif element.tag == "use":
            self._visit_use(element, place)
        elif element.tag in _SHAPES:
            self._add_shape(element, properties, place)
        elif element.tag in ("image", "text"):
            self.others[element.tag] += 1
        if properties.get("filter", "none") != "none":
            self.others["filter"] += 1
        for key in ("clip-path", "mask"):
            self._clip(self.referred(properties.get(key)), place, first)

    def _visit_use(self, use: Element, place: _Place) -> None:
        target = self.by_id.get(use.get("href", "").strip().removeprefix("#"))
        if target is None:
            return
        if target.tag in ("symbol", "svg"):
            self._visit_viewport(target, self._window(use, place), place)
            return
        shift = np.eye(3)
        shift[:2, 2] = [self._length(use, key, place) or 0.0 for key in ("x", "y")]
        self._visit(target, place.moved(shift))

    def _window(self, element: Element, place: _Place) -> Window:
        """Return x, y, width and height of a viewport: those of an inner <svg>, or of a <use>."""
        x, y = (self._length(element, key, place) or 0.0 for key in ("x", "y"))
        width = self._length(element, "width", place) or place.viewport[0]
        return x, y, width, self._length(element, "height", place) or place.viewport[1]

    def _visit_viewport(self, element: Element, window: Window, place: _Place) -> None:
        """Draw what an inner <svg>, a <symbol> or a <marker> holds in a window, cut at its edges."""
        matrix, viewport = self._view(element, window)
        inner, first = replace(place.moved(matrix), viewport=viewport), len(self.shapes)
        for child in element:
            self._visit(child, inner)
        if self.styles.properties(element).get("overflow") not in ("visible", "auto"):
            own = self.shapes[first:]
            x, y, width, height = map(str, window)
            edge = {"x": x, "y": y, "width": width, "height": height}
            del self.shapes[first:]
            self._add_shape(Element("rect"), edge, place)
            self._cut(own, first, Clip(self.shapes[first:]))

    def _view(self, element: Element, window: Window) -> tuple[Array, tuple[float, float]]:
        """Return the map (3, 3) of a viewBox into a window, and what percentages refer to."""
        box = self._view_box(element)
        if box is None:
            return np.array([[1, 0, window[0]], [0, 1, window[1]], [0, 0, 1.0]]), window[2:]
        text = svgelements.Viewbox.viewbox_transform(
            *window, *box, element.get("preserveAspectRatio")
        )
        return _as_array(svgelements.Matrix(text)), box[2:]

    def _cut(self, own: list[DrawnShape], first: int, clip: Clip) -> None:
        self.shapes[first:] = [replace(shape, clips=(*shape.clips, clip)) for shape in own]

    def _clip(self, source: Element | None, place: _Place, first: int) -> None:
        """Cut the shapes from the `first` on by the content of a <clipPath> or <mask>."""
        own = self.shapes[first:]
        if source is None or source.tag not in ("clipPath", "mask") or not own:
            return
        properties = self.styles.properties(source)
        inner = place.moved(self._transform(source, properties, place))
        if "objectBoundingBox" in (source.get("clipPathUnits"), source.get("maskContentUnits")):
            points = np.concatenate([path.reach() for shape in own for path in shape.paths])
            points = _mapped(np.linalg.inv(place.matrix), points)
            low, high = points.min(axis=0), points.max(axis=0)
            inner = inner.moved(np.array([*np.c_[np.diag(high - low), low], [0, 0, 1.0]]))
        key = id(source), inner.matrix.tobytes()
        if key not in self._clips:
            del self.shapes[first:]
            inner = replace(inner, paint={}, opacity=1.0).painted(properties)
            for child in source:
                self._visit(child, inner)
            kind = "clip" if source.tag == "clipPath" else properties.get("mask-type", "luminance")
            self._clips[key] = Clip(self.shapes[first:], kind)
        self._cut(own, first, self._clips[key])

    def _add_shape(self, element: Element, properties: dict[str, str], place: _Place) -> None:
        kind, needed = _SHAPES[element.tag]
        if any(key not in properties for key in needed):
            return
        for key in ("d", "points"):
            self.tokens += sum(1 for _ in _TOKEN.finditer(properties.get(key, "")))
        if self.tokens > MAX_TOKENS:
            raise self._refuse(element, "the paths hold too much data; simplify the drawing")
        geometry = {key: properties[key] for key in _GEOMETRY & properties.keys()}
        for key in geometry.keys() - {"d", "points"}:
            self._check_length(element, key, geometry[key])
        try:
            shape = kind(geometry)
            width, height = place.viewport
            shape.render(ppi=PIXELS_PER_INCH, width=width, height=height)
            paths = sub_paths(svgelements.Path(shape), place.matrix[:2])
        except _BAD_VALUE as exc:
            raise self._refuse(element, "its geometry cannot be read; redraw or delete it") from exc
        matrix = place.matrix
        if properties.get("vector-effect") == "non-scaling-stroke":
            x, y, *end = self.box or (0.0, 0.0, 1.0, 1.0)
            sizes = zip(("width", "height"), (end[0] - x, end[1] - y), strict=True)
            pixel = max(own / (self._length(self.root, key) or own) for key, own in sizes)
            matrix = np.diag([pixel, pixel, 1.0])
        diagonal = float(np.hypot(*place.viewport)) / 2**0.5
        drawn = DrawnShape(paths, place.paint, place.opacity, matrix, diagonal)
        self.shapes.append(drawn)
        if element.tag in _MARKED:
            self._add_markers(drawn, place)

    def _add_markers(self, shape: DrawnShape, place: _Place) -> None:
        named = {key: shape.paint.get(f"marker-{key}") for key in ("start", "mid", "end")}
        named = {
            key: self.referred(text or shape.paint.get("marker")) for key, text in named.items()
        }
        if all(marker is None for marker in named.values()):
            return
        for key, point, angle in corners(shape.paths, np.linalg.inv(place.matrix)[:2]):
            marker = named[key]
            if marker is None or marker.tag != "marker":
                continue
            turn, scale = marker.get("orient", "0"), shape.width
            if not turn.startswith("auto"):
                angle = np.radians(as_number(turn.removesuffix("deg"), 0.0))
            elif turn == "auto-start-reverse" and key == "start":
                angle += np.pi
            if marker.get("markerUnits") == "userSpaceOnUse":
                scale = 1.0
            x, y = scale * np.cos(angle), scale * np.sin(angle)
            inner = place.moved(np.array([[x, -y, point[0]], [y, x, point[1]], [0, 0, 1.0]]))
            inner = replace(inner, paint={}).painted(self.styles.properties(marker))
            self._visit_marker(marker, inner)

    def _visit_marker(self, marker: Element, place: _Place) -> None:
        """Draw a marker with its reference point at the origin of a place."""
        width, height = (as_number(marker.get(f"marker{key}"), 3.0) for key in ("Width", "Height"))
        matrix, _ = self._view(marker, (0.0, 0.0, width, height))
        at = np.array([[as_number(marker.get(f"ref{key}"), 0.0) for key in "XY"]])
        x, y = -_mapped(matrix, at)[0]
        self._visit_viewport(marker, (x, y, width, height), place)

    def _transform(self, element: Element, properties: dict[str, str], place: _Place) -> Array:
        text = properties.get("transform")
        if not text or text == "none":
            return np.eye(3)
        if len(text) > MAX_TRANSFORM:
            raise self._refuse(element, f"transform of {len(text)} characters; flatten it")
        try:
            matrix = svgelements.Matrix(text)
            width, height = place.viewport
            matrix.render(ppi=PIXELS_PER_INCH, width=width, height=height)
            return _as_array(matrix)
        except _BAD_VALUE as exc:
            raise self._refuse(element, f"transform {text[:60]!a} cannot be read") from exc

    def _length(self, element: Element, key: str, place: _Place | None = None) -> float | None:
        """Return a length attribute in user units, or None if it is absent or cannot be resolved."""
        text = element.get(key)
        if text is None:
            return None
        self._check_length(element, key, text)
        if place is None and text.strip().endswith("%"):
            return None
        relative = 0.0 if place is None else place.viewport[key in ("y", "height")]
        length = svgelements.Length(text.strip())
        return float(length.value(ppi=PIXELS_PER_INCH, relative_length=relative))

    def _check_length(self, element: Element, key: str, text: str) -> None:
        if len(text) > 100 or not _LENGTH.fullmatch(text.strip()):
            reason = f"{key} {text[:40]!a} is not a length in px, mm, in, pt or %"
            raise self._refuse(element, reason)

    def _refuse(self, element: Element, reason: str) -> InputFileError:
        name = f" id={element.get('id', '')[:40]!a}" if element.get("id") else ""
        return InputFileError(f"{self.path}: <{element.tag}{name}>: {reason}")


def as_number(text: str | None, usual: float, relative: float = 1.0) -> float:
    """Read a length in user units or a share; return the usual one if it cannot be read."""
    if not text:
        return usual
    try:
        length = svgelements.Length(text.strip()[:40])
        value = float(length.value(ppi=PIXELS_PER_INCH, relative_length=relative))
    except _BAD_VALUE:
        return usual
    return value if abs(value) < MAX_NUMBER else usual  # neither is NaN


def _mapped(matrix: Array, points: Array) -> Array:
    return points @ matrix[:2, :2].T + matrix[:2, 2]


def _as_array(matrix: svgelements.Matrix) -> Array:
    rows = [[matrix.a, matrix.c, matrix.e], [matrix.b, matrix.d, matrix.f], [0, 0, 1]]
    return np.array(rows, dtype=np.float64)
