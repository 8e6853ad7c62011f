"""SVG documents made safe to render: bounded, complete in themselves, with their page known."""

from __future__ import annotations

import base64
import binascii
import contextlib
import math
import re
from collections import Counter
from collections.abc import Iterator
from urllib.parse import unquote, unquote_to_bytes
from xml.etree.ElementTree import Element

import svgelements

from orbiflow.arrays import Window
from orbiflow.errors import InputFileError
from orbiflow.tiles.silhouette.readers.image_files import decoded_image
from orbiflow.tiles.silhouette.readers.reading import FileContent, quoted
from orbiflow.tiles.silhouette.readers.svg_styles import write_styles
from orbiflow.tiles.silhouette.readers.svg_xml import HREF, Notes, is_own, parse_xml

MAX_BYTES = 16 * 2**20
PAGE_TOLERANCE = 1e-9  # of the page: what is seen of the plane is the page if it differs by less
_PIXELS = {
    **{"": 1.0, "px": 1.0, "pt": 4 / 3, "pc": 16.0, "in": 96.0, "em": 16.0, "rem": 16.0, "ex": 8.0},
    **{"cm": 96 / 2.54, "mm": 96 / 25.4, "q": 96 / 101.6},
}
_RARE = {"q", "rem"}  # units that the renderer does not know
_LENGTH = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)\s?([a-z]*)\s*", re.IGNORECASE)
_URL = re.compile(r"url\(\s*(?P<quote>[\"']?)(?P<target>[^)]*?)(?P=quote)\s*\)", re.IGNORECASE)
_IMPORT = re.compile(r"@import\b[^;]*;?", re.IGNORECASE)
_DATA = re.compile(r"data:image/(png|jpe?g|gif|webp)\s*(;[^,]*)?,", re.IGNORECASE)
_SIZES = re.compile(r"(?<![\w-])(width|height)\s*:\s*([^;]*)", re.IGNORECASE)
_HTML = {"foreignObject", "video", "audio", "canvas", "iframe"}
_ANIMATIONS = {"animate", "animateTransform", "animateMotion", "animateColor", "set", "discard"}
_DROPPED = {**dict.fromkeys(_HTML, "a piece of HTML"), "script": "", "metadata": ""}
_EFFECT = "vector-effect"
# what the library raises for texts that are damaged
_DAMAGED = (ValueError, TypeError, IndexError, AttributeError, ArithmeticError)


