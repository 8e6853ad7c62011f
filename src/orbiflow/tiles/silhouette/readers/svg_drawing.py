"""The shapes that an SVG drawing shows, with their transforms, found by a walk of its elements."""

from collections import Counter
from dataclasses import replace
from itertools import islice
from urllib.parse import unquote
from xml.etree.ElementTree import Element

import numpy as np

from orbiflow.arrays import Array, Window
from orbiflow.errors import InputFileError
from orbiflow.tiles.silhouette.readers.reading import Source, read_bytes
from orbiflow.tiles.silhouette.readers.svg_clips import Clips, window_clip
from orbiflow.tiles.silhouette.readers.svg_css import Style, Styles
from orbiflow.tiles.silhouette.readers.svg_paths import corners
from orbiflow.tiles.silhouette.readers.svg_shapes import (
    MARKED,
    SHAPES,
    BadElement,
    DrawnShape,
    ElementPlace,
    bounds_of,
    mapped,
    path_tokens,
    shape_paths,
    view_box,
    view_matrix,
)
from orbiflow.tiles.silhouette.readers.svg_values import (
    KEYWORDS,
    MAX_TRANSFORM,
    REFERENCE,
    NotATransform,
    angle,
    as_number,
    colour_of,
    origin_of,
    quantity,
    shift,
    single_transforms,
    transform_matrix,
)
from orbiflow.tiles.silhouette.readers.svg_xml import MAX_DEPTH, Notes, is_own, parse_xml, reference

MAX_BYTES = 16 * 2**20
MAX_DRAWN = 10_000  # elements, those drawn again by <use>, clips, masks and markers counted again
MAX_TOKENS = 400_000  # commands and numbers in all path data; one with a fraction counts twice
PAGE_TOLERANCE = 1e-9  # of the page: what reaches beyond it by less does not
LANGUAGE = "en"  # what drawings in several languages are read in
_SOURCE = "SourceGraphic"  # what a filter's first step is of
_GROUPS = {"svg", "g", "a", "switch"}
_OTHERS = {
    **{"image": "image", "text": "text", "flowRoot": "text", "foreignObject": "piece of HTML"},
    **dict.fromkeys(("video", "audio", "canvas", "iframe"), "piece of HTML"),
}
_PLURALS = {"piece of HTML": "pieces of HTML"}
_ANIMATIONS = {"animate", "animateTransform", "animateMotion", "animateColor", "set"}
_MOVES = ("transform", "translate", "rotate", "scale")
# what changes how a drawing is seen and is not drawn, with the values that change nothing
_EFFECTS = {
    "stroke-linejoin": ("a stroke-linejoin is drawn as miter", {"miter", "round", "bevel"}),
    "mix-blend-mode": ("blends (mix-blend-mode) are left out", {"normal"}),
    "offset-path": ("the property offset-path is left out", {"none"}),
    "mask-image": ("the property mask-image is left out", {"none"}),
    "animation": ("read as it stands, without its animations", {"none"}),
    "animation-name": ("read as it stands, without its animations", {"none"}),
}


