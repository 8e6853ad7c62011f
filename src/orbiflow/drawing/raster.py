"""Pictures of polygons and lines in few colours, drawn several times finer by Pillow, then averaged.

They are drawn ten times as fast as matplotlib figures of the same things, and their PNGs are a quarter
of the size, since they have a palette: the colours that were used, and mixtures of any two of them.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from orbiflow.arrays import Array, Window
from orbiflow.drawing.sheet import check_size

FINER = 3
"""Factor by which each side of a pixel is drawn finer."""

MAX_FINE_PIXELS = 2**22
"""Pixels of a band that is drawn at once, which bounds the memory; the fastest power of two."""

MIN_DIFFERENCE = 16
"""Least difference, out of 255, of a mixture in a palette from the colours that were used."""

SHARP_TURN = 0.3
"""Turn in radians beyond which a line's joint is rounded: flatter ones show no notch."""

INK = "#1a1a1a"
"""Colour of texts."""


class Filled(NamedTuple):
    """A polygon in pixels, in the colour with this number."""

    points: Array
    holes: tuple[Array, ...]
    colour: int


class Drawn(NamedTuple):
    """A line in pixels, in the colour with this number."""

    points: Array
    width: float
    colour: int


class Words(NamedTuple):
    """A text at a place in pixels."""

    place: tuple[float, float]
    text: str
    size: float
    anchor: str


class Raster:
    """A picture of a window of the plane, and below it a strip for a legend.

    Things are drawn in the order in which they are added, and only when `image` is called; until then
    they are `shapes` and `texts`, which a printed picture has as curves.

    Args:
        window: The window (xmin, ymin, xmax, ymax), in the units of all points.
        width_px: Width in pixels; the height follows from the window.
        y_down: Whether the y axis points down, as in images.
        paper: The background, as #rrggbb.
        strip_px: Height of the strip.

    >>> raster = Raster((0.0, 0.0, 2.0, 1.0), 40)
    >>> raster.fill([np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])], "#ff0000")
    >>> picture = raster.image()
    >>> picture.size, picture.getpixel((10, 10)), picture.getpixel((30, 10))
    ((40, 20), (255, 0, 0), (255, 255, 255))
    """

    def __init__(
        self,
        window: Window,
        width_px: int,
        *,
        y_down: bool = False,
        paper: str = "#ffffff",
        strip_px: int = 0,
    ) -> None:
        self.plane_px = round(width_px * (window[3] - window[1]) / (window[2] - window[0]))
        self.width, self.height = width_px, self.plane_px + strip_px
        check_size(self.width, self.height)
        self.scale = width_px / (window[2] - window[0])
        self._origin = np.array([window[0], window[1] if y_down else window[3]])
        self._signs = np.array([1.0, 1.0 if y_down else -1.0])
        self.paper = paper
        self.colours = [paper]
        self.shapes: list[Filled | Drawn] = []
        self.texts: list[Words] = []

    def to_pixels(self, points: Array) -> Array:
        """Return points (..., 2) of the plane in pixels from the upper left corner."""
        return (points - self._origin) * self._signs * self.scale

    def fill(self, rings: Sequence[Array], colour: str) -> None:
        """Fill closed polygons (N, 2), with their border."""
        number = self._number(colour)
        self.shapes += [Filled(self.to_pixels(ring), (), number) for ring in rings]

    def fill_geometry(self, geometry: Any, colour: str) -> None:
        """Fill a shapely geometry except its holes; lines and points in it are ignored."""
        for part in getattr(geometry, "geoms", [geometry]):
            if hasattr(part, "geoms"):
                self.fill_geometry(part, colour)
            elif part.geom_type == "Polygon" and not part.is_empty:
                rings = (part.exterior, *part.interiors)
                outer, *holes = (self.to_pixels(np.asarray(ring.coords)) for ring in rings)
                self.shapes.append(Filled(outer, tuple(holes), self._number(colour)))

    def line(
        self,
        points: Array,
        colour: str,
        width_px: float,
        *,
        closed: bool = False,
        pixels: bool = False,
    ) -> None:
        """Draw a line with round ends along points (N, 2) of the plane, or of the picture."""
        path = points if pixels else self.to_pixels(points)
        path = np.concatenate([path, path[:1]]) if closed else path
        self.shapes.append(Drawn(path, width_px, self._number(colour)))

    def fill_pixels(self, ring: Array, colour: str) -> None:
        """Fill a polygon (N, 2) in pixels of the picture."""
        self.shapes.append(Filled(np.asarray(ring, float), (), self._number(colour)))

    def text(self, x: float, y: float, text: str, size: float, *, anchor: str = "lm") -> None:
        """Write text at a place in pixels, `size` pixels high, with Pillow's `anchor`."""
        self._number(INK)
        self.texts.append(Words((x, y), text, size, anchor))

    def image(self) -> Image.Image:
        """Return the picture in RGB."""
        palette = [value for colour in self.colours for value in rgb(colour)]

        def draw(band: Image.Image, top: int, rows: int) -> None:
            band.putpalette(palette)
            self._draw(band, top, rows)

        picture = in_bands("P", (self.width, self.height), 0, draw)
        pen = ImageDraw.Draw(picture)
        for place, text, size, anchor in self.texts:
            pen.text(place, text, fill=INK, font=font(size), anchor=anchor)
        return picture

    def png(self) -> bytes:
        """Return the picture as PNG."""
        return palette_png(self.image(), self.colours)

    def _number(self, colour: str) -> int:
        if colour not in self.colours:
            self.colours.append(colour)
        return self.colours.index(colour)

    def _draw(self, band: Image.Image, top: int, rows: int) -> None:
        pen = ImageDraw.Draw(band)
        for shape in self.shapes:
            reach = shape.width if isinstance(shape, Drawn) else 1.0
            low, high = shape.points[:, 1].min() - reach, shape.points[:, 1].max() + reach
            if high < top or low > top + rows:
                continue
            if isinstance(shape, Drawn):
                draw_line(pen, fine_places(shape.points, top), shape.width * FINER, shape.colour)
            elif shape.holes:
                _draw_with_holes(band, shape, top)
            else:
                pen.polygon(fine_places(shape.points, top).ravel().tolist(), fill=shape.colour)


