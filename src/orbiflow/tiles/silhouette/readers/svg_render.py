"""Pictures of SVG documents, as resvg draws them: the truth about what is seen of a drawing."""

from __future__ import annotations

import io
from collections.abc import Collection
from copy import deepcopy
from functools import cached_property
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np
import reportlab
import tinycss2.color3
from numpy.typing import NDArray
from PIL import Image
from tinycss2.color3 import parse_color

from orbiflow.arrays import Array, Window
from orbiflow.errors import InputFileError
from orbiflow.tiles.silhouette.readers.reading import FileContent, content_of
from orbiflow.tiles.silhouette.readers.svg_documents import Document, leaves, properties, text_of
from orbiflow.tiles.silhouette.readers.svg_process import Renderer, RendererFailed
from orbiflow.tiles.silhouette.readers.svg_xml import SVG

DPI = 96
"""Pixels of the screen in an inch, by which lengths such as 3mm are user units."""

LANGUAGE = "en"
"""What drawings in several languages are read in."""

STAND_IN = "Bitstream Vera Sans"
"""The font of texts whose own is not on the machine."""

_STAND_IN_FILE = Path(reportlab.__file__).parent / "fonts" / "Vera.ttf"
_SAMPLE = "<svg xmlns='%s' viewBox='0 0 9 9'><text y='9' font-family='%s'>A</text></svg>"
_GENERIC = {"serif", "sans-serif", "monospace", "cursive", "fantasy", "system-ui", "inherit"}

Rgba = NDArray[np.uint8]
"""Pixels (height, width, 4), their colours not multiplied by their opacity."""


class Drawing:
    """The drawing in an SVG file: its page, and what is seen of any part of the plane.

    Raises `InputFileError` as `Document`.
    """

    def __init__(self, source: Path | FileContent) -> None:
        self.path = content_of(source)
        self.document = Document(self.path)
        self.box, self.window = self.document.box, self.document.window
        self._renderer = Renderer()

    def notes(self) -> list[str]:
        """Return what was met and is not drawn, or not as it is written."""
        return [*self.document.said(), *self._fonts]

    def pixels(self, window: Window, size: tuple[int, int], root: Element | None = None) -> Rgba:
        """Return what is seen of a window (xmin, ymin, xmax, ymax), of a width and height in pixels.

        With `root` it is seen of that version of the document.
        """
        xmin, ymin, xmax, ymax = window
        whole = self.document.root if root is None else root
        shown = Element("svg", xmlns=SVG)
        if window == self.box:
            shown.attrib.update(whole.attrib)
            shown.extend(whole)
        else:  # percentages are those of the page
            left, top, right, bottom = self.box or (0.0, 0.0, 100.0, 100.0)
            page = {"x": left, "y": top, "width": right - left, "height": bottom - top}
            inner = SubElement(shown, "svg", whole.attrib)
            inner.attrib.update({key: repr(value) for key, value in page.items()})
            inner.set("viewBox", " ".join(inner.attrib[key] for key in page))
            inner.set("overflow", "visible")
            inner.extend(whole)
        shown.attrib.pop("xmlns")
        shown.attrib.update(xmlns=SVG, width=str(size[0]), height=str(size[1]))
        shown.set("viewBox", f"{xmin!r} {ymin!r} {xmax - xmin!r} {ymax - ymin!r}")
        shown.set("preserveAspectRatio", "none")
        fonts = _fonts(STAND_IN) if self.document.has_text else {"skip_system_fonts": True}
        return self._drawn(tostring(shown, encoding="unicode"), fonts)

    def _drawn(self, text: str, fonts: dict[str, Any]) -> Rgba:
        try:
            png = self._renderer.png(text, {"dpi": DPI, "languages": [LANGUAGE], **fonts})
        except RendererFailed as error:
            why = f" ({error})" if str(error) else ", or takes more memory or time than it should"
            raise InputFileError(
                f"{self.path}: cannot be drawn{why}; simplify it, and leave out filters and patterns"
            ) from error
        return np.asarray(Image.open(io.BytesIO(png)).convert("RGBA"))

    @cached_property
    def _fonts(self) -> list[str]:
        """Notes of fonts that are not on this machine, in place of which another was used."""
        if not self.document.has_text:
            return []
        fonts = {
            name
            for item in self.document.root.iter()
            for text in _families(item)
            if (name := text.split(",")[0].strip(" '\"")) and name.lower() not in _GENERIC
        }
        missing = sorted(name for name in fonts if not self._has_font(name))
        return [
            f"the font {name[:40]!r} is not on this machine, {STAND_IN} stood in for it: convert the "
            "text to paths"
            for name in missing[:3]
        ]

    def _has_font(self, name: str) -> bool:
        """Whether a font is on this machine: without it and a stand-in, nothing is drawn."""
        text = _SAMPLE % (SVG, "".join(c for c in name if c.isalnum() or c in " -_"))
        return bool(self._drawn(text, _fonts("no such font"))[..., 3].any())


def picture_size(window: Window, longest: int) -> tuple[int, int]:
    """Return the width and height of a picture of a window, whose longer side has so many pixels."""
    wide, high = window[2] - window[0], window[3] - window[1]
    most = max(wide, high)
    return max(1, round(longest * wide / most)), max(1, round(longest * high / most))


def visible(pixels: Rgba) -> Array:
    """Return how opaque each pixel is (height, width), from 0 to 1."""
    return pixels[..., 3] / 255.0


def only(root: Element, kept: Collection[int]) -> Element:
    """Return a document's elements with those alone, of what draws by itself, that have these numbers.

    They are counted from 0, from the lowest.
    """
    root = deepcopy(root)
    for number, (leaf, parent) in enumerate(list(leaves(root))):
        if number not in kept:
            parent.remove(leaf)
    return root


def without_colour(root: Element, colour: NDArray[np.uint8], distance: int) -> Element:
    """Return a document's elements without what is painted in a colour, or in one so near."""
    root = deepcopy(root)
    for item in root.iter():
        style = properties(item)
        for key in ("fill", "stroke"):
            text = style.get(key, item.get(key, ""))
            channels = parse_color(text) if text and "url(" not in text else None
            if isinstance(channels, tinycss2.color3.RGBA):
                apart = np.abs(np.array(channels[:3]) * 255 - colour).max()
                if apart <= distance:
                    style[key] = "none"
        if style:
            item.set("style", text_of(style))
    return root


def _fonts(serif: str) -> dict[str, Any]:
    return {"skip_system_fonts": False, "font_files": [str(_STAND_IN_FILE)], "serif_family": serif}


def _families(item: Element) -> list[str]:
    """Return the fonts that an element asks for."""
    style = properties(item)
    return [item.get("font-family", ""), style.get("font-family", "")]
