"""A scene as pixels: drawn several times finer by Pillow, then averaged."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from PIL import Image, ImageDraw
from PIL.PngImagePlugin import PngInfo

from orbiflow.arrays import Array
from orbiflow.drawing import FINER, draw_line, fine_places, font, in_bands, limited, png_bytes, rgb
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.geometry import signed_area
from orbiflow.tiles.page import (
    INK,
    Box,
    Curve,
    Layer,
    PathPart,
    Raster,
    Scene,
    Style,
    Words,
    flattened,
)

INCH = 25.4
"""An inch in mm."""

MOST_PIXELS = 100_000_000
"""Pixels of a page, at most."""

LONGEST_SIDE = 2**16 - 1
"""Pixels of a side, at most."""

GROUND = "#ffffff"
"""What a page's paper looks like where nothing is drawn."""

MOST_COLOURS = 32
"""Colours of a picture that is drawn with a palette, which is faster, at most."""

FLATNESS = 0.1
"""Distance in pixels of curves from the polygons that are drawn."""


def write_png(scene: Scene, *, dpi: float = 300.0, small: bool = False) -> bytes:
    """Return the scene as a PNG that gives its resolution, so that it prints in real size.

    Lines are at least a pixel wide. If it is to be `small` and has few colours, it has a palette of
    them and steps between any two: a quarter of the size, and a few levels off where they meet.

    Raises:
        OrbiflowError: If the page would have too many pixels, or none.
    """
    width, height = (side * dpi / INCH for side in (scene.width, scene.height))
    if width * height > MOST_PIXELS or max(width, height) > LONGEST_SIDE:
        raise OrbiflowError(
            f"at {dpi:g} dots per inch the page has {width:.0f} x {height:.0f} pixels; "
            f"choose fewer dots or another format"
        )
    if min(width, height) < 1:
        raise OrbiflowError(f"at {dpi:g} dots per inch the page has no pixel; choose more dots")
    picture, colours = _drawn(scene, dpi / INCH)
    info = PngInfo()
    for key, text in (("Title", scene.title), ("Description", " ".join(scene.notes))):
        info.add_text(key, text)
    info.add_text("Software", "orbiflow")
    picture = limited(picture, colours) if small and colours else picture
    return png_bytes(picture, dpi=(dpi, dpi), pnginfo=info)


def scene_image(scene: Scene, pixels: float = 1.0) -> Image.Image:
    """Return the scene as a picture in RGB, with so many pixels in a mm."""
    return _drawn(scene, pixels)[0]


def _drawn(scene: Scene, pixels: float) -> tuple[Image.Image, list[str]]:
    """Return a scene as a picture, and its colours if they are few and all is opaque."""
    size = round(scene.width * pixels), round(scene.height * pixels)
    scene = flattened(scene, FLATNESS / pixels, cut_pictures=False)
    sheets = [_sheet(scene, layer, pixels, size) for layer in scene.layers]
    colours = _few_colours(sheets)
    picture = painted(sheets, size, ground=GROUND, colours=colours).convert("RGB")
    pen = ImageDraw.Draw(picture)
    for words in (item for layer in scene.layers for item in layer.items):
        if isinstance(words, Words):
            at = pixels * words.place[0], pixels * words.place[1]
            anchor = "mm" if words.centred else "lm"
            pen.text(at, words.text, words.colour, font(pixels * words.size), anchor=anchor)
    return picture, colours


def _few_colours(sheets: Sequence[PixelSheet]) -> list[str]:
    """Return the colours of layers without transparency and pictures, the ground's first; or none."""
    shapes = [item for sheet in sheets for item in sheet.items]
    if not all(isinstance(item, PixelShape) and item.opacity >= 1 for item in shapes):
        return []
    styles = [item.style for item in shapes if isinstance(item, PixelShape)]
    used = (colour for style in styles for colour in style[:2] if colour)
    colours = list(dict.fromkeys([GROUND, *used]))
    return colours if len(colours) <= MOST_COLOURS else []


class PixelShape(NamedTuple):
    """Curves that are drawn as one, as polygons and lines in pixels."""

    rings: tuple[Array, ...]  # to fill; holes run the other way
    lines: tuple[Array, ...]  # to stroke
    style: Style  # with the stroke's width in pixels
    opacity: float
    low: float  # with `high`: the least and the largest y of what is drawn
    high: float


