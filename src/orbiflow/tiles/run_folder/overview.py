"""What Pillow draws of a search: what was read (`read.png`) and what was found (`overview.png`)."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path, PurePath

import numpy as np
from PIL import Image, ImageDraw
from PIL.PngImagePlugin import PngInfo
from shapely import MultiPolygon, Polygon

from orbiflow.arrays import Window
from orbiflow.drawing import Sheet, font, png_bytes, window_of
from orbiflow.tiles.likeness import MOST_STARS
from orbiflow.tiles.pictures import Sketch, comparison, tiling_picture
from orbiflow.tiles.run_folder.files import SOFTWARE
from orbiflow.tiles.search import ClassFailure
from orbiflow.tiles.silhouette import Target, holes_filled, open_image, parts_left_out
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tilings import Colouring

LONGER_SIDE = 1200  # pixels
OUTLINE, LEFT_OUT, FILLED, DRAWING = "#e6007e", "#ff8c00", "#0078ff", "#444444"
LEAST_WIDTH, STRIP, LETTERS = 580, 44, 22  # pixels
LINE = 2.0  # pixels: half of the outline's width


def read_png(target: Target, source: Path) -> bytes:
    """Return a PNG of the picture or drawing in a file, with the outline that was read of it.

    Parts left out and holes filled are marked, too.
    """
    window, whole = _window(target), Polygon(target.outline)
    lost, holes = parts_left_out(target), holes_filled(target)
    pixel = max(window[2] - window[0], window[3] - window[1]) / LONGER_SIDE
    width = round((window[2] - window[0]) / pixel)

    def sketch(paper: str) -> Sketch:
        sheet = Sheet.screen(width)
        return Sketch(window, sheet, y_down=target.y_down, paper=paper, strip=STRIP / width)

    base = sketch("#ffffff")
    if target.kind != "image":
        base.fill(whole if target.seen is None else target.seen, DRAWING)
    _mark(base, "read as the silhouette", OUTLINE, 12 / width)
    if lost:
        _mark(base, "left out", LEFT_OUT, 300 / width)
    if holes:
        _mark(base, "hole, filled", FILLED, 430 / width)
    page = base.picture().image(width)
    if target.size and target.kind == "image":
        page.paste(_source(source).resize([max(1, round(side / pixel)) for side in target.size]))
    for geometry, colour, opacity in (
        (MultiPolygon(lost), LEFT_OUT, 0.7),
        (MultiPolygon(holes), FILLED, 0.5),
        (whole.exterior.buffer(2 * LINE * pixel), "#ffffff", 1.0),
        (whole.exterior.buffer(LINE * pixel), OUTLINE, 1.0),
    ):
        mask = sketch("#000000")
        mask.fill(geometry, "#" + 3 * f"{round(255 * opacity):02x}")
        shares = mask.picture().image(width).convert("L")
        # a last row of which the paper covers a part would be marked
        shares.paste(0, (0, shares.height - STRIP // 2, *shares.size))
        page.paste(colour, mask=shares)
    about = PngInfo()
    about.add_text("Software", SOFTWARE)
    return png_bytes(page, pnginfo=about)


def _window(target: Target) -> Window:
    """Return what is shown, in the silhouette's units, wide enough for the words below."""
    rings = [target.outline]
    if target.seen is not None:
        rings.append(np.reshape(target.seen.bounds, (2, 2)))
    xmin, ymin, xmax, ymax = window_of(rings, 0.05)
    if target.kind == "image" and target.size is not None:
        xmin, ymin, xmax, ymax = 0.0, 0.0, *target.size
    return xmin, ymin, max(xmax, xmin + LEAST_WIDTH / LONGER_SIDE * (ymax - ymin)), ymax


def _mark(sketch: Sketch, text: str, colour: str, x: float) -> None:
    """Say in the strip what a colour means, at a share x of the width."""
    size = LETTERS / (sketch.sheet.width * sketch.sheet.dpi)
    sketch.swatch(x, x + size, size / 2, colour)
    sketch.write(text, (x + 1.3 * size) * sketch.width, size * sketch.width)


