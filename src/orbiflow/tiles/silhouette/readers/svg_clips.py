"""What cuts shapes: clip paths, masks, the frames of viewports, and the basic shapes of CSS."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element

import numpy as np
from svgelements import Path, Polygon, Shape

from orbiflow.arrays import Window
from orbiflow.tiles.silhouette.readers.svg_paths import sub_paths
from orbiflow.tiles.silhouette.readers.svg_shapes import (
    BAD_VALUE,
    SHAPES,
    Clip,
    DrawnShape,
    ElementPlace,
    bounds_of,
    ellipse,
    mapped,
    rectangle,
    unit_box_matrix,
)
from orbiflow.tiles.silhouette.readers.svg_values import (
    REFERENCE,
    as_number,
    length,
    origin_of,
    shift,
)
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

    def cut(
        self, shapes: list[DrawnShape], key: str, text: str, place: ElementPlace
    ) -> list[DrawnShape]:
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

    def _basic(self, text: str, shapes: list[DrawnShape], place: ElementPlace) -> Clip | None:
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

    def _clips(self, source: Element, shapes: list[DrawnShape], place: ElementPlace) -> list[Clip]:
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
            kind = style.get("mask-type", "luminance") if mask else "clip"
            found = [Clip(self._content(source, content), kind)]
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

    def _content(self, source: Element, place: ElementPlace) -> list[DrawnShape]:
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
        return [shape for shape in found if not shape.place.decorates]


def window_clip(frame: Window, place: ElementPlace) -> Clip:
    """Return the rectangle x, y, width, height of a place as what cuts."""
    return _as_clip(rectangle(*frame), place)


def _with(shapes: list[DrawnShape], clips: list[Clip]) -> list[DrawnShape]:
    return [replace(shape, clips=(*shape.clips, *clips)) for shape in shapes]


def _mask_frame(source: Element, place: ElementPlace, box: Window | None) -> Window:
    """Return x, y, width and height of the region of a mask, in its user units."""
    texts = {key: source.get(key, usual) for key, usual in _MASK_FRAME.items()}
    if box is None:
        x, y, width, height = (place.length(source, key, text) for key, text in texts.items())
        return x, y, width, height
    x, y, width, height = (as_number(text, 0.0) for text in texts.values())
    wide, high = box[2] - box[0], box[3] - box[1]
    return box[0] + x * wide, box[1] + y * high, width * wide, height * high


def _as_clip(shape: Shape | None, place: ElementPlace, rule: str = "nonzero") -> Clip:
    """Return a shape in the units of a place as what cuts."""
    paths = [] if shape is None else sub_paths(shape, place.matrix)
    return Clip([DrawnShape(paths, replace(place, style={"clip-rule": rule}), place.matrix)])


def _basic(text: str, box: Window | None, place: ElementPlace) -> Clip | None:
    """Return what a basic shape of CSS such as "circle(40% at center)" cuts, or None for others."""
    found = _BASIC.search(text)
    if found is None or box is None:
        return None
    xmin, ymin, xmax, ymax = box
    content = found[2].strip()
    rule = _RULE.match(content)
    content = content[rule.end() :] if rule else content
    try:
        shape = _MAKERS[found[1]](content, (xmax - xmin, ymax - ymin))
        return _as_clip(shape, place.moved(shift(xmin, ymin)), rule[1] if rule else "nonzero")
    except BAD_VALUE:
        return None


def _reference_box(text: str, shapes: list[DrawnShape], place: ElementPlace) -> Window | None:
    if "view-box" in text:
        return 0.0, 0.0, *place.viewport
    box = bounds_of(shapes, place.matrix)
    if box is None or any(f"{key}-box" in text for key in ("fill", "content", "padding")):
        return box
    pens = [shape.width / 2 for shape in shapes if shape.paint.get("stroke", "none") != "none"]
    pen = max(pens, default=0.0)
    return box[0] - pen, box[1] - pen, box[2] + pen, box[3] + pen


_Size = tuple[float, float]


def _amount(word: str, relative: float) -> float:
    value = length(word, relative)
    if value is None:
        raise ValueError(word)
    return value


def _round(text: str, size: _Size, *, is_circle: bool) -> Shape | None:
    """Return a circle or ellipse of radii, each a length or the distance from a side, "at" a point."""
    given, _, at = f" {' '.join(text.split())} ".partition(" at ")
    x, y = origin_of(at or "center", size)
    reach = [abs(x), abs(size[0] - x)], [abs(y), abs(size[1] - y)]
    words = [*given.split(), "closest-side", "closest-side"]
    if is_circle:
        rx = ry = _radius(words[0], reach[0] + reach[1], float(np.hypot(*size)) / 2**0.5)
    else:
        rx, ry = (_radius(word, reach[k], size[k]) for k, word in enumerate(words[:2]))
    return ellipse(x, y, rx, ry)


def _radius(word: str, reach: list[float], relative: float) -> float:
    sides = {"closest-side": min, "farthest-side": max}
    return sides[word](reach) if word in sides else _amount(word, relative)


def _inset(text: str, size: _Size) -> Shape | None:
    text, _, corner = text.partition("round")
    words = text.split()
    # top, right, bottom and left of one to four words, as CSS repeats them
    sides = [
        words[k] for k in ((0, 0, 0, 0), (0, 1, 0, 1), (0, 1, 2, 1), (0, 1, 2, 3))[len(words) - 1]
    ]
    top, right, bottom, left = (_amount(word, size[k % 2 == 0]) for k, word in enumerate(sides))
    radius = corner.split() or ["0"]  # of one radius; others are refused
    (rx, ry) = (_amount(word, own) for word, own in zip(radius * 2, size, strict=True))
    return rectangle(left, top, size[0] - left - right, size[1] - top - bottom, rx, ry)


def _polygon(text: str, size: _Size) -> Shape:
    corners = [word.split() for word in text.split(",")]
    return Polygon(*((_amount(x, size[0]), _amount(y, size[1])) for x, y in corners))


def _path(text: str, _: _Size) -> Shape:
    found = _TEXT.fullmatch(text)
    if found is None:
        raise ValueError(text)
    return Path({"d": found[1]})


_MAKERS: dict[str, Callable[[str, _Size], Shape | None]] = {
    **{name: partial(_round, is_circle=name == "circle") for name in ("circle", "ellipse")},
    **{"inset": _inset, "polygon": _polygon, "path": _path},
}
