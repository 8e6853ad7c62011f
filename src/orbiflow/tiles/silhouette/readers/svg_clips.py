"""What cuts shapes: clip paths, masks, the frames of viewports, and the basic shapes of CSS."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element

import numpy as np

from orbiflow.arrays import Window
from orbiflow.tiles.silhouette.readers.svg_css import Style
from orbiflow.tiles.silhouette.readers.svg_properties import REFERENCE
from orbiflow.tiles.silhouette.readers.svg_shapes import (
    SHAPES,
    Clip,
    DrawnShape,
    Place,
    bounds_of,
    mapped,
    shape_paths,
    unit_box_matrix,
)
from orbiflow.tiles.silhouette.readers.svg_transforms import origin_of, shift
from orbiflow.tiles.silhouette.readers.svg_values import as_number, length
from orbiflow.tiles.silhouette.readers.svg_xml import reference

if TYPE_CHECKING:
    from orbiflow.tiles.silhouette.readers.svg_drawing import Drawing

_MASK_FRAME = {"x": "-10%", "y": "-10%", "width": "120%", "height": "120%"}
_BASIC = re.compile(r"(?:^|\s)(circle|ellipse|inset|polygon|path)\((.*)\)", re.DOTALL)
_RULE = re.compile(r"\s*(nonzero|evenodd)\s*,\s*")
_TEXT = re.compile(r"""["'](.*)["']""", re.DOTALL)


class Clips:
    """The clip paths and masks of a drawing, each read once for each place where it stands."""

    def __init__(self, drawing: Drawing) -> None:
        self.drawing = drawing
        self._known: dict[tuple[Element, bytes, bytes], list[Clip]] = {}

    def cut(self, shapes: list[DrawnShape], key: str, text: str, place: Place) -> list[DrawnShape]:
        """Return shapes cut by the property `clip-path` or `mask` of the element in a place."""
        drawing = self.drawing
        if REFERENCE.match(text) is None:
            clip = self._basic(text, shapes, place) if key == "clip-path" else None
            if clip is None:
                drawing.notes.add(f"{key} {text[:40]!a} is not understood and left out")
            return _with(shapes, [clip] if clip else [])
        source = drawing.referred(text, key)
        wanted = "clipPath" if key == "clip-path" else "mask"
        if source is None:
            return shapes
        if source.tag != wanted:
            drawing.notes.add(f"{key} refers to a <{source.tag[:40]}>, which is no <{wanted}>")
            return shapes
        self._note_mode(text, key, source)
        return _with(shapes, self._clips(source, shapes, place))

    def _basic(self, text: str, shapes: list[DrawnShape], place: Place) -> Clip | None:
        """Return what a basic shape of CSS cuts, or None for others."""
        if place.depth > 0:
            return _basic(text, _reference_box(text, shapes, place), place)
        # the outermost <svg> is a box of CSS: the page, in pixels
        window, view = self.drawing.window, self.drawing.view
        if window is None:
            return None
        corners = mapped(view, np.array(window).reshape(2, 2)).ravel().tolist()
        return _basic(text, tuple(corners), place.moved(np.linalg.inv(view)))

    def _note_mode(self, text: str, key: str, source: Element) -> None:
        """Note what a reference to a clip or mask says that is not read."""
        notes, rest = self.drawing.notes, REFERENCE.sub("", text, count=1).strip()
        if rest:
            notes.add(f"of {key} {text[:40]!a} only the first reference is read")
        style = self.drawing.styles.standing(source)
        if key == "mask" and style.get("color-interpolation") == "linearrgb":
            notes.add("a mask in linearRGB is read as one in sRGB")

    def _clips(self, source: Element, shapes: list[DrawnShape], place: Place) -> list[Clip]:
        """Return what a <clipPath> or <mask> cuts shapes by."""
        mask = source.tag == "mask"
        units = "maskContentUnits" if mask else "clipPathUnits"
        boxed = source.get(units) == "objectBoundingBox"
        framed = mask and source.get("maskUnits") != "userSpaceOnUse"
        box = bounds_of(shapes, place.matrix) if boxed or framed else None
        if (boxed or framed) and box is None:
            return [Clip([])]
        frame = np.array(box).tobytes()
        key = source, place.matrix.tobytes(), frame
        if key not in self._known:
            style = self.drawing.styles.standing(source)
            inner = replace(place, groups=()).styled({**style, "opacity": "1"})
            if not mask:
                inner = inner.moved(self.drawing.own_transform(source, style, inner))
            content = inner.moved(unit_box_matrix(box)) if boxed and box else inner
            found = [Clip(self._content(source, content), _kind(source, style))]
            if mask:
                found.append(
                    window_clip(_mask_frame(source, inner, box if framed else None), inner)
                )
            for name in ("clip-path", "mask"):
                if style.get(name, "none") != "none":
                    own = found[0].shapes
                    found[0] = replace(found[0], shapes=self.cut(own, name, style[name], content))
            self._known[key] = found
        return self._known[key]

    def _content(self, source: Element, place: Place) -> list[DrawnShape]:
        if np.linalg.det(place.matrix) == 0:
            return []
        drawing = self.drawing
        if source.tag == "mask":
            return drawing.children(source, place)
        found: list[DrawnShape] = []
        for child in source:  # a clip path holds shapes, not groups of them
            if child.tag == "use":
                target = drawing.named(reference(child), "<use>")
                if target is not None and target.tag in SHAPES | {"text"}:
                    found += drawing.visit(child, place)
                elif target is not None:
                    what = f"a <use> of a <{target.tag[:40]}> in a <clipPath>"
                    drawing.notes.add(f"{what} clips nothing and is left out")
            elif child.tag in SHAPES | {"text"}:
                found += drawing.visit(child, place)
            elif child.tag in ("g", "svg", "symbol", "switch", "a", "image"):
                drawing.notes.add(f"a <{child.tag}> in a <clipPath> clips nothing and is left out")
        return [shape for shape in found if not shape.decorates]


def window_clip(frame: Window, place: Place) -> Clip:
    """Return the rectangle x, y, width, height of a place as what cuts."""
    x, y, width, height = (repr(float(value)) for value in frame)
    return _as_clip("rect", {"x": x, "y": y, "width": width, "height": height}, place)


def _with(shapes: list[DrawnShape], clips: list[Clip]) -> list[DrawnShape]:
    return [replace(shape, clips=(*shape.clips, *clips)) for shape in shapes]


def _kind(source: Element, style: Style) -> str:
    if source.tag == "clipPath":
        return "clip"
    return style.get("mask-type", "luminance")


def _mask_frame(source: Element, place: Place, box: Window | None) -> Window:
    """Return x, y, width and height of the region of a mask, in its user units."""
    texts = {key: source.get(key, usual) for key, usual in _MASK_FRAME.items()}
    if box is None:
        x, y, width, height = (place.length(source, key, text) for key, text in texts.items())
        return x, y, width, height
    x, y, width, height = (as_number(text, 0.0) for text in texts.values())
    wide, high = box[2] - box[0], box[3] - box[1]
    return box[0] + x * wide, box[1] + y * high, width * wide, height * high


def _as_clip(tag: str, attributes: dict[str, str], place: Place, rule: str = "nonzero") -> Clip:
    """Return one of SVG's own shapes as what cuts."""
    inner = replace(place, style=attributes)
    paths = shape_paths(Element(tag, attributes), inner)
    return Clip([DrawnShape(paths, {"clip-rule": rule}, 1.0, place.matrix, 1.0, place)])


def _basic(text: str, box: Window | None, place: Place) -> Clip | None:
    """Return what a basic shape of CSS such as "circle(40% at center)" cuts, or None for others."""
    found = _BASIC.search(text)
    if found is None or box is None:
        return None
    xmin, ymin, xmax, ymax = box
    inner = place.moved(shift(xmin, ymin))
    size, content = (xmax - xmin, ymax - ymin), found[2].strip()
    rule = _RULE.match(content)
    content = content[rule.end() :] if rule else content
    try:
        tag, attributes = _MAKERS[found[1]](content, size)
    except (ValueError, IndexError):
        return None
    return _as_clip(tag, attributes, inner, rule[1] if rule else "nonzero")


def _reference_box(text: str, shapes: list[DrawnShape], place: Place) -> Window | None:
    if "view-box" in text:
        return 0.0, 0.0, *place.viewport
    box = bounds_of(shapes, place.matrix)
    if box is None or any(f"{key}-box" in text for key in ("fill", "content", "padding")):
        return box
    pens = [shape.width / 2 for shape in shapes if shape.paint.get("stroke", "none") != "none"]
    pen = max(pens, default=0.0)
    return box[0] - pen, box[1] - pen, box[2] + pen, box[3] + pen


_Size = tuple[float, float]
_Made = tuple[str, dict[str, str]]  # the name of a shape and its attributes


def _amount(word: str, relative: float) -> float:
    value = length(word, relative)
    if value is None:
        raise ValueError(word)
    return value


def _at(words: list[str], size: _Size) -> _Size:
    """Return the point after the word "at", or the middle."""
    k = words.index("at") if "at" in words else len(words)
    return origin_of(" ".join(words[k + 1 :]) or "center", size)


def _radius(word: str, reach: list[float], relative: float) -> float:
    """Return a radius: a length, or how far the sides are from the middle."""
    sides = {"closest-side": min, "farthest-side": max}
    return sides[word](reach) if word in sides else _amount(word, relative)


def _circle(text: str, size: _Size) -> _Made:
    words = text.split()
    x, y = _at(words, size)
    given = words[0] if words and words[0] != "at" else "closest-side"
    reach = [abs(side) for side in (x, size[0] - x, y, size[1] - y)]
    radius = _radius(given, reach, float(np.hypot(*size)) / 2**0.5)
    return "circle", {"cx": repr(x), "cy": repr(y), "r": repr(radius)}


def _ellipse(text: str, size: _Size) -> _Made:
    words = text.split()
    x, y = _at(words, size)
    given = words[: words.index("at")] if "at" in words else words
    first, second = (given + ["closest-side"] * 2)[:2]
    rx = _radius(first, [abs(x), abs(size[0] - x)], size[0])
    ry = _radius(second, [abs(y), abs(size[1] - y)], size[1])
    return "ellipse", {"cx": repr(x), "cy": repr(y), "rx": repr(rx), "ry": repr(ry)}


def _inset(text: str, size: _Size) -> _Made:
    text, _, corner = text.partition("round")
    top, right, bottom, left = _sides(text.split())
    t, b = (_amount(word, size[1]) for word in (top, bottom))
    r, left_side = (_amount(word, size[0]) for word in (right, left))
    attributes = {
        **{"x": repr(left_side), "y": repr(t)},
        **{"width": repr(size[0] - left_side - r), "height": repr(size[1] - t - b)},
    }
    if corner.strip():  # of one radius; others are refused
        (radius,) = corner.split()
        attributes |= {"rx": repr(_amount(radius, size[0])), "ry": repr(_amount(radius, size[1]))}
    return "rect", attributes


def _sides(words: list[str]) -> list[str]:
    """Return top, right, bottom and left of one to four words, as CSS repeats them."""
    if not 1 <= len(words) <= 4:
        raise ValueError(words)
    top, right = words[0], words[min(1, len(words) - 1)]
    return [top, right, words[2] if len(words) > 2 else top, words[3] if len(words) > 3 else right]


def _polygon(text: str, size: _Size) -> _Made:
    corners = [word.split() for word in text.split(",")]
    points = [f"{_amount(x, size[0])!r},{_amount(y, size[1])!r}" for x, y in corners]
    return "polygon", {"points": " ".join(points)}


def _path(text: str, size: _Size) -> _Made:  # noqa: ARG001
    found = _TEXT.fullmatch(text)
    if found is None:
        raise ValueError(text)
    return "path", {"d": found[1]}


_MAKERS = {
    **{"circle": _circle, "ellipse": _ellipse, "inset": _inset},
    **{"polygon": _polygon, "path": _path},
}