def in_bands(
    mode: str,
    size: tuple[int, int],
    ground: int | tuple[int, int, int, int],
    draw: Callable[[Image.Image, int, int], None],
) -> Image.Image:
    """Return a picture that is drawn band by band, `FINER` times as fine, and averaged.

    Args:
        mode: "P", for colours of a palette, or "RGBA".
        size: Width and height in pixels.
        ground: The colour of what nothing is drawn on, as Pillow takes it.
        draw: Draws on a band that begins at a row of the picture and has so many of its rows.
    """
    width, height = size
    whole = Image.new("RGB" if mode == "P" else mode, size)
    most = max(1, MAX_FINE_PIXELS // (width * FINER**2))
    for top in range(0, height, most):
        rows = min(most, height - top)
        band = Image.new(mode, (width * FINER, rows * FINER), ground)
        draw(band, top, rows)
        if mode == "P":
            part = band.convert("RGB").reduce(FINER)
        else:  # transparent pixels have no colour
            part = band.convert("RGBa").reduce(FINER).convert("RGBA")
        whole.paste(part, (0, top))
    return whole


def fine_places(points: Array, top: int) -> Array:
    """Return points (N, 2) in pixels as Pillow draws them on a band that begins at row `top`."""
    # whole numbers are the middles of pixels for Pillow
    return (points - (0.0, top)) * FINER - 0.5


def draw_line(
    pen: ImageDraw.ImageDraw, path: Array, width: float, colour: int | tuple[int, ...]
) -> None:
    """Draw a line with round joints and ends along points (N, 2) in pixels."""
    whole = max(1, round(width))
    pen.line(path.ravel().tolist(), fill=colour, width=whole)
    if whole < 3:
        return
    steps = np.diff(path, axis=0)
    cross = steps[:-1, 0] * steps[1:, 1] - steps[:-1, 1] * steps[1:, 0]
    turn = np.abs(np.arctan2(cross, (steps[:-1] * steps[1:]).sum(axis=1)))
    for point in (*path[1:-1][turn > SHARP_TURN], path[0], path[-1]):
        pen.circle(tuple(point.tolist()), (whole - 1) / 2, fill=colour)


def _draw_with_holes(band: Image.Image, shape: Filled, top: int) -> None:
    mask = Image.new("1", band.size)
    pen = ImageDraw.Draw(mask)
    for ring, inside in ((shape.points, 1), *((hole, 0) for hole in shape.holes)):
        pen.polygon(fine_places(ring, top).ravel().tolist(), fill=inside)
    band.paste(shape.colour, (0, 0), mask)


def palette_png(picture: Image.Image, colours: Sequence[str]) -> bytes:
    """Return an RGB picture as PNG whose palette is 1 to 256 colours, and steps between any two."""
    return png_bytes(limited(picture, colours), compress_level=6)


def png_bytes(picture: Image.Image, **options: Any) -> bytes:
    """Return a picture as PNG, with Pillow's options."""
    buffer = io.BytesIO()
    picture.save(buffer, "PNG", **options)
    return buffer.getvalue()


def limited(picture: Image.Image, colours: Sequence[str], steps: int = 7) -> Image.Image:
    """Return an RGB picture with a palette of these colours, and steps between any two of them.

    Pictures of the same colours have the same palette.
    """
    return picture.quantize(
        palette=_chart(tuple(dict.fromkeys(colours)), steps), dither=Image.Dither.NONE
    )


@lru_cache(maxsize=16)
def _chart(colours: tuple[str, ...], most: int) -> Image.Image:
    base = np.array([rgb(colour) for colour in colours], dtype=float)
    pairs = list(combinations(range(len(base)), 2))
    steps = min(most, (256 - len(base)) // len(pairs)) if pairs else 0
    share = np.arange(1, steps + 1)[:, None] / (steps + 1)
    mixed = [base[a] + share * (base[b] - base[a]) for a, b in pairs if steps]
    between = np.concatenate([np.zeros((0, 3)), *mixed])
    # Pillow looks colours up in boxes: a mixture too near to a colour would be taken for it
    near = np.abs(between[:, None] - base).max(axis=2).min(axis=1, initial=255) < MIN_DIFFERENCE
    table: NDArray[np.int64] = np.rint(np.concatenate([base, between[~near]])).astype(np.int64)
    chart = Image.new("P", (1, 1))
    chart.putpalette(table.ravel().tolist())
    return chart


def rgb(colour: str) -> tuple[int, int, int]:
    """Return red, green and blue, 0 to 255, of #rrggbb.

    >>> rgb("#ff8000")
    (255, 128, 0)
    """
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return red, green, blue


@lru_cache(maxsize=32)
def font(size: float) -> Any:
    """Return Pillow's own font, `size` pixels high."""
    return ImageFont.load_default(size=size)


STRIP = 0.075
"""Height of the strip as a share of the width."""

TEXT = 0.018
"""Size of its text as a share of the width."""


def captioned(rings: Sequence[Array], width_px: int, *, y_down: bool, text: str) -> Raster:
    """Return a raster that shows all of `rings` (N, 2) with a margin, and a text in a strip, if any."""
    strip = round(STRIP * width_px) if text else 0
    raster = Raster(window_of(rings), width_px, y_down=y_down, strip_px=strip)
    if text:
        caption(raster, 0.03, text)
    return raster


def window_of(rings: Sequence[Array], margin: float = 0.03) -> Window:
    """Return the rectangle around `rings` (N, 2), with a margin as a share of its longer side."""
    low = np.min([ring.min(axis=0) for ring in rings], axis=0)
    high = np.max([ring.max(axis=0) for ring in rings], axis=0)
    room = margin * float((high - low).max())
    return (*(low - room).tolist(), *(high + room).tolist())


def caption(raster: Raster, x: float, text: str) -> None:
    """Write a text in a raster's strip, beginning at a share x of its width."""
    raster.text(x * raster.width, strip_middle(raster), text, TEXT * raster.width)


def strip_middle(raster: Raster) -> float:
    """Return the middle of a raster's strip, in pixels from the top."""
    return (raster.plane_px + raster.height) / 2


def dashes(points: Array, on: float, off: float) -> list[Array]:
    """Return a polyline (N, 2) in pieces of length `on` that are `off` apart.

    >>> [piece[:, 0].tolist() for piece in dashes(np.array([[0.0, 0.0], [5.0, 0.0]]), 2, 1)]
    [[0.0, 2.0], [3.0, 5.0]]
    """
    from shapely import LineString
    from shapely.ops import substring

    line = LineString(points)
    starts = np.arange(0.0, line.length, on + off).tolist()
    return [np.asarray(substring(line, start, start + on).coords) for start in starts]


def arrow(raster: Raster, start: Array, end: Array, colour: str, width_px: float) -> None:
    """Draw an arrow from a point (2,) of the plane to another, with its head at the end."""
    tail, tip = raster.to_pixels(start), raster.to_pixels(end)
    length = float(np.hypot(*(tip - tail)))
    if length < 1e-9:
        return
    along = (tip - tail) / length
    across = np.array([-along[1], along[0]])
    head = min(5.5 * width_px, 0.6 * length)
    back = tip - head * along
    raster.line(np.stack([tail, back]), colour, width_px, pixels=True)
    raster.fill_pixels(
        np.stack([tip, back + 0.4 * head * across, back - 0.4 * head * across]), colour
    )
