"""Pictures of a window of the plane, with a strip for words below, drawn piece by piece."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from PIL import Image
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array, Window
from orbiflow.drawing import Sheet, check_size, window_of
from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.page import (
    Box,
    Curve,
    Item,
    Layer,
    PathPart,
    Scene,
    Style,
    Words,
    boundary,
    expanded,
    rectangle,
)
from orbiflow.tiles.write import INCH, scene_image, write_png, write_scene

STRIP = 0.075  # height of the strip as a share of the width
TEXT = 0.018  # size of its text as a share of the width
LEAST_LINE = 0.25 * INCH / 72  # width in mm below which lines fade in print
HAIRLINE = 0.1 * INCH / 72  # width in mm of lines around fills, or paper shows where two meet
NOTEBOOK_DPI = 144.0  # pixels per inch of what a notebook shows


@dataclass(frozen=True, eq=False)
class ScenePicture:
    """A picture on a page without a margin.

    - `scene`: The page.
    - `sheet`: The format of its file, and its pixels per inch.
    - `caption`: What its colours mean, to be written below it in print.
    """

    scene: Scene
    sheet: Sheet
    caption: str = ""

    def file(self) -> bytes:
        """Return the content of its file, in the sheet's format."""
        if self.sheet.format == "png":
            return self.png()
        content = write_scene(self.scene, self.sheet.format)
        return content.encode() if isinstance(content, str) else content

    def svg(self) -> str:
        """Return it as SVG of plain paths: some programs drop symbols, transforms and style sheets."""
        return str(write_scene(expanded(self.scene), "svg", tolerance=5e-4))

    def png(self, width: int | None = None) -> bytes:
        """Return it as PNG of so many pixels in width. Default: as the sheet says."""
        dpi = self.sheet.dpi if width is None else width * INCH / self.scene.width
        check_size(*(round(side * dpi / INCH) for side in (self.scene.width, self.scene.height)))
        return write_png(self.scene, dpi=dpi, small=True)

    def image(self, width: int) -> Image.Image:
        """Return it in RGB, so many pixels wide."""
        return scene_image(self.scene, width / self.scene.width)

    def _repr_png_(self) -> bytes:
        """Return what a notebook shows."""
        return write_png(self.scene, dpi=min(NOTEBOOK_DPI, self.sheet.dpi))