class Document:
    """An SVG document that can be rendered without reading or fetching anything else.

    - `root`: Its elements, all of SVG's own; references lead to others of them or hold their data.
    - `box`: The page (xmin, ymin, xmax, ymax) in user units: the viewBox, or the size; None without.
    - `pixel`: The size of a pixel of the screen in user units.
    - `window`: What of the plane is seen, which is wider than the page where its sides' ratio is not
      that of the size; None without a page.

    Raises `InputFileError` for one that is damaged or too large. What references multiply is for the
    renderer to refuse, which runs within bounds.
    """

    def __init__(self, path: FileContent) -> None:
        self.path, self.notes, self.left_out = path, Notes(), Counter[str]()
        self.root = parse_xml(path, path.within(MAX_BYTES))
        if self.root.attrib.pop("{}xml-stylesheet", None):
            self.notes.add("style sheets in other files are not read")
        write_styles(path, self.root, self.notes)
        self._make_safe(self.root)
        self._note_missing()
        self.box, self.window = self._page()
        if self.root.attrib.pop("transform", None):
            self.notes.add("the transform of <svg> is left out: put it on a group")
        if any(
            _EFFECT in item.get("style", "") or _EFFECT in item.attrib for item in self.root.iter()
        ):
            self._thin_strokes(self.root, svgelements.Matrix())

    @property
    def has_text(self) -> bool:
        """Whether there is text, which is drawn in fonts."""
        return any(item.tag == "text" for item in self.root.iter())

    def said(self) -> list[str]:
        """Return notes of what was met and is not drawn."""
        left = [f"{count} {name}{'s' * (count > 1)}" for name, count in self.left_out.items()]
        return [f"left out {' and '.join(left)} of the drawing"] * bool(left) + self.notes.counted()

    def _make_safe(self, element: Element) -> None:
        for child in list(element):
            name = _DROPPED.get(child.tag)
            if child.tag in _ANIMATIONS:
                self.notes.add("read as it stands, without its animations")
            elif name is None and is_own(child):
                self._make_safe(child)
                continue
            elif name and child.get("requiredExtensions") is None:
                self.left_out["piece of HTML"] += 1
            element.remove(child)
        if element.tag == "style":
            text = "".join(element.itertext())
            if _IMPORT.search(text):
                self.notes.add("style sheets in other files are not read")
            element.text = self._within(_IMPORT.sub("", text))
        self._make_attributes_safe(element)

    def _make_attributes_safe(self, element: Element) -> None:
        link = element.attrib.pop(HREF, None)
        link = element.attrib.pop("href", link)
        for key in [key for key in element.attrib if key[:1] == "{" and not key.endswith("}space")]:
            del element.attrib[key]
        for key, text in element.items():
            if "url" in text.lower():
                element.set(key, self._within(text))
            elif key in LENGTHS and (size := _LENGTH.fullmatch(text)) and size[2].lower() in _RARE:
                element.set(key, f"{float(size[1]) * _PIXELS[size[2].lower()]:.9g}")
        if element.attrib.pop("pathLength", None) is not None:
            self.notes.add("drew whole what has dashes of a declared length (pathLength)")
            style = properties(element) | {"stroke-dasharray": "none"}
            element.set("style", text_of(style))
        if link is not None and element.tag != "a":
            link = link.strip()
            if link.startswith("#") or (
                element.tag in ("image", "feImage") and self._is_data(link)
            ):
                element.set("href", link)
            elif element.tag in ("image", "feImage"):
                self.left_out["image in another file"] += not link.lower().startswith("data:")
                self.left_out["image of another kind"] += link.lower().startswith("data:")
                self.left_out = +self.left_out
            elif link:
                self.notes.add(
                    f"<{element.tag}> refers to {quoted(link)}, which is outside the file"
                )

    def _within(self, text: str) -> str:
        """Return a text of style whose references to other files lead nowhere."""

        def safe(match: re.Match[str]) -> str:
            if match["target"].strip().startswith("#"):
                return match[0]
            self.notes.add(f"{quoted(match['target'])} is outside the file, and is not read")
            return "none"

        return _URL.sub(safe, text)

    def _is_data(self, link: str) -> bool:
        """Return whether a link holds the data of a picture within bounds."""
        match = _DATA.match(link)
        if match is None:
            return False
        try:
            text = link[match.end() :]
            encoded = "base64" in (match[2] or "").lower()
            data = base64.b64decode(text) if encoded else unquote_to_bytes(text)
            decoded_image(FileContent(data, f"{self.path}: a picture in it"))
        except (binascii.Error, ValueError):
            return False
        return True

    def _note_missing(self) -> None:
        """Note references to elements that are not there."""
        names = {item.get("id") for item in self.root.iter()}
        for item in self.root.iter():
            links = [] if item.tag == "a" else [item.get("href", "")]
            for text in item.attrib.values():
                links += [match["target"].strip() for match in _URL.finditer(text)]
            for name in (link[1:] for link in links if link.startswith("#")):
                if not names & {name, unquote(name)}:
                    self.notes.add(f"<{item.tag}> refers to '#{name[:40]}', which is not there")

    def _page(self) -> tuple[Window | None, Window | None]:
        """Return the page in user units, and the part of the plane that shows."""
        inline = dict(_SIZES.findall(self.root.get("style", "")))
        width, height = (
            self._pixels(key, inline.get(key, self.root.get(key))) for key in ("width", "height")
        )
        text, self.pixel = self.root.get("viewBox"), 1.0
        if text is None:
            page = None if not (width and height) else (0.0, 0.0, width, height)
            return page, page
        try:
            x, y, wide, high = map(float, text.replace(",", " ").split())
        except ValueError:
            x, y, wide, high = (math.nan,) * 4
        if not (math.isfinite(x + y + wide + high) and wide > 0 and high > 0):
            raise InputFileError(
                f"{self.path}: <svg>: viewBox {quoted(text)} should be four numbers, such as "
                "'0 0 100 100', the last two above 0"
            )
        page = x, y, x + wide, y + high
        self.pixel = max(
            side / (pixels or side) for side, pixels in ((wide, width), (high, height))
        )
        aspect = self.root.get("preserveAspectRatio", "xMidYMid").split()
        if not (width and height) or "none" in aspect:
            return page, page
        scale = (max if "slice" in aspect else min)(width / wide, height / high)
        sides = width / scale, height / scale
        align = aspect[0] if aspect else "xMidYMid"
        shares = [
            next((share for word, share in _ALIGN.items() if f"{axis}{word}" in align), 0.5)
            for axis in "xY"
        ]
        left, top = x + shares[0] * (wide - sides[0]), y + shares[1] * (high - sides[1])
        window = left, top, left + sides[0], top + sides[1]
        gap = max(abs(side - other) for side, other in zip(page, window, strict=True))
        return page, page if gap <= PAGE_TOLERANCE * max(wide, high) else window

    def _thin_strokes(self, element: Element, matrix: svgelements.Matrix) -> None:
        """Give strokes that are as wide in any transform the width that renderers then make so."""
        if text := element.get("transform"):
            with contextlib.suppress(*_DAMAGED):
                matrix = svgelements.Matrix(text) * matrix
        style = properties(element)
        if style.get(_EFFECT, element.get(_EFFECT)) == "non-scaling-stroke":
            scale = math.sqrt(abs(matrix.a * matrix.d - matrix.b * matrix.c)) / self.pixel
            width = _number(style.get("stroke-width", element.get("stroke-width", "1")))
            style["stroke-width"] = f"{width / (scale or 1.0):.9g}"
            element.set("style", text_of(style))
        for child in element:
            self._thin_strokes(child, matrix)

    def _pixels(self, key: str, text: str | None) -> float | None:
        """Return a length of the root in pixels; None for none, a share or `auto`."""
        text = (text or "").strip()
        if not text or text.endswith("%") or text == "auto":
            return None
        length = _LENGTH.fullmatch(text)
        if length is None or length[2].lower() not in _PIXELS:
            raise InputFileError(f"{self.path}: <svg>: {key} {quoted(text)} is not a length")
        value = float(length[1]) * _PIXELS[length[2].lower()]
        return value if 0 < value < math.inf else None


