"""Layers of shapes, pictures and copies as pixels: drawn several times finer, then averaged."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from PIL import Image, ImageChops, ImageDraw
from PIL.Image import Resampling

from orbiflow.arrays import Array
from orbiflow.drawing import FINER, draw_line, fine_places, in_bands, rgb
from orbiflow.tiles.geometry import signed_area
from orbiflow.tiles.page import (
    INK,
    Box,
    Layer,
    PathPart,
    Raster,
    Scene,
    Style,
    Uses,
    Warped,
    carried,
    covered,
)

INCH = 25.4
"""An inch in mm."""

FLATNESS = 0.1
"""Distance in pixels of curves from the polygons that are drawn."""

MOST_STAMPED = 16_000_000
"""Fine pixels of a copy that is kept whole."""

OVERLAP = 1
"""Fine pixels by which copies cover their neighbours' edges, so that nothing shows between them."""

COARSE_AREA = 2.5
"""Fine pixels that a picture's pixel covers, from which on it is drawn linear between its pixels."""


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

    items: tuple[PixelShape | Raster | Stamps, ...]
    window: Box | None = None


def shape_of(part: PathPart, *, least_width: float = 0.0) -> PixelShape:
    """Return curves in pixels as what is drawn, with strokes at least so many pixels wide."""
    points = [curve.flattened(FLATNESS) for curve in part.curves]
    closed = [curve.closed for curve in part.curves]
    lines = [np.concatenate([p, p[:1]]) if c else p for p, c in zip(points, closed, strict=True)]
    width = max(part.style.width, least_width) if part.style.stroke else 0.0
    rings = tuple(ring for ring in points if len(ring) > 2) if part.style.fill else ()
    return PixelShape(
        rings,
        tuple(lines),
        part.style._replace(width=width),
        part.opacity,
        *shape_reach(lines, width),
    )


def shape_reach(lines: Sequence[Array], width: float) -> tuple[float, float]:
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

    def draw(band: Image.Image, top: int, rows: int) -> None:
        if colours:
            band.putpalette([value for colour in colours for value in rgb(colour)])
        for sheet in sheets:
            _draw_sheet(band, sheet, top, rows, table)

    return in_bands("P", size, 0, draw) if colours else in_bands("RGBA", size, start, draw)


Colour = int | tuple[int, int, int, int]
"""A colour as Pillow takes it: its number in a palette, or red, green, blue and opacity."""


def _colour(colour: str, table: Mapping[str, Colour]) -> Colour:
    if table:
        return table[colour]
    return *rgb("#000000" if colour == INK else colour), 255  # a drawing's own ink is black


def _draw_sheet(
    band: Image.Image, sheet: PixelSheet, top: int, rows: int, table: Mapping[str, Colour]
) -> None:
    """Draw a layer on a band, FINER times as fine, of so many rows of pixels from `top` on."""
    outside = [] if sheet.window is None else _outside(band, sheet.window, top)
    kept = [(box, band.crop(box)) for box in outside]
    for item in sheet.items:
        if isinstance(item, Raster):
            _draw_raster(band, item, top)
        elif isinstance(item, Stamps):
            item.draw(band, top, table)
        elif item.low <= top + rows and item.high >= top:
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


def _draw_raster(band: Image.Image, raster: Raster, top: int) -> None:
    """Draw a picture of pixels on a band, linear between its pixels."""
    linear, offset = raster.linear * FINER, (raster.offset - (0.0, top)) * FINER
    corners = raster._replace(linear=linear, offset=offset).corners
    low = np.floor(corners.min(axis=0)).astype(int).clip(0, band.size)
    high = np.ceil(corners.max(axis=0)).astype(int).clip(0, band.size)
    size: tuple[int, int] = tuple((high - low).tolist())
    if min(size) < 1:
        return
    picture = Image.fromarray(raster.pixels, "RGBA")
    if np.allclose(raster.linear, np.eye(2), atol=1e-12):  # pixel by pixel
        placed = _transformed(picture, size, linear, offset - low, Image.Resampling.NEAREST)
    else:
        how = Image.Resampling.BILINEAR
        placed = _transformed(picture.convert("RGBa"), size, linear, offset - low, how).convert(
            "RGBA"
        )
    band.alpha_composite(placed, tuple(low.tolist()))


def _transformed(
    picture: Image.Image, size: tuple[int, int], linear: Array, offset: Array, how: Resampling
) -> Image.Image:
    """Return a picture whose places p are at linear p + offset, of a size."""
    (a, b), (c, d) = (inverse := np.linalg.inv(linear)).tolist()
    x, y = (inverse @ -offset).tolist()
    return picture.transform(size, Image.Transform.AFFINE, (a, b, x, c, d, y), resample=how)


Stamp = tuple[Image.Image | str, Image.Image]
"""A picture, or a colour, and where it covers what is below."""