class Sketch:
    """A window of the plane on a page, and below it a strip; things are drawn in the order given.

    Args:
        window: The window (xmin, ymin, xmax, ymax), in the units of all points.
        sheet: The sheet, which says the width; the height follows from the window.
        y_down: Whether the y axis points down, as in images.
        paper: The background, as #rrggbb.
        strip: Height of the strip as a share of the width.
    """

    def __init__(
        self,
        window: Window,
        sheet: Sheet,
        *,
        y_down: bool = False,
        paper: str = "#ffffff",
        strip: float = 0.0,
    ) -> None:
        self.sheet, width = sheet, sheet.width * INCH
        self.plane = width * (window[3] - window[1]) / (window[2] - window[0])
        self.width, self.height = width, self.plane + strip * width
        scale = width / (window[2] - window[0])
        self.linear = scale * np.diag([1.0, 1.0 if y_down else -1.0])
        self.origin = np.array([window[0], window[1] if y_down else window[3]])
        self.items: list[Item] = [
            PathPart((rectangle(Box(0.0, 0.0, self.width, self.height)),), Style(paper))
        ]

    @classmethod
    def around(
        cls, rings: Sequence[Array], sheet: Sheet, *, y_down: bool, text: str = ""
    ) -> Sketch:
        """Return a sketch that shows all of `rings` (N, 2) with a margin, and a text in a strip."""
        strip = STRIP if text else 0.0
        sketch = cls(window_of(rings), sheet, y_down=y_down, strip=strip)
        if text:
            sketch.caption(0.03, text)
        return sketch

    def on_page(self, points: Array) -> Array:
        """Return points (..., 2) of the plane in mm from the upper left corner."""
        return (points - self.origin) @ self.linear.T

    def fill(self, region: Array | BaseGeometry, colour: str, *, on_page: bool = False) -> None:
        """Fill a polygon (N, 2), or a region of shapely, of the plane or of the page."""
        style = Style(colour, colour, HAIRLINE) if self.sheet.printed else Style(colour)
        if not isinstance(region, BaseGeometry):
            ring = region if on_page else self.on_page(region)
            self.items.append(PathPart((Curve.polyline(ring, closed=True),), style))
            return
        for polygon in polygons_in(region):
            moved = shapely.transform(polygon, self.on_page)
            self.items.append(PathPart(boundary(moved), style))

    def line(
        self,
        points: Array,
        colour: str,
        width: float,
        *,
        closed: bool = False,
        on_page: bool = False,
    ) -> None:
        """Draw a line with round ends along points (N, 2) of the plane, or of the page."""
        placed = points if on_page else self.on_page(points)
        self._stroke([Curve.polyline(placed, closed=closed)], colour, width)

    def dashed(self, points: Array, colour: str, width: float, unit: float) -> None:
        """Draw a dashed line along points (N, 2) of the page, with dashes in proportion to a unit."""
        pieces = dashes(points, 0.009 * unit, 0.006 * unit)
        self._stroke([Curve.polyline(piece) for piece in pieces], colour, width)

    def _stroke(self, curves: Sequence[Curve], colour: str, width: float) -> None:
        width = max(width, LEAST_LINE) if self.sheet.printed else width
        self.items.append(PathPart(tuple(curves), Style(None, colour, width)))

    def arrow(self, start: Array, end: Array, colour: str, width: float) -> None:
        """Draw an arrow from a point (2,) of the plane to another, with its head at the end."""
        tail, tip = self.on_page(start), self.on_page(end)
        length = float(np.hypot(*(tip - tail)))
        if length < 1e-9:
            return
        along = (tip - tail) / length
        across = np.array([-along[1], along[0]])
        head = min(5.5 * width, 0.6 * length)
        back = tip - head * along
        self.line(np.stack([tail, back]), colour, width, on_page=True)
        barbs = back + 0.4 * head * across, back - 0.4 * head * across
        self.fill(np.stack([tip, *barbs]), colour, on_page=True)

    @property
    def strip_middle(self) -> float:
        """The middle of the strip, in mm from the top."""
        return (self.plane + self.height) / 2

    def caption(self, x: float, text: str) -> None:
        """Write a text in the strip, beginning at a share x of the width."""
        self.write(text, x * self.width, TEXT * self.width)

    def write(self, text: str, x: float, size: float, *, centred: bool = False) -> None:
        """Write a text in the strip, with letters so many mm high."""
        self.items.append(Words(text, (x, self.strip_middle), size, centred))

    def swatch(self, left: float, right: float, half: float, colour: str) -> None:
        """Fill a rectangle in the strip, in shares of the width."""
        x, y = np.array([left, right, right, left]) * self.width, self.strip_middle
        sides = y + np.array([-half, -half, half, half]) * self.width
        self.fill(np.stack([x, sides], axis=1), colour, on_page=True)

    def picture(self, title: str = "", caption: str = "") -> ScenePicture:
        """Return what was drawn."""
        layer = Layer("picture", "drawing", Style(), tuple(self.items), clipped=True)
        notes = (caption,) if caption else ()
        scene = Scene(self.width, self.height, (layer,), title=title, notes=notes)
        return ScenePicture(scene, self.sheet, caption)


def dashes(points: Array, on: float, off: float) -> list[Array]:
    """Return a polyline (N, 2) in pieces of length `on` that are `off` apart.

    >>> [piece[:, 0].tolist() for piece in dashes(np.array([[0.0, 0.0], [5.0, 0.0]]), 2, 1)]
    [[0.0, 2.0], [3.0, 5.0]]
    """
    at = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    starts = np.arange(0.0, at[-1], on + off)
    ends = np.minimum(starts + on, at[-1])
    first, last = (
        np.stack([np.interp(places, at, points[:, k]) for k in (0, 1)], axis=1)
        for places in (starts, ends)
    )
    within = zip(np.searchsorted(at, starts, "right"), np.searchsorted(at, ends), strict=True)
    return [
        np.vstack([first[k], points[low:high], last[k]]) for k, (low, high) in enumerate(within)
    ]
