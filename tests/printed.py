"""What is on a printed figure: sizes of letters, and whether all lies on the page."""

import ctypes
from itertools import pairwise

import numpy as np
import pypdfium2
import pypdfium2.raw as pdfium

from orbiflow.drawing import Picture


def letters(pdf: bytes) -> set[float]:
    """Sizes in points of all visible letters."""
    found: set[float] = set()
    for page in pypdfium2.PdfDocument(pdf):
        text = page.get_textpage()
        for k in range(text.count_chars()):
            if pdfium.FPDFText_GetUnicode(text.raw, k) > 32:
                matrix = pdfium.FS_MATRIX()
                pdfium.FPDFText_GetMatrix(text.raw, k, ctypes.byref(matrix))
                scale = float(np.hypot(matrix.a, matrix.b))
                found.add(round(pdfium.FPDFText_GetFontSize(text.raw, k) * scale, 2))
    return found


def check_inside(picture: Picture) -> None:
    """All that is drawn lies on the page, and texts of ticks do not touch."""
    figure = picture.figure
    renderer = figure.canvas.get_renderer()  # pyright: ignore[reportAttributeAccessIssue]
    box = figure.get_tightbbox(renderer)
    width, height = figure.get_size_inches()
    assert box.x0 > -0.01
    assert box.y0 > -0.01
    assert box.x1 < width + 0.01
    assert box.y1 < height + 0.01
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            labels = [text for text in axis.get_ticklabels() if text.get_text()]
            boxes = [text.get_window_extent(renderer) for text in labels]
            assert not any(a.overlaps(b) for a, b in pairwise(boxes))
