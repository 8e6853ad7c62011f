"""Pictures of polygons and lines for print: curves on a page as wide as a column."""

from __future__ import annotations

from dataclasses import dataclass

from orbiflow.drawing import Filled, Raster, Sheet
from orbiflow.tiles.geometry import orient
from orbiflow.tiles.scene import (
    INCH,
    Box,
    Curve,
    Layer,
    Part,
    Scene,
    Style,
    rectangle,
    write_pdf,
    write_png,
    write_svg,
)

MIN_WIDTH = 0.25 * INCH / 72
"""Width in mm below which lines fade in print."""

HAIRLINE = 0.1 * INCH / 72
"""Width in mm of the line around a fill in its own colour: without it paper shows where two meet."""

NOTEBOOK_DPI = 144.0
"""Pixels per inch of what a notebook shows."""


@dataclass(frozen=True, eq=False)
class PrintedPicture:
    """A picture on a page without a margin.

    - `scene`: The page.
    - `sheet`: Its width, and the format of its file.
    - `caption`: What its colours mean, to be written below it in print.
    """

    scene: Scene
    sheet: Sheet
    caption: str = ""

    @classmethod
    def of(cls, raster: Raster, sheet: Sheet, *, title: str, caption: str = "") -> PrintedPicture:
        """Return the shapes of a raster as curves, as wide as the sheet, with lines in proportion."""
        pixel = sheet.width * INCH / raster.width
        width, height = raster.width * pixel, raster.height * pixel
        paper = Part((rectangle(Box(0.0, 0.0, width, height)),), Style(raster.paper))
        parts = [paper]
        for shape in raster.shapes:
            colour = raster.colours[shape.colour]
            if isinstance(shape, Filled):
                rings = [shape.points, *shape.holes]
                curves = [
                    Curve.polyline(orient(pixel * ring, counter_clockwise=k == 0), closed=True)
                    for k, ring in enumerate(rings)
                ]
                parts.append(Part(tuple(curves), Style(colour, colour, HAIRLINE)))
            else:
                line = Curve.polyline(pixel * shape.points)
                style = Style(None, colour, max(pixel * shape.width, MIN_WIDTH))
                parts.append(Part((line,), style))
        layer = Layer("picture", "drawing", Style(), tuple(parts), clipped=True)
        notes = (caption,) if caption else ()
        return cls(Scene(width, height, (layer,), title=title, notes=notes), sheet, caption)

    def file(self) -> bytes:
        """Return the content of its file, in the sheet's format."""
        if self.sheet.format == "svg":
            return write_svg(self.scene).encode()
        return write_pdf(self.scene) if self.sheet.format == "pdf" else self.png()

    def png(self, dpi: float | None = None) -> bytes:
        """Return the picture as pixels. Default: the sheet's pixels per inch."""
        return write_png(self.scene, dpi=self.sheet.dpi if dpi is None else dpi)

    def _repr_png_(self) -> bytes:
        """Return what a notebook shows."""
        return self.png(min(NOTEBOOK_DPI, self.sheet.dpi))
