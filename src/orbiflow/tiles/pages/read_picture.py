"""The picture of what was read as the silhouette (`read.png`), to be looked at before a search."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw
from PIL.PngImagePlugin import PngInfo
from shapely import Polygon

from orbiflow.arrays import Array
from orbiflow.drawing import font
from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.silhouette import Target, holes_filled, open_image, parts_left_out

LONGER_SIDE = 1200  # pixels
FINER = 2  # drawn finer, then averaged
OUTLINE, LEFT_OUT, FILLED, DRAWING = "#e6007e", "#ff8c00", "#0078ff", "#444444"
LINE, STRIP, LETTERS = 4, 44, 24  # pixels
SOFTWARE = "orbiflow"


def read_png(target: Target, source: Path) -> bytes:
    """Return a PNG of the picture or drawing in a file, with the outline that was read of it.

    Parts left out and holes filled are marked, too.
    """
    low, size = _window(target)
    scale = FINER * LONGER_SIDE / size.max()
    width, height = (max(FINER, round(float(side * scale))) for side in size)
    image = _source(source) if target.kind == "image" else None
    canvas = (image or Image.new("RGB", (1, 1), "white")).resize((width, height))

    def pixels(ring: Array) -> list[tuple[float, float]]:
        points = (ring - low) * scale
        if not target.y_down:
            points[:, 1] = height - points[:, 1]
        return [(x, y) for x, y in points.tolist()]

    def tint(parts: Sequence[Polygon], colour: str, opacity: float) -> None:
        mask = Image.new("L", canvas.size)
        pen = ImageDraw.Draw(mask)
        for part in sorted(parts, key=lambda part: -Polygon(part.exterior).area):
            pen.polygon(pixels(np.array(part.exterior.coords)), fill=round(255 * opacity))
            for hole in part.interiors:
                pen.polygon(pixels(np.array(hole.coords)), fill=0)
        canvas.paste(colour, mask=mask)

    lost, holes = parts_left_out(target), holes_filled(target)
    if image is None:
        whole = Polygon(target.outline) if target.seen is None else target.seen
        tint(polygons_in(whole), DRAWING, 1)
    tint(lost, LEFT_OUT, 0.7)
    tint(holes, FILLED, 0.5)
    ring = pixels(np.vstack([target.outline, target.outline[:2]]))
    for colour, wide in (("white", 2 * LINE), (OUTLINE, LINE)):
        ImageDraw.Draw(canvas).line(ring, fill=colour, width=wide * FINER, joint="curve")
    marks = [("read as the silhouette", OUTLINE)]
    marks += [("left out", LEFT_OUT)] * bool(lost) + [("hole, filled", FILLED)] * bool(holes)
    return _png(canvas.reduce(FINER), marks)


def _window(target: Target) -> tuple[Array, Array]:
    """Return the corner and size of what is shown, in the silhouette's units."""
    if target.kind == "image" and target.size is not None:
        return np.zeros(2), np.array(target.size)
    bounds = [target.outline.min(axis=0), target.outline.max(axis=0)]
    if target.seen is not None:
        bounds += np.reshape(target.seen.bounds, (2, 2)).tolist()
    low, high = np.min(bounds, axis=0), np.max(bounds, axis=0)
    margin = 0.05 * (high - low).max()
    return low - margin, high - low + 2 * margin


def _source(path: Path) -> Image.Image:
    image = open_image(path, enough=LONGER_SIDE)[0].convert("RGBA")
    white = Image.new("RGBA", image.size, "white")
    return Image.alpha_composite(white, image).convert("RGB")


def _png(picture: Image.Image, marks: Sequence[tuple[str, str]]) -> bytes:
    """Return the picture over a strip that says what is marked how."""
    page = Image.new("RGB", (max(picture.width, 560), picture.height + STRIP), "white")
    page.paste(picture)
    pen, x = ImageDraw.Draw(page), 12.0
    for text, colour in marks:
        pen.text((x, page.height - STRIP / 2), text, fill=colour, font=font(LETTERS), anchor="lm")
        x += pen.textlength(text, font=font(LETTERS)) + LETTERS
    about = PngInfo()
    about.add_text("Software", SOFTWARE)
    file = io.BytesIO()
    page.save(file, "PNG", pnginfo=about)
    return file.getvalue()


def is_read_png(path: Path) -> bool:
    """Whether a file is a picture that `read_png` made."""
    try:
        with path.open("rb") as file:
            return b"Software\0" + SOFTWARE.encode() in file.read(100)
    except OSError:
        return False
