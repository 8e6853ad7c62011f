"""What a search found on one sheet, `overview.png`."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Sequence
from pathlib import PurePath

import numpy as np
from PIL import Image, ImageDraw

from orbiflow.arrays import Window
from orbiflow.drawing import Raster, font, window_of
from orbiflow.tiles.likeness import MOST_STARS
from orbiflow.tiles.pictures import comparison, tiling_raster
from orbiflow.tiles.search import ClassFailure
from orbiflow.tiles.silhouette import Target
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tilings import Colouring

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
