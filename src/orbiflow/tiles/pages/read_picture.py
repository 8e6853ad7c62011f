"""The picture of what was read as the silhouette (`read.png`), to be looked at before a search."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from PIL import Image
from PIL.PngImagePlugin import PngInfo
from shapely import MultiPolygon, Polygon, box

from orbiflow.arrays import Window
from orbiflow.drawing import Raster, strip_middle, window_of
from orbiflow.tiles.silhouette import Target, holes_filled, open_image, parts_left_out

LONGER_SIDE = 1200  # pixels
OUTLINE, LEFT_OUT, FILLED, DRAWING = "#e6007e", "#ff8c00", "#0078ff", "#444444"
LEAST_WIDTH, STRIP, LETTERS = 580, 44, 22  # pixels
LINE = 2.0  # pixels: half of the outline's width
SOFTWARE = "orbiflow"


def read_png(target: Target, source: Path) -> bytes:
    """Return a PNG of the picture or drawing in a file, with the outline that was read of it.

    Parts left out and holes filled are marked, too.
    """
    window, whole = _window(target), Polygon(target.outline)
    lost, holes = parts_left_out(target), holes_filled(target)
    pixel = max(window[2] - window[0], window[3] - window[1]) / LONGER_SIDE
    width = round((window[2] - window[0]) / pixel)

    def raster(paper: str) -> Raster:
        return Raster(window, width, y_down=target.y_down, paper=paper, strip_px=STRIP)

    base = raster("#ffffff")
    if target.kind != "image":
        base.fill_geometry(whole if target.seen is None else target.seen, DRAWING)
    _mark(base, "read as the silhouette", OUTLINE, 12)
    if lost:
        _mark(base, "left out", LEFT_OUT, 300)
    if holes:
        _mark(base, "hole, filled", FILLED, 430)
    page = base.image()
    if target.size and target.kind == "image":
        page.paste(_source(source).resize([max(1, round(side / pixel)) for side in target.size]))
    for geometry, colour, opacity in (
        (MultiPolygon(lost), LEFT_OUT, 0.7),
        (MultiPolygon(holes), FILLED, 0.5),
        (whole.exterior.buffer(2 * LINE * pixel), "#ffffff", 1.0),
        (whole.exterior.buffer(LINE * pixel), OUTLINE, 1.0),
    ):
        mask = raster("#000000")
        mask.fill_geometry(geometry, "#" + 3 * f"{round(255 * opacity):02x}")
        page.paste(colour, mask=mask.image().convert("L"))
    about, file = PngInfo(), io.BytesIO()
    about.add_text("Software", SOFTWARE)
    page.save(file, "PNG", pnginfo=about)
    return file.getvalue()


def _window(target: Target) -> Window:
    """Return what is shown, in the silhouette's units, wide enough for the words below."""
    rings = [target.outline]
    if target.seen is not None:
        rings.append(np.reshape(target.seen.bounds, (2, 2)))
    xmin, ymin, xmax, ymax = window_of(rings, 0.05)
    if target.kind == "image" and target.size is not None:
        xmin, ymin, xmax, ymax = 0.0, 0.0, *target.size
    return xmin, ymin, max(xmax, xmin + LEAST_WIDTH / LONGER_SIDE * (ymax - ymin)), ymax


def _mark(raster: Raster, text: str, colour: str, x: float) -> None:
    y, half = strip_middle(raster), LETTERS / 2
    square = box(x, y - half, x + LETTERS, y + half)
    raster.fill_pixels(np.array(square.exterior.coords), colour)
    raster.text(x + 1.3 * LETTERS, y, text, LETTERS)


def _source(path: Path) -> Image.Image:
    image = open_image(path, enough=LONGER_SIDE)[0].convert("RGBA")
    white = Image.new("RGBA", image.size, "white")
    return Image.alpha_composite(white, image).convert("RGB")


def is_read_png(path: Path) -> bool:
    """Whether a file is a picture that `read_png` made."""
    try:
        with path.open("rb") as file:
            return b"Software\0" + SOFTWARE.encode() in file.read(100)
    except OSError:
        return False