@dataclass(frozen=True, eq=False)
class PixelSheet:
    """What is drawn of a layer, from the bottom up, and the window that it shows in, in pixels."""

    items: tuple[PixelShape | Raster, ...]
    window: Box | None = None


def _sheet(scene: Scene, layer: Layer, scale: float, size: tuple[int, int]) -> PixelSheet:
    """Return a layer of a scene, whose motifs are flattened, at `scale` pixels a mm."""
    window = None
    if layer.clipped:
        left, top, right, bottom = (side * scale for side in scene.clip)
        if left > 0 or top > 0 or right < size[0] or bottom < size[1]:
            window = Box(left, top, right, bottom)
    return PixelSheet(tuple(_items(scene, layer, scale)), window)


def _items(scene: Scene, layer: Layer, scale: float) -> Iterator[PixelShape | Raster]:
    for item in layer.items:
        if isinstance(item, Words):
            continue  # they are written last
        if isinstance(item, Raster):
            yield item.moved(scale * np.eye(2), np.zeros(2))
        elif isinstance(item, PathPart):
            shape = shape_of(item.moved(scale * np.eye(2), np.zeros(2)), least_width=1.0)
            yield from _lines(shape) if not shape.rings and shape.opacity >= 1 else [shape]
        else:
            curves = [item] if isinstance(item, Curve) else item.curves(scene.symbols[item.symbol])
            for curve in curves:
                moved = PathPart((curve,), layer.style).moved(scale * np.eye(2), np.zeros(2))
                yield shape_of(moved, least_width=1.0)


def shape_of(part: PathPart, *, least_width: float = 0.0) -> PixelShape:
    """Return curves in pixels as what is drawn, with strokes at least so many pixels wide."""
    points = [curve.flattened(FLATNESS) for curve in part.curves]
    closed = [curve.closed for curve in part.curves]
    lines = [np.concatenate([p, p[:1]]) if c else p for p, c in zip(points, closed, strict=True)]
    width = max(part.style.width, least_width) if part.style.stroke else 0.0
    rings = tuple(ring for ring in points if len(ring) > 2) if part.style.fill else ()
    return PixelShape(
        rings, tuple(lines), part.style._replace(width=width), part.opacity, *_reach(lines, width)
    )


def _lines(shape: PixelShape) -> Iterator[PixelShape]:
    """Yield each line of a shape that is lines alone: most bands have few of many dashes."""
    for line in shape.lines:
        low, high = _reach([line], shape.style.width)
        yield shape._replace(lines=(line,), low=low, high=high)


def _reach(lines: Sequence[Array], width: float) -> tuple[float, float]:
    heights = np.concatenate([line[:, 1] for line in lines])
    return float(heights.min() - width), float(heights.max() + width)


def painted(
    sheets: Sequence[PixelSheet],
    size: tuple[int, int],
    *,
    ground: str | None = None,
    colours: Sequence[str] = (),
) -> Image.Image:
    """Return layers, from the bottom up, as a picture in RGBA: on a ground, or on nothing.

    If all its `colours` are known and nothing is transparent, the picture is drawn with a palette,
    and in RGB.
    """
    table: dict[str, Colour] = {colour: number for number, colour in enumerate(colours)}
    start = (0, 0, 0, 0) if ground is None else (*rgb(ground), 255)
    pngs = {item.png for sheet in sheets for item in sheet.items if isinstance(item, Raster)}
    pictures = {png: Image.open(io.BytesIO(png)).convert("RGBA").convert("RGBa") for png in pngs}

    def draw(band: Image.Image, top: int, rows: int) -> None:
        if colours:
            band.putpalette([value for colour in colours for value in rgb(colour)])
        for sheet in sheets:
            _draw_sheet(band, sheet, top, rows, pictures, table)

    return in_bands("P", size, 0, draw) if colours else in_bands("RGBA", size, start, draw)


Colour = int | tuple[int, int, int, int]
"""A colour as Pillow takes it: its number in a palette, or red, green, blue and opacity."""


def _colour(colour: str, table: Mapping[str, Colour]) -> Colour:
    if table:
        return table[colour]
    return *rgb("#000000" if colour == INK else colour), 255  # a drawing's own ink is black