def leaves(root: Element) -> Iterator[tuple[Element, Element]]:
    """Yield each element that draws by itself, with its parent, from bottom to top."""
    stack = [(root, iter(root))]
    while stack:
        parent, children = stack[-1]
        child = next(children, None)
        if child is None:
            stack.pop()
        elif child.tag in ("svg", "g", "a", "switch"):
            stack.append((child, iter(child)))
        elif child.tag in DRAWN:
            yield child, parent


def properties(element: Element) -> dict[str, str]:
    """Return the properties in the attribute `style`, as `write_styles` has written it."""
    parts = element.get("style", "").split(";")
    return dict(part.strip().split(":", 1) for part in parts if ":" in part)


def text_of(style: dict[str, str]) -> str:
    """Return properties as the attribute `style` holds them."""
    return ";".join(f"{key}:{text}" for key, text in style.items())


def _number(text: str) -> float:
    """Return the number that a text begins with; 0 without one."""
    length = _LENGTH.match(text)
    return float(length[1]) if length else 0.0


_ALIGN = {"Min": 0.0, "Mid": 0.5, "Max": 1.0}
LENGTHS = {"x", "y", "cx", "cy", "r", "rx", "ry", "width", "height", "stroke-width"}
"""Attributes that are lengths."""

DRAWN = {"path", "rect", "circle", "ellipse", "line", "polyline", "polygon", "use", "image", "text"}
"""Elements that draw by themselves."""