class Stamps(ABC):
    """Copies of something: one of each aspect is drawn, and laid on whole fine pixels.

    Args:
        uses: The copies, in pixels.
        points: Points (N, 2) of what is copied, in whose box it lies.
        room: The room around that it needs, in fine pixels.
    """

    def __init__(self, uses: Uses, points: Array, room: float = 2.0) -> None:
        self._linear = FINER * uses.linear
        turned = points @ self._linear.transpose(0, 2, 1)
        self._low = np.floor(turned.min(axis=1) - room).astype(int)
        size = np.ceil(turned.max(axis=1) + room).astype(int) - self._low
        self._places = np.floor(FINER * uses.offsets + 0.5).astype(int) + self._low[uses.which]
        self._which, self._size = uses.which, size[uses.which]
        self._drawn: dict[int, list[Stamp]] = {}

    @abstractmethod
    def _stamp(self, linear: Array, corner: Array, size: tuple[int, int]) -> list[Stamp]:
        """Return what is laid on, the lowest first: what linear p - corner has of it in a size."""

    def draw(self, band: Image.Image, top: int, table: Mapping[str, Colour]) -> None:
        """Draw the copies that meet a band, which begins at a row of pixels."""
        places = self._places - (0, FINER * top)
        meets = ((places < band.size) & (places + self._size > 0)).all(axis=1)
        for copy in np.flatnonzero(meets).tolist():
            which, (x, y) = int(self._which[copy]), places[copy].tolist()
            width, height = self._size[copy].tolist()
            linear, corner = self._linear[which], self._low[which]
            if width * height <= MOST_STAMPED:
                if which not in self._drawn:
                    self._drawn[which] = self._stamp(linear, corner, (width, height))
                drawn = self._drawn[which]
            else:  # only what the band has of it
                first = max(0, -y)
                rows = min(height, band.height - y) - first
                drawn, y = (
                    self._stamp(linear, corner + np.array([0, first]), (width, rows)),
                    y + first,
                )
            for ink, mask in drawn:
                if isinstance(ink, str):
                    band.paste(_colour(ink, table), (x, y, x + mask.width, y + mask.height), mask)
                else:
                    band.paste(ink, (x, y), mask)


class OutlineStamps(Stamps):
    """Copies of an outline (N, 2), filled and stroked; with no stroke, fills overlap by a trifle."""

    def __init__(self, ring: Array, uses: Uses, style: Style) -> None:
        self._ring, self._style = ring, style
        super().__init__(uses, ring, style.width * FINER / 2 + 2)

    def _stamp(self, linear: Array, corner: Array, size: tuple[int, int]) -> list[Stamp]:
        drawn, style = list[Stamp](), self._style
        ring = np.floor(self._ring @ linear.T - corner)
        closed = np.concatenate([ring, ring[:1]])
        if style.fill:
            reach = 0 if style.stroke else OVERLAP
            drawn.append((style.fill, Image.fromarray(covered(ring, size, reach))))
        if style.stroke:
            mask = Image.new("1", size)
            draw_line(ImageDraw.Draw(mask), closed, style.width * FINER, 1)
            drawn.append((style.stroke, mask))
        return drawn


class PictureStamps(Stamps):
    """Copies of a picture of pixels, cut off by a ring (N, 2) if there is one."""

    def __init__(self, picture: Raster, uses: Uses, ring: Array | None) -> None:
        self._picture, self._ring = picture, ring
        self._image = Image.fromarray(picture.pixels, "RGBA")
        super().__init__(uses, picture.corners if ring is None else ring)

    def _stamp(self, linear: Array, corner: Array, size: tuple[int, int]) -> list[Stamp]:
        placed = self._picture.moved(linear, -corner)
        # pixels nearly as fine as the stamp's need not be mixed, as all are averaged afterwards
        is_fine = abs(np.linalg.det(placed.linear)) < COARSE_AREA
        how = Image.Resampling.NEAREST if is_fine else Image.Resampling.BILINEAR
        stamp = _transformed(self._image, size, placed.linear, placed.offset, how)
        mask = stamp.getchannel("A")
        if self._ring is not None:
            inside = Image.fromarray(covered(self._ring @ linear.T - corner, size, OVERLAP))
            mask = ImageChops.darker(mask, inside.convert("L"))
        stamp.putalpha(255)
        return [(stamp, mask)]


def laid(bent: Sequence[Warped], size: tuple[int, int]) -> Raster:
    """Return pictures on meshes, in pixels, as one picture of a size; nothing is around them."""
    picture = Image.new("RGBA", size)
    for warped in bent:
        low = np.floor(warped.points.min(axis=0) - 1).clip(0, size)
        high = np.ceil(warped.points.max(axis=0) + 1).clip(0, size)
        if not np.isfinite(warped.points).all() or (high - low < 1).any():
            continue
        width, height = (high - low).astype(int).tolist()
        shown, inside = carried(
            warped.pixels, warped.texels, warped.points - low, warped.triangles, (width, height)
        )
        mask = np.rint(warped.opacity * inside * shown[..., 3]).astype(np.uint8)
        shown[..., 3] = mask
        layer = Image.fromarray(shown, "RGBA")
        picture.alpha_composite(layer, (int(low[0]), int(low[1])))
    return Raster(np.array(picture), np.eye(2), np.zeros(2))


def with_page_pictures(scene: Scene, pixels: float) -> Scene:
    """Return a scene in which the pictures on meshes of each layer are one, with `pixels` in a mm."""
    size = round(scene.width * pixels), round(scene.height * pixels)

    def flat(layer: Layer) -> Layer:
        bent = [item for item in layer.items if isinstance(item, Warped)]
        if not bent:
            return layer
        raster = laid([item.moved(pixels * np.eye(2), np.zeros(2)) for item in bent], size)
        rest = (item for item in layer.items if not isinstance(item, Warped))
        small = raster.moved(np.eye(2) / pixels, np.zeros(2))
        return replace(layer, items=(small, *rest))

    return replace(scene, layers=tuple(map(flat, scene.layers)))
