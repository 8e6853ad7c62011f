"""The sheets that Pillow draws: what was read (`read.png`), and what was found (`overview.png`)."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Sequence
from pathlib import Path, PurePath

import numpy as np
from PIL import Image, ImageDraw
from PIL.PngImagePlugin import PngInfo
from shapely import Polygon

from orbiflow.arrays import Array, Window
from orbiflow.drawing import Raster, font, window_of
from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.likeness import MOST_STARS
from orbiflow.tiles.pictures import comparison, tiling_raster
from orbiflow.tiles.search import ClassFailure
from orbiflow.tiles.silhouette import Target, holes_filled, open_image, parts_left_out, upright
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tilings import Colouring

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
    def decode(_: object, image: Image.Image) -> Image.Image:
        image.draft("RGB", (LONGER_SIDE, LONGER_SIDE))
        turned = upright(image)[0].convert("RGBA")
        white = Image.new("RGBA", turned.size, "white")
        return Image.alpha_composite(white, turned).convert("RGB")

    return open_image(path, decode)


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


INK, FAINT, WARNING = "#1a1a1a", "#5b6570", "#b0413e"
STAR, PALE = "#c98a1b", "#dfe3e7"

# pixels of a sheet 1920 wide: at 1440, a laptop's width, the smallest words are 19 high
_WIDTH, _MARGIN, _GAP = 1920, 40, 36
_HEADER, _FOOT = 190, 176
_TITLE, _NAME, _WORDS = 46, 34, 26
_THUMB = 156
_COLUMN = 32  # letters in a line of words


def overview_png(
    results: Sequence[EscherTile],
    target: Target,
    colours: Sequence[Colouring] | None = None,
    *,
    failures: Sequence[ClassFailure] = (),
) -> bytes:
    """Return a PNG of all tiles, best first: each tiling, large, and below it what bent.

    It is 1920 pixels wide (1320 for a single tile) and legible at 1440.

    Args:
        results: The tiles of one search, one or more.
        target: The silhouette that was searched for.
        colours: The colouring of each tiling, if it is known already.
        failures: The classes without a tile, which are named.
    """
    columns = {1: 1, 2: 2, 4: 2}.get(len(results), 3)
    width = 1320 if columns == 1 else _WIDTH
    cell = (width - 2 * _MARGIN - (columns - 1) * _GAP) // columns
    height = round(cell / 1.5) + _FOOT
    rows = -(-len(results) // columns)
    sheet = Image.new("RGB", (width, _HEADER + rows * (height + _GAP)), "white")
    pen = ImageDraw.Draw(sheet)
    _header(sheet, pen, target, len(results), [failure.name for failure in failures])
    for k, result in enumerate(results):
        row, column = divmod(k, columns)
        left, top = _MARGIN + column * (cell + _GAP), _HEADER + row * (height + _GAP)
        below = top + round(cell / 1.5) + 14
        _write_words(pen, result, left + _THUMB + 22, below, k + 1)
        own = colours[k] if colours else None
        tiling = tiling_raster(
            result.tile, width_px=cell, colours=own, outline_px=1.4, y_down=target.y_down
        )
        sheet.paste(tiling.image(), (left, top))
        thumb = _small(result, target).image()
        thumb.thumbnail((_THUMB, _THUMB))
        sheet.paste(thumb, (left + (_THUMB - thumb.width) // 2, below))
    buffer = io.BytesIO()
    sheet.save(buffer, "PNG", compress_level=4)
    return buffer.getvalue()


def _header(
    sheet: Image.Image, pen: ImageDraw.ImageDraw, target: Target, count: int, failed: list[str]
) -> None:
    window = window_of([target.outline])
    small = Raster(window, _fitting(window), y_down=target.y_down)
    small.fill([target.outline], INK)
    picture = small.image()
    picture.thumbnail((_THUMB, _THUMB))
    sheet.paste(picture, (_MARGIN, (_HEADER - picture.height) // 2))
    left, middle = _MARGIN + picture.width + 28, _HEADER // 2
    name = PurePath(target.source).name
    pen.text((left, middle - 6), name, INK, font(_TITLE), anchor="ls")
    tiles = "1 tile: its" if count == 1 else f"{count} tiles, best first: each one's"
    text = f"{tiles} tiling, and below it the silhouette in its place"
    pen.text((left, middle + 40), text, FAINT, font(_WORDS), anchor="ls")
    if failed:
        text = f"No tile of {', '.join(failed)}"
        pen.text((left, middle + 76), text, WARNING, font(_WORDS), anchor="ls")


def _write_words(
    pen: ImageDraw.ImageDraw, result: EscherTile, left: int, below: int, rank: int
) -> None:
    valid, middle = result.certificate.valid, below + 22
    pen.text((left, middle), f"{rank}.", INK, font(_NAME), anchor="lm")
    if result.rating:
        for k in range(MOST_STARS):
            _draw_star(pen, left + 60 + 40 * k, middle, result.rating.stars - k)
        pen.text((left + 272, middle), result.rating.word, INK, font(_NAME), anchor="lm")
    lines = textwrap.wrap(result.arrangement, _COLUMN)
    for k, line in enumerate(lines):
        pen.text((left, below + 76 + 32 * k), line, INK, font(_WORDS), anchor="ls")
    words = f"{result.isohedral_class} ({result.group_name}), "
    words += "certified" if valid else "NOT CERTIFIED"
    if result.front is not None:
        words += f", for {result.objective}"
    colour = FAINT if valid else WARNING
    under = below + 80 + 32 * len(lines)
    pen.text((left, under), words, colour, font(_WORDS), anchor="ls")


def _draw_star(pen: ImageDraw.ImageDraw, left: float, middle: float, share: float) -> None:
    """Draw a star, 34 pixels wide, whole or half; pale where there is none."""
    turns = np.pi / 5 * np.arange(10)
    reach = np.where(np.arange(10) % 2, 7.5, 18.0)
    x, y = left + 17 + reach * np.sin(turns), middle + 1 - reach * np.cos(turns)
    pen.polygon(list(zip(x, y, strict=True)), STAR if share >= 1 else PALE)
    if 0 < share < 1:
        pen.polygon([(x[k], y[k]) for k in (0, 5, 6, 7, 8, 9)], STAR)


def _small(result: EscherTile, target: Target) -> Raster:
    """Draw a tile and its silhouette, without a legend."""
    bent = [] if result.bent is None or result.rest is None else [result.rest, result.bent]
    width = _fitting(window_of([result.tile.polygon, *(bent or [target.outline])]))
    return comparison(result, target, width_px=width, thick=3.5)


def _fitting(window: Window) -> int:
    """Return the width in pixels at which a window fits beside its words; more if it is very long."""
    aspect = (window[2] - window[0]) / (window[3] - window[1])
    return max(16, round(_THUMB * min(1.0, aspect)), round(17 * aspect))