def _source(path: Path) -> Image.Image:
    image = open_image(path, enough=LONGER_SIDE)[0].convert("RGBA")
    white = Image.new("RGBA", image.size, "white")
    return Image.alpha_composite(white, image).convert("RGB")


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
    targets: Sequence[Target],
    colours: Sequence[Colouring] | None = None,
    *,
    failures: Sequence[ClassFailure] = (),
) -> bytes:
    """Return a PNG of all tiles, best first: each tiling, large, and below it what bent.

    It is 1920 pixels wide (1320 for a single tile) and legible at 1440.

    Args:
        results: The tiles of one search, one or more.
        targets: The silhouettes that were searched for.
        colours: The colouring of each tiling, if it is known already.
        failures: The classes without a tile, which are named.
    """
    columns = {1: 1, 2: 2, 4: 2}.get(len(results), 3)
    if len(targets) > 1:  # two small pictures leave less room for words
        columns = min(columns, 2)
    width = 1320 if columns == 1 else _WIDTH
    cell = (width - 2 * _MARGIN - (columns - 1) * _GAP) // columns
    height = round(cell / 1.5) + _FOOT
    rows = -(-len(results) // columns)
    sheet = Image.new("RGB", (width, _HEADER + rows * (height + _GAP)), "white")
    pen = ImageDraw.Draw(sheet)
    _header(sheet, pen, targets, len(results), [failure.name for failure in failures])
    thumbs = len(targets) * (_THUMB + 22)
    for k, result in enumerate(results):
        row, column = divmod(k, columns)
        left, top = _MARGIN + column * (cell + _GAP), _HEADER + row * (height + _GAP)
        below = top + round(cell / 1.5) + 14
        _write_words(pen, result, left + thumbs, below, k + 1)
        coloured = colours[k] if colours else None
        tiling = tiling_picture(
            result.tiling, colours=coloured, outline=1.4 / cell, y_down=result.y_down
        )
        sheet.paste(tiling.image(cell), (left, top))
        for number, (figure, target) in enumerate(zip(result.likenesses, targets, strict=True)):
            thumb = _small(figure, target)
            thumb.thumbnail((_THUMB, _THUMB))
            middle = left + number * (_THUMB + 22) + (_THUMB - thumb.width) // 2
            sheet.paste(thumb, (middle, below))
    return png_bytes(sheet, compress_level=4)


def _header(
    sheet: Image.Image,
    pen: ImageDraw.ImageDraw,
    targets: Sequence[Target],
    count: int,
    failed: list[str],
) -> None:
    left, middle = _MARGIN, _HEADER // 2
    for target in targets:
        window = window_of([target.outline])
        width = _fitting(window)
        small = Sketch(window, Sheet.screen(width), y_down=target.y_down)
        small.fill(target.outline, INK)
        picture = small.picture().image(width)
        picture.thumbnail((_THUMB, _THUMB))
        sheet.paste(picture, (left, (_HEADER - picture.height) // 2))
        left += picture.width + 28
    name = " and ".join(PurePath(target.source).name for target in targets)
    pen.text((left, middle - 6), name, INK, font(_TITLE), anchor="ls")
    tiles = "1 tile: its" if count == 1 else f"{count} tiles, best first: each one's"
    what = "silhouette in its place" if len(targets) == 1 else "silhouettes in their places"
    text = f"{tiles} tiling, and below it the {what}"
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


def _small(result: EscherTile, target: Target) -> Image.Image:
    """Draw a tile and its silhouette, without a legend."""
    bent = (
        []
        if result.likeness.bent is None or result.likeness.rest is None
        else [result.likeness.rest, result.likeness.bent]
    )
    width = _fitting(window_of([result.tile.polygon, *(bent or [target.outline])]))
    return comparison(result, target, thick=3.5, sheet=Sheet.screen(width)).image(width)


def _fitting(window: Window) -> int:
    """Return the width in pixels at which a window fits beside its words; more if it is very long."""
    aspect = (window[2] - window[0]) / (window[3] - window[1])
    return max(16, round(_THUMB * min(1.0, aspect)), round(17 * aspect))