class Drawing:
    """The shapes of the SVG drawing in a file, and what was met that is not drawn.

    - `box`: The page (xmin, ymin, xmax, ymax) in user units: the viewBox, or the size; None without.
    - `ground`: The colour that CSS gives the page, if it gives one.
    - `window`: What of the plane is seen, which is wider than the page where its sides' ratio is not
      that of the size; None without a page.
    - `view`: The map (3, 3) from user units to pixels.
    """

    def __init__(self, path: Source) -> None:
        self.path, self.root = path, parse_xml(path, read_bytes(path, MAX_BYTES))
        self.others, self.notes = Counter[str](), Notes()
        self.visited = self.tokens = 0
        self.styles = Styles(path, self.root, self.notes)
        self.by_id: dict[str, Element] = {}
        for item in self.root.iter():
            if is_own(item) and (key := item.get("id")):
                self.by_id.setdefault(key, item)
        self.clips = Clips(self)
        try:
            self._read()
        except BadElement as exc:
            raise InputFileError(f"{path}: {exc.message}") from exc

    def left_out(self) -> list[str]:
        """Return notes of what was met and is not drawn, or not as it is written."""
        left = [
            f"{count} {name if count == 1 else _PLURALS.get(name, f'{name}s')}"
            for name, count in self.others.items()
        ]
        return [f"left out {' and '.join(left)} of the drawing"] * bool(left) + self.notes.counted()

    def referred(self, text: str | None, what: str) -> Element | None:
        """Return the element that `url(#id)` names; say so if there is none."""
        found = REFERENCE.match(text or "")
        return self.named(next(filter(None, found.groups()), ""), what) if found else None

    def named(self, target: str | None, what: str) -> Element | None:
        """Return the element that "#id" names; say so if there is none."""
        target = (target or "").strip()
        if not target:
            return None
        name = target[1:] if target.startswith("#") else ""
        element = self.by_id.get(name, self.by_id.get(unquote(name)))
        if element is None:
            where = "is not there" if target.startswith("#") else "is outside the file"
            self.notes.add(f"{what} refers to {target[:40]!a}, which {where}")
        return element

    def _read(self) -> None:
        style = self.styles.standing(self.root)
        self.sides = [self._pixels(style, key) for key in ("width", "height")]
        self.box, self.window, view = self._page()
        if any(item.tag in _ANIMATIONS for item in self.root.iter()):
            self.notes.add(_EFFECTS["animation"][0])
        if self.root.get("{}xml-stylesheet"):
            self.notes.add("style sheets in other files are not read")
        xmin, ymin, xmax, ymax = self.box or (0.0, 0.0, 100.0, 100.0)
        size = xmax - xmin, ymax - ymin
        place = ElementPlace(np.eye(3), size, {}, self.styles.rem, depth=-1).styled(style)
        self.view = view
        ground = colour_of(style.get("background-color", "transparent"))
        self.ground = ground.colour if ground and ground.opacity == 1 else None
        about = np.linalg.inv(view) @ self.own_transform(self.root, style, place, "50% 50%") @ view
        inner = place.moved(about)
        found = [] if style.get("display") == "none" else self.children(self.root, inner)
        self.shapes = self._cut(found, style, inner)

    def _page(self) -> tuple[Window | None, Window | None, Array]:
        """Return the page in user units, the part of the plane that shows, and the map to pixels."""
        box = view_box(self.root)
        width, height = (side if side and side > 0 else None for side in self.sides)
        if box is None:
            page = None if width is None or height is None else (0.0, 0.0, width, height)
            return page, page, np.eye(3)
        page = box[0], box[1], box[0] + box[2], box[1] + box[3]
        if width is None or height is None:
            return page, page, np.eye(3)
        view = view_matrix(self.root, (0.0, 0.0, width, height))[0]
        if not np.isfinite(np.linalg.inv(view)).all():
            return page, page, np.eye(3)
        corners = np.array([[0.0, 0.0], [width, height]]) - view[:2, 2]
        (xmin, ymin), (xmax, ymax) = (corners / np.diag(view)[:2]).tolist()
        margin = PAGE_TOLERANCE * max(xmax - xmin, ymax - ymin)  # the page's own edge is not cut
        return page, (xmin - margin, ymin - margin, xmax + margin, ymax + margin), view

    def _pixels(self, style: Style, key: str) -> float | None:
        """Return the width or height of the root in pixels, or None if it is a share or not given."""
        text = style.get(key, "").strip()
        if not text or text.endswith("%") or text == "auto":
            return None
        return ElementPlace(np.eye(3), (0.0, 0.0), style).length(self.root, key, text)

    def pixel(self) -> float:
        """Return the size of a pixel in user units."""
        xmin, ymin, xmax, ymax = self.box or (0.0, 0.0, 1.0, 1.0)
        sizes = zip((xmax - xmin, ymax - ymin), self.sides, strict=True)
        return max(own / (pixels or own) for own, pixels in sizes)

    def children(self, element: Element, place: ElementPlace) -> list[DrawnShape]:
        """Return the shapes that the elements inside one show."""
        return [shape for child in element if is_own(child) for shape in self.visit(child, place)]

    def visit(self, element: Element, place: ElementPlace) -> list[DrawnShape]:
        """Return the shapes that an element shows in a place, from bottom to top."""
        self.visited += 1
        if self.visited > MAX_DRAWN:
            raise InputFileError(
                f"{self.path}: draws more than {MAX_DRAWN} elements; keep only the silhouette"
            )
        if place.depth > MAX_DEPTH:
            raise InputFileError(
                f"{self.path}: <use> elements refer to each other in a circle or nest too deeply"
            )
        style = self.styles.computed(element, place.style)
        if style.get("display") == "none" or not self._meant(element):
            return []
        place = place.styled(style)
        if not style.keys().isdisjoint(_MOVES):
            place = place.moved(self.own_transform(element, style, place))
            if np.linalg.det(place.matrix) == 0:  # flat
                return []
        return self._cut(self._content(element, place), style, self._inside(element, place))

    def _inside(self, element: Element, place: ElementPlace) -> ElementPlace:
        """Return the place in whose units an element's clips are: after its own shift or view."""
        if element.tag == "use":
            return self._shifted(element, place)
        if element.tag == "svg":
            frame = self._frame(element, place.style, place)
            matrix, size = view_matrix(element, frame)
            return replace(place.moved(matrix), viewport=size)
        return place

    def _shifted(self, use: Element, place: ElementPlace) -> ElementPlace:
        x, y = (place.length(use, key, place.style.get(key)) for key in ("x", "y"))
        return place.moved(shift(x, y))

    def _content(self, element: Element, place: ElementPlace) -> list[DrawnShape]:
        tag = element.tag
        if tag == "svg":
            return self.viewport(element, self._frame(element, place.style, place), place)
        if tag == "switch":
            drawn = _GROUPS | SHAPES | {"use", "text", "image"}
            chosen = (child for child in element if child.tag in drawn and self._meant(child))
            return [shape for child in islice(chosen, 1) for shape in self.visit(child, place)]
        if tag in _GROUPS:
            return self.children(element, place)
        if tag == "use":
            return self._use(element, place)
        if tag in SHAPES:
            return self._shape(element, place)
        if tag in _OTHERS and place.style.get("visibility", "visible") == "visible":
            empty = tag in ("text", "flowRoot") and not "".join(element.itertext()).strip()
            self.others += Counter([_OTHERS[tag]] * (not empty))
        return []

    def _cut(self, shapes: list[DrawnShape], style: Style, place: ElementPlace) -> list[DrawnShape]:
        """Return shapes cut by the clip and mask of their element, and note its other effects."""
        if style.get("filter", "none") != "none":
            tint = self._tint(style["filter"])
            self.others += Counter(["filter"] * (tint is None))
            shapes = [replace(shape, tint=tint or shape.tint) for shape in shapes]
        for key, (note, harmless) in _EFFECTS.items():
            if style.get(key, "none").lower() not in {"none", *harmless}:
                self.notes.add(note)
        for key in ("clip-path", "mask"):
            if shapes and style.get(key, "none") != "none":
                shapes = self.clips.cut(shapes, key, style[key], place)
        return shapes

    def _tint(self, text: str) -> str | None:
        """Return the pure colour that a filter gives all it is of, as Canva's masks are made white.

        None is of a filter that does more than that.
        """
        found = REFERENCE.fullmatch(text.strip())
        target = "".join(filter(None, found.groups())) if found else ""
        source = self.by_id.get(target[1:]) if target.startswith("#") else None
        steps = [] if source is None or source.tag != "filter" else list(source)
        if len(steps) != 1 or steps[0].tag != "feColorMatrix":
            return None
        if steps[0].get("type", "matrix") != "matrix" or steps[0].get("in", _SOURCE) != _SOURCE:
            return None
        words = (steps[0].get("values") or "")[:MAX_TRANSFORM].replace(",", " ").split()
        try:
            rows = np.array(words, float).reshape(4, 5)
        except ValueError:
            return None
        pure = not rows[:3, :4].any() and ((rows[:3, 4] <= 0) | (rows[:3, 4] >= 1)).all()
        if not (pure and (rows[3] == [0, 0, 0, 1, 0]).all()):
            return None
        return "#" + "".join("ff" if value >= 1 else "00" for value in rows[:3, 4])

    def _meant(self, element: Element) -> bool:
        """Return whether an element is meant for a program like this one and its language."""
        if element.get("requiredExtensions") is not None:
            return False
        languages = element.get("systemLanguage")
        if languages is None:
            return True
        tags = [tag.strip().lower() for tag in languages.split(",")]
        meant = any(tag == LANGUAGE or tag.startswith(f"{LANGUAGE}-") for tag in tags)
        if not meant:
            self.notes.add(f"left out what is for other languages than {LANGUAGE!a}")
        return meant

    def _use(self, use: Element, place: ElementPlace) -> list[DrawnShape]:
        target = self.named(reference(use), "<use>")
        if target is None:
            return []
        fill, stroke = place.style.get("fill", "#000000"), place.style.get("stroke", "none")
        place = replace(self._shifted(use, place), context=(fill, stroke))
        if target.tag not in ("symbol", "svg"):
            return self.visit(target, place)
        if place.depth > MAX_DEPTH:
            return self.visit(target, place)  # which refuses it
        style = self.styles.computed(target, place.style)
        if style.get("display") == "none" and target.tag == "svg":
            return []
        sizes = ((key, place.style.get(key, "auto")) for key in ("width", "height"))
        own = {key: text for key, text in sizes if text != "auto"}
        inner = place.styled(style)
        inner = inner.moved(self.own_transform(target, style, inner))
        frame = self._frame(target, {**style, **own}, inner)
        return self._cut(self.viewport(target, frame, inner), style, inner)

    def _frame(self, element: Element, style: Style, place: ElementPlace) -> Window:
        """Return x, y, width and height of an inner <svg> or a <symbol>."""
        usual = {"x": 0.0, "y": 0.0, "width": place.viewport[0], "height": place.viewport[1]}
        x, y, width, height = (
            place.length(element, key, style.get(key), own) for key, own in usual.items()
        )
        return x, y, width, height

    def viewport(self, element: Element, frame: Window, place: ElementPlace) -> list[DrawnShape]:
        """Return what an inner <svg>, a <symbol> or a <marker> shows in a frame, cut at its edges."""
        if not np.isfinite(frame).all():
            raise BadElement(element, "its size cannot be read")
        if not (frame[2] > 0 and frame[3] > 0):
            return []
        matrix, size = view_matrix(element, frame)
        own = self.children(element, replace(place.moved(matrix), viewport=size))
        if place.style.get("overflow") in ("visible", "auto") or not own:
            return own
        clip = window_clip(frame, place)
        return [replace(shape, clips=(*shape.clips, clip)) for shape in own]

    def _shape(self, element: Element, place: ElementPlace) -> list[DrawnShape]:
        self.tokens += path_tokens(element, place.style)
        if self.tokens > MAX_TOKENS:
            raise BadElement(element, "the paths hold too much data; simplify the drawing")
        paths = shape_paths(element, place)
        own = as_number(element.get("pathLength"), -1.0)
        drawn = DrawnShape(paths, place, place.matrix, own if own >= 0 else None)
        if drawn.keeps_its_width:
            drawn = replace(drawn, matrix=np.diag([self.pixel()] * 2 + [1.0]))
        return self._with_markers(element, drawn, place)

    def _with_markers(
        self, element: Element, shape: DrawnShape, place: ElementPlace
    ) -> list[DrawnShape]:
        """Return a shape and its markers, in the order in which they are painted."""
        if element.tag not in MARKED or place.style.get("visibility", "visible") != "visible":
            return [shape]
        named: dict[str, Element] = {}
        for key in ("start", "mid", "end"):
            text = place.style.get(f"marker-{key}", "none")
            found = self.referred(text, f"marker-{key}") if text != "none" else None
            if found is not None and found.tag == "marker":
                named[key] = found
        drawn = [
            one
            for key, (x, y), turn in corners(
                shape.paths if named else [], np.linalg.inv(place.matrix)
            )
            if key in named
            for one in self._marker(named[key], shape, place.moved(shift(x, y)), turn, key)
        ]
        order = place.style.get("paint-order", "").split()
        return [*drawn, shape] if order[:1] == ["markers"] else [shape, *drawn]

    def _marker(
        self, marker: Element, shape: DrawnShape, place: ElementPlace, turn: float, key: str
    ) -> list[DrawnShape]:
        """Return what one marker shows with its reference point at the origin of a place."""
        orient = marker.get("orient", "0").strip()
        if not orient.startswith("auto"):
            turn = angle(orient) or 0.0
        elif orient == "auto-start-reverse" and key == "start":
            turn += np.pi
        scale = 1.0 if marker.get("markerUnits") == "userSpaceOnUse" else shape.width
        x, y = scale * np.cos(turn), scale * np.sin(turn)
        inner = place.moved(np.array([[x, -y, 0.0], [y, x, 0.0], [0, 0, 1.0]]))
        context = place.style.get("fill", "#000000"), place.style.get("stroke", "none")
        inner = replace(inner, context=context, decorates=True)
        inner = inner.styled(self.styles.standing(marker))
        if np.linalg.det(inner.matrix) == 0:
            return []
        box = view_box(marker)
        size = replace(inner, viewport=box[2:] if box else inner.viewport)
        sides = [(name, marker.get(name)) for name in ("markerWidth", "markerHeight")]
        width, height = (size.length(marker, name, text, 3.0) for name, text in sides)
        whole = box or (0.0, 0.0, width, height)
        at: list[float] = []
        for k, name in enumerate(("refX", "refY")):
            text = (marker.get(name) or "0").strip()
            if text in KEYWORDS:
                at.append(whole[k] + as_number(KEYWORDS[text], 0.0) * whole[2 + k])
            else:
                at.append(size.length(marker, name, text if quantity(text) else "0"))
        frame = (0.0, 0.0, width, height)
        x, y = -mapped(view_matrix(marker, frame)[0], np.array([at]))[0]
        return self.viewport(marker, (x, y, width, height), inner)

    def _own_box(self, element: Element, place: ElementPlace) -> Window:
        """Return the box of what an element holds, in the units of a place, without counting it."""
        others, texts = self.others.copy(), self.notes.texts.copy()
        box = bounds_of(self._content(element, place), place.matrix)
        self.others, self.notes.texts = others, texts
        return box or (0.0, 0.0, 0.0, 0.0)

    def own_transform(
        self, element: Element, style: Style, place: ElementPlace, origin: str = "0 0"
    ) -> Array:
        """Return the matrix of an element's transforms, about their origin."""
        texts = [style.get(key, "none") for key in _MOVES]
        if all(text in ("none", "") for text in texts):
            return np.eye(3)
        size, corner = place.viewport, (0.0, 0.0)
        if style.get("transform-box", "view-box") != "view-box" and element is not self.root:
            xmin, ymin, xmax, ymax = self._own_box(element, place)
            size, corner = (xmax - xmin, ymax - ymin), (xmin, ymin)
        try:
            text = "" if texts[0] == "none" else texts[0]
            matrix = single_transforms(texts[1], texts[2], texts[3], size)
            matrix = matrix @ transform_matrix(text, size)
        except NotATransform as exc:
            text = " ".join(text for text in texts if text != "none")
            raise BadElement(element, f"transform {text[:60]!a} cannot be read") from exc
        try:
            x, y = origin_of(style.get("transform-origin", origin), size)
        except NotATransform:
            self.notes.add(f"transform-origin {style['transform-origin'][:40]!a} is not understood")
            x, y = 0.0, 0.0
        return shift(x + corner[0], y + corner[1]) @ matrix @ shift(-x - corner[0], -y - corner[1])
