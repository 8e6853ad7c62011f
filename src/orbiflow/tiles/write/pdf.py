"""A scene as PDF, in real size."""

from __future__ import annotations

import io
from collections.abc import Iterable
from typing import TYPE_CHECKING

from PIL import Image

from orbiflow.tiles.page import (
    Curve,
    Layer,
    PathPart,
    Raster,
    Scene,
    Style,
    Warped,
    Words,
    flattened,
)
from orbiflow.tiles.write.painting import INCH, with_page_pictures

if TYPE_CHECKING:
    from reportlab.pdfgen.canvas import Canvas
    from reportlab.pdfgen.pathobject import PDFPathObject

POINT = 72 / 25.4
"""Points in a millimetre."""

CUT_TOLERANCE = 0.01
"""Distance in mm of the polygons that take the place of curves where something cuts them off."""

ROUND = 1
"""The number of round joins and caps of lines in PDF."""

NON_ZERO = 1
"""The number of the rule by which holes run the other way."""


def write_pdf(scene: Scene, *more: Scene, dpi: float = 300.0) -> bytes:
    """Return a PDF with a page for each scene, to print in real size; the same give the same bytes.

    Pictures on meshes have `dpi` pixels an inch.
    """
    from reportlab.pdfgen.canvas import Canvas

    buffer = io.BytesIO()
    canvas = Canvas(buffer, invariant=True, pageCompression=1)
    canvas.setTitle(scene.title)
    canvas.setSubject(" ".join(scene.notes))
    canvas.setCreator("orbiflow")
    canvas.setViewerPreference("PrintScaling", "None")
    page = _Page(canvas)
    for sheet in (scene, *more):
        page.show(sheet, dpi)
    canvas.save()
    return buffer.getvalue()


class _Page:
    """The pages of a PDF, on which layers are drawn, in mm."""

    def __init__(self, canvas: Canvas) -> None:
        self.canvas = canvas
        self.pictures: dict[int, Image.Image] = {}  # by the identity of their pixels

    def show(self, scene: Scene, dpi: float) -> None:
        """Draw a scene on a page of its size."""
        canvas, height = self.canvas, scene.height * POINT
        canvas.setPageSize((scene.width * POINT, height))
        # millimetres with y down from the upper left corner
        canvas.transform(POINT, 0, 0, -POINT, 0, height)
        canvas.setLineJoin(ROUND)
        canvas.setLineCap(ROUND)
        scene = flattened(with_page_pictures(scene, dpi / INCH), CUT_TOLERANCE)
        for layer in scene.layers:
            canvas.saveState()
            if layer.clipped:
                box = scene.clip
                window = canvas.beginPath()
                window.rect(box.left, box.top, box.width, box.height)
                canvas.clipPath(window, stroke=0, fill=0)
            self.draw(scene, layer)
            canvas.restoreState()
        canvas.showPage()

    def draw(self, scene: Scene, layer: Layer) -> None:
        """Draw the layer of a scene whose motifs are flattened."""
        for item in layer.items:
            if isinstance(item, Raster | Warped):
                self.picture(item)
            elif isinstance(item, PathPart):
                self.curves(item.curves, item.style, item.opacity)
            elif isinstance(item, Curve):
                self.curves([item], layer.style)
            elif isinstance(item, Words):
                self.words(item)
            else:
                for curve in item.curves(scene.symbols[item.symbol]):
                    self.curves([curve], layer.style)

    def curves(self, curves: Iterable[Curve], style: Style, opacity: float = 1.0) -> None:
        """Draw curves, filled together."""
        canvas = self.canvas
        if style.fill:
            canvas.setFillColor(style.fill)
        if style.stroke:
            canvas.setStrokeColor(style.stroke)
            canvas.setLineWidth(style.width)
        canvas.setFillAlpha(opacity)
        canvas.setStrokeAlpha(opacity)
        path = canvas.beginPath()
        for curve in curves:
            _trace(path, curve)
        stroke, fill = int(style.stroke is not None), int(style.fill is not None)
        canvas.drawPath(path, stroke=stroke, fill=fill, fillMode=NON_ZERO)

    def words(self, words: Words) -> None:
        """Write a line of text, which is upright although y points down."""
        canvas, (x, y) = self.canvas, words.place
        canvas.saveState()
        canvas.transform(1, 0, 0, -1, x, y + 0.35 * words.size)
        canvas.setFont("Helvetica", words.size)
        canvas.setFillColor(words.colour)
        write = canvas.drawCentredString if words.centred else canvas.drawString
        write(0, 0, words.text)
        canvas.restoreState()

    def picture(self, picture: Raster | Warped) -> None:
        """Draw a picture of pixels."""
        from reportlab.lib.utils import ImageReader

        raster = picture.raster() if isinstance(picture, Warped) else picture
        key = id(raster.pixels)
        if key not in self.pictures:
            self.pictures[key] = Image.fromarray(raster.pixels, "RGBA")
        (a, c), (b, d) = raster.linear.tolist()
        width, height = raster.size
        self.canvas.saveState()
        self.canvas.transform(a, b, c, d, *raster.offset.tolist())
        self.canvas.transform(1, 0, 0, -1, 0, height)  # pictures have their first row at the top
        image = ImageReader(self.pictures[key])
        self.canvas.drawImage(image, 0, 0, width, height, mask="auto")
        self.canvas.restoreState()


def _trace(path: PDFPathObject, curve: Curve) -> None:
    """Add a curve to a path."""
    path.moveTo(*curve.start.tolist())
    for piece, straight in zip(curve.pieces.tolist(), curve.straight.tolist(), strict=True):
        if straight:
            path.lineTo(*piece[3])
        else:
            path.curveTo(*piece[1], *piece[2], *piece[3])
    if curve.closed:
        path.close()