def _draw_sheet(
    band: Image.Image,
    sheet: PixelSheet,
    top: int,
    rows: int,
    pictures: Mapping[bytes, Image.Image],
    table: Mapping[str, Colour],
) -> None:
    """Draw a layer on a band, FINER times as fine, of so many rows of pixels from `top` on."""
    outside = [] if sheet.window is None else _outside(band, sheet.window, top)
    kept = [(box, band.crop(box)) for box in outside]
    for item in sheet.items:
        if isinstance(item, Raster):
            _draw_raster(band, item, pictures[item.png], top)
            continue
        if item.low <= top + rows and item.high >= top:
            _draw_shape(band, item, top, table)
    for box, before in kept:
        band.paste(before, box)


def _outside(band: Image.Image, window: Box, top: int) -> list[tuple[int, int, int, int]]:
    """Return the rectangles of a band, which begins at a row, that a window leaves out."""
    (left, upper), (right, lower) = (
        np.rint((np.array(corner) - (0, top)) * FINER).astype(int).clip(0, band.size).tolist()
        for corner in (window[:2], window[2:])
    )
    width, height = band.size
    sides = (0, 0, width, upper), (0, lower, width, height), (0, upper, left, lower)
    boxes = (*sides, (right, upper, width, lower))
    return [box for box in boxes if box[2] > box[0] and box[3] > box[1]]


def _draw_shape(
    band: Image.Image, shape: PixelShape, top: int, table: Mapping[str, Colour]
) -> None:
    """Draw a shape on a band."""
    rings = [fine_places(ring, top) for ring in shape.rings]
    lines = [fine_places(line, top) for line in shape.lines]
    canvas, corner = band, (0, 0)
    if shape.opacity < 1:  # drawn apart, where it is
        every, width = np.concatenate([*rings, *lines]), shape.style.width * FINER + 1
        low = np.floor(every.min(axis=0) - width).astype(int).clip(0, band.size)
        high = np.ceil(every.max(axis=0) + width).astype(int).clip(0, band.size)
        if (high <= low).any():
            return
        corner = (int(low[0]), int(low[1]))
        canvas = Image.new("RGBA", (int(high[0] - low[0]), int(high[1] - low[1])))
        rings, lines = [ring - low for ring in rings], [line - low for line in lines]
    pen = ImageDraw.Draw(canvas)
    if shape.style.fill and rings:
        _fill(canvas, pen, rings, _colour(shape.style.fill, table))
    if shape.style.stroke:
        colour = _colour(shape.style.stroke, table)
        for line in lines:
            draw_line(pen, line, shape.style.width * FINER, colour)
    if canvas is not band:
        canvas.putalpha(canvas.getchannel("A").point(lambda alpha: alpha * shape.opacity))
        band.alpha_composite(canvas, corner)


def _fill(
    canvas: Image.Image, pen: ImageDraw.ImageDraw, rings: Sequence[Array], colour: Colour
) -> None:
    """Fill rings as one; those that run the other way than the largest are holes."""
    if len(rings) == 1:
        pen.polygon(rings[0].ravel().tolist(), fill=colour)
        return
    areas = [signed_area(ring) for ring in rings]
    order = np.argsort(-np.abs(areas), kind="stable")
    every = np.concatenate(rings)
    low = np.floor(every.min(axis=0)).astype(int).clip(0, canvas.size)
    high = np.ceil(every.max(axis=0) + 1).astype(int).clip(0, canvas.size)
    mask = Image.new("1", tuple((high - low).tolist()))
    cut = ImageDraw.Draw(mask)
    for k in order.tolist():
        filled = areas[k] * areas[order[0]] > 0
        cut.polygon((rings[k] - low).ravel().tolist(), fill=int(filled))
    canvas.paste(colour, tuple(low.tolist()), mask)


def _draw_raster(band: Image.Image, raster: Raster, picture: Image.Image, top: int) -> None:
    """Draw a picture of pixels on a band, linear between its pixels."""
    linear, offset = raster.linear * FINER, (raster.offset - (0.0, top)) * FINER
    corners = raster._replace(linear=linear, offset=offset).corners
    low = np.floor(corners.min(axis=0)).astype(int).clip(0, band.size)
    high = np.ceil(corners.max(axis=0)).astype(int).clip(0, band.size)
    width, height = (high - low).tolist()
    if width < 1 or height < 1:
        return
    inverse = np.linalg.inv(linear)
    start = inverse @ (low - offset)
    (a, b), (c, d) = inverse.tolist()
    own = picture.transform(
        (width, height),
        Image.Transform.AFFINE,
        (a, b, float(start[0]), c, d, float(start[1])),
        resample=Image.Resampling.BILINEAR,
    )
    band.alpha_composite(own.convert("RGBA"), tuple(low.tolist()))
