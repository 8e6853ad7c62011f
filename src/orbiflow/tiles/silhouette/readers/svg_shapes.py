"""The shapes that an SVG drawing shows, with their transforms, found by a walk of its elements."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np
import svgelements

from orbiflow.arrays import Array, Window
from orbiflow.errors import InputFileError
from orbiflow.tiles.silhouette.readers.reading import Source
from orbiflow.tiles.silhouette.readers.svg_paths import SubPath, sub_paths

MAX_ELEMENTS = 20_000
MAX_DEPTH = 100
MAX_STYLE = 200_000  # characters
_COMMENT = re.compile(r"/\*.*?(?:\*/|$)", re.DOTALL)
_SELECTOR = re.compile(r"\*|[\w-]*(?:[.#][\w-]+)?")


def parse_xml(path: Source, data: bytes) -> Element:
    """Return the root element of the SVG document `data`, all names without their namespaces.

    Refused are entities, which can blow up to any size, deep nesting and too many elements.
    """
    parser = expat.ParserCreate(namespace_separator="}")
    parser.buffer_text = True
    tree = _BoundedTree(path, parser)
    parser.StartElementHandler = tree.start
    parser.EndElementHandler = tree.end
    parser.CharacterDataHandler = tree.builder.data
    parser.EntityDeclHandler = tree.refuse_entity
    try:
        parser.Parse(data, True)
    except expat.ExpatError as exc:
        raise InputFileError(
            f"{path}: line {exc.lineno}: not well-formed XML ({expat.ErrorString(exc.code)}); "
            "export the drawing again"
        ) from exc
    except (LookupError, ValueError) as exc:
        if isinstance(exc, InputFileError):
            raise
        raise InputFileError(
            f"{path}: its text encoding cannot be read ({exc}); use UTF-8"
        ) from exc
    root = tree.builder.close()
    if root.tag != "svg":
        raise InputFileError(f"{path}: the XML is a <{root.tag[:40]}>, not an <svg> drawing")
    return root


class _BoundedTree:
    def __init__(self, path: Source, parser: expat.XMLParserType) -> None:
        self.path, self.parser, self.builder = path, parser, TreeBuilder()
        self.count = self.depth = 0

    def start(self, name: str, attributes: dict[str, str]) -> None:
        self.count += 1
        self.depth += 1
        if self.count > MAX_ELEMENTS:
            self._refuse(f"more than {MAX_ELEMENTS} elements; keep only the silhouette")
        if self.depth > MAX_DEPTH:
            self._refuse(f"elements nested more than {MAX_DEPTH} deep; ungroup the drawing")
        self.builder.start(_local(name), {_local(key): value for key, value in attributes.items()})

    def end(self, name: str) -> None:
        self.depth -= 1
        self.builder.end(_local(name))

    def refuse_entity(self, name: str, *_: object) -> None:
        self._refuse(
            f"declares the XML entity {name[:40]!a}; entities are not read, save the drawing "
            "as plain SVG"
        )

    def _refuse(self, reason: str) -> None:
        raise InputFileError(f"{self.path}: line {self.parser.CurrentLineNumber}: {reason}")


def _local(name: str) -> str:
    return name.rpartition("}")[2]


class StyleSheet:
    """The rules of a drawing's `<style>` elements with selectors `tag`, `.class`, `#id`, `tag.class`.

    Enough for what drawing programs write; rules with other selectors are passed over.
    """

    def __init__(self, path: Source, root: Element) -> None:
        self.rules: dict[str, dict[str, str]] = {}
        text = "\n".join(style.text or "" for style in root.iter("style"))
        if len(text) > MAX_STYLE:
            raise InputFileError(
                f"{path}: <style> of {len(text)} characters; save the drawing as plain SVG"
            )
        for rule in _COMMENT.sub(" ", text).split("}"):
            selectors, _, body = rule.partition("{")
            declarations = _declarations(body)
            for selector in map(str.strip, selectors.split(",")):
                if _SELECTOR.fullmatch(selector):
                    self.rules.setdefault(selector, {}).update(declarations)

    def properties(self, element: Element) -> dict[str, str]:
        """Return attributes of `element` overridden by the rules that match it and by its own style."""
        properties = dict(element.attrib)
        tag, names = element.tag, element.get("class", "").split()
        classes = [f"{before}.{name}" for before in ("", tag) for name in names]
        for selector in ("*", tag, *classes, f"#{element.get('id', '')}"):
            properties.update(self.rules.get(selector, {}))
        properties.update(_declarations(element.get("style", "")))
        return properties


def _declarations(text: str) -> dict[str, str]:
    pairs = (item.partition(":") for item in text.split(";"))
    return {
        key.strip().lower(): value.replace("!important", "").strip()
        for key, colon, value in pairs
        if colon
    }


PIXELS_PER_INCH = 96
MAX_DRAWN = 10_000  # elements, those drawn again by <use> counted again
MAX_TRANSFORM = 2000  # characters
MAX_TOKENS = 400_000  # commands and numbers in all path data; one with a fraction counts twice
_GROUPS = {"svg", "g", "a", "switch"}
_SHAPES = {
    "path": (svgelements.Path, ("d",)),
    "rect": (svgelements.Rect, ("width", "height")),
    "circle": (svgelements.Circle, ("r",)),
    "ellipse": (svgelements.Ellipse, ("rx", "ry")),
    "polygon": (svgelements.Polygon, ("points",)),
    "polyline": (svgelements.Polyline, ("points",)),
}
_GEOMETRY = {"d", "points", "x", "y", "width", "height", "r", "rx", "ry", "cx", "cy"}
_BAD_VALUE = (ValueError, TypeError, IndexError, AttributeError, ZeroDivisionError, OverflowError)
_TOKEN = re.compile(r"[A-Za-z]|\.?\d+")
_LENGTH = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)(e[-+]?\d+)?(px|pt|pc|mm|cm|in|%)?", re.IGNORECASE)


# properties of paint that elements have from those around them
PAINT = ("fill", "stroke", "stroke-width", "fill-opacity", "stroke-opacity", "color", "visibility")


@dataclass(frozen=True)
class DrawnShape:
    """The sub-paths of one element, in user units of the drawing, and how they are filled.

    `paint` is what the element or one around it says of `PAINT`, `opacity` that of all the groups
    that it is in, `scale` the number of the drawing's user units for one of its own.
    """

    paths: list[SubPath]
    fill_rule: str
    paint: Mapping[str, str] = field(default_factory=dict[str, str])
    opacity: float = 1.0
    scale: float = 1.0


@dataclass(frozen=True)
class _Place:
    """Where in the drawing an element stands: what it inherits."""

    matrix: Array  # (3, 3), to the drawing's user units
    viewport: tuple[float, float]  # what percentages refer to
    fill_rule: str = "nonzero"
    depth: int = 0
    paint: Mapping[str, str] = field(default_factory=dict[str, str])
    opacity: float = 1.0


@dataclass
class Drawing:
    """An SVG drawing: walk it with `collect`, then read off `shapes` and what else was met."""

    path: Source
    root: Element
    shapes: list[DrawnShape] = field(default_factory=list[DrawnShape])
    others: dict[str, int] = field(default_factory=dict[str, int])
    visited: int = 0
    tokens: int = 0

    def __post_init__(self) -> None:
        self.styles = StyleSheet(self.path, self.root)
        self.by_id = {key: item for item in self.root.iter() if (key := item.get("id"))}
        self.box = self._box()

    def collect(self) -> None:
        """Find all shapes. Raises `InputFileError` for one that cannot be understood."""
        xmin, ymin, xmax, ymax = self.box or (0.0, 0.0, 100.0, 100.0)
        place = _Place(np.eye(3), (xmax - xmin, ymax - ymin))
        for child in self.root:
            self._visit(child, place)

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
        place = replace(
            place,
            matrix=place.matrix @ self._transform(element, properties, place),
            fill_rule=properties.get("fill-rule", place.fill_rule).lower(),
            depth=place.depth + 1,
            paint={**place.paint, **{key: properties[key] for key in PAINT if key in properties}},
            opacity=place.opacity * _share(properties.get("opacity")),
        )
        if element.tag in _GROUPS:
            if element.tag == "svg":
                place = self._viewport(element, element, place)
            for child in element:
                self._visit(child, place)
        elif element.tag == "use":
            self._visit_use(element, place)
        elif element.tag in _SHAPES:
            self._add_shape(element, properties, place)
        elif element.tag in ("image", "text"):
            self.others[element.tag] = self.others.get(element.tag, 0) + 1

    def _visit_use(self, use: Element, place: _Place) -> None:
        target = self.by_id.get(use.get("href", "").strip().removeprefix("#"))
        if target is None:
            return
        if target.tag in ("symbol", "svg"):
            place = self._viewport(target, use, place)
            for child in target:
                self._visit(child, place)
            return
        shift = np.eye(3)
        shift[:2, 2] = [self._length(use, key, place) or 0.0 for key in ("x", "y")]
        self._visit(target, replace(place, matrix=place.matrix @ shift))

    def _viewport(self, element: Element, sized_by: Element, place: _Place) -> _Place:
        """Return the place inside a nested viewport: an inner <svg>, or a <symbol> that is used."""
        x, y = (self._length(sized_by, key, place) or 0.0 for key in ("x", "y"))
        width = self._length(sized_by, "width", place) or place.viewport[0]
        height = self._length(sized_by, "height", place) or place.viewport[1]
        box = self._view_box(element)
        if box is None:
            shift = np.array([[1, 0, x], [0, 1, y], [0, 0, 1.0]])
            return replace(place, matrix=place.matrix @ shift, viewport=(width, height))
        text = svgelements.Viewbox.viewbox_transform(
            x, y, width, height, *box, element.get("preserveAspectRatio")
        )
        matrix = _as_array(svgelements.Matrix(text))
        return replace(place, matrix=place.matrix @ matrix, viewport=box[2:])

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
        scale = float(abs(np.linalg.det(place.matrix[:2, :2])) ** 0.5)
        self.shapes.append(DrawnShape(paths, place.fill_rule, place.paint, place.opacity, scale))

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


def _share(text: str | None) -> float:
    """Return an opacity, 0 to 1; what cannot be read is opaque."""
    try:
        value = float(text.strip().removesuffix("%")) if text else 1.0
    except ValueError:
        return 1.0
    value = value / 100 if text and text.strip().endswith("%") else value
    return min(max(value, 0.0), 1.0) if value == value else 1.0


def _as_array(matrix: svgelements.Matrix) -> Array:
    rows = [[matrix.a, matrix.c, matrix.e], [matrix.b, matrix.d, matrix.f], [0, 0, 1]]
    return np.array(rows, dtype=np.float64)
