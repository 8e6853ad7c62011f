"""Pictures of tilings, one on its own or several side by side, in pixels or for print."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from PIL import Image

from orbiflow.arguments import whole
from orbiflow.arrays import Window, checked_window
from orbiflow.drawing import (
    DEFAULT_PALETTE,
    Palette,
    Picture,
    Raster,
    Sheet,
    font,
    palette,
    palette_png,
    vector_picture,
)
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.tilings import Colouring, Tile, Tiles, as_tiling, colouring, copies_meeting

ASPECT = 1.5
"""Width over height of the default window."""


def default_window(tile: Tiles) -> Window:
    """Return a landscape window around the tile or prototiles, some four to five tiles across."""
    tiling = as_tiling(tile)
    width, height = tiling.box[1] - tiling.box[0]
    # by area, but so that a long tile with its limbs among its neighbours shows whole
    across = max(5.5 * math.sqrt(tiling.tile_area), 1.8 * width, 1.4 * ASPECT * height)
    x, y = tiling.center
    half, high = across / 2, across / 2 / ASPECT
    return float(x - half), float(y - high), float(x + half), float(y + high)


PIXELS_PER_POINT = 200 / 72
"""Pixels per point, where widths are given in points."""


def tiling_png(
    tile: Tiles,
    window: Window | None = None,
    *,
    width_px: int = 1600,
    palette_name: str | Palette = DEFAULT_PALETTE,
    colours: Colouring | None = None,
    outline_pt: float = 0.8,
    y_down: bool = False,
) -> bytes:
    """Return a PNG of the tiles that meet a window, edge to edge.

    Args:
        tile: A tile or a tiling.
        window: The window (xmin, ymin, xmax, ymax) in the tile's units. Default: `default_window`.
        width_px: The width in pixels; the height follows from the window.
        palette_name: The palette of paper, fills and outlines.
        colours: Which tile has which colour. Default: `colouring(tile)`.
        outline_pt: The outline's width in points of 1/72 inch at 200 dots per inch; 0 for none.
        y_down: Whether the tile's y axis points down, as in images.

    Raises:
        OrbiflowError: If the palette is unknown, the size is impossible, or the window is empty or
            holds too many tiles.
    """
    return tiling_raster(
        tile,
        window,
        width_px=width_px,
        palette_name=palette_name,
        colours=colours,
        outline_px=outline_pt * PIXELS_PER_POINT,
        y_down=y_down,
    ).png()


def tiling_raster(
    tile: Tiles,
    window: Window | None = None,
    *,
    width_px: int,
    palette_name: str | Palette = DEFAULT_PALETTE,
    colours: Colouring | None = None,
    outline_px: float = 2.0,
    y_down: bool = False,
    strip_px: int = 0,
) -> Raster:
    """Return the picture of `tiling_png` as a raster that can be drawn on.

    Args:
        tile, window, width_px, palette_name, colours, y_down: As for `tiling_png`.
        outline_px: The outline's width in pixels; 0 for none.
        strip_px: The height in pixels of a strip below it, for words.
    """
    chosen, tiling = palette(palette_name), as_tiling(tile)
    colours = colours or colouring(tiling)
    window = checked_window(window or default_window(tiling))
    raster = Raster(window, width_px, y_down=y_down, paper=chosen.paper, strip_px=strip_px)
    copies = copies_meeting(tiling, window)
    rings, own = copies.rings(), colours.colours(copies)
    for number in range(colours.count):
        raster.fill([rings[k] for k in np.flatnonzero(own == number)], chosen.fill(number))
    if outline_px > 0:
        for ring in rings:
            raster.line(ring, chosen.outline, outline_px, closed=True)
    return raster


def tiling_picture(
    tile: Tiles,
    window: Window | None = None,
    *,
    palette_name: str | Palette = DEFAULT_PALETTE,
    colours: Colouring | None = None,
    y_down: bool = False,
    sheet: Sheet | None = None,
) -> Picture:
    """Return the picture of `tiling_png` for print, in curves.

    Args:
        tile, window, palette_name, colours, y_down: As for `tiling_png`.
        sheet: The sheet it is drawn on. Default: a journal's single column, as PDF.

    Raises:
        OrbiflowError: As `tiling_png`.
    """
    raster = tiling_raster(
        tile, window, width_px=1600, palette_name=palette_name, colours=colours, y_down=y_down,
        outline_px=3.0,
    )  # fmt: skip
    kind = tile.isohedral_class if isinstance(tile, Tile) else ""
    several = f"{len(as_tiling(tile).prototiles)} tiles"
    name = "a tile" if len(as_tiling(tile).prototiles) == 1 else several
    title = f"Tiling by copies of {name}" + (f" of class {kind}" if kind else "")
    return vector_picture(raster, sheet or Sheet.column(), title=title, caption="")


PANEL_ASPECT = 1.25
"""Width over height of the part of a tiling that a panel of `tilings_png` shows."""

_NAME, _GAP = 0.13, 0.05  # height of a panel's name, and the space around it, in panel widths


def tilings_png(
    tilings: Mapping[str, Tiles],
    *,
    columns: int = 6,
    width_px: int = 1600,
    tiles: float = 22.0,
    palette_name: str | Palette = DEFAULT_PALETTE,
) -> bytes:
    """Return a PNG of several tilings side by side, in which neighbours have different colours.

    Args:
        tilings: The tilings by name, which is written below each.
        columns: The number of tilings in a row.
        width_px: The sheet's width in pixels; its height follows.
        tiles: The number of tiles that fit into a panel, by area.
        palette_name: The palette of paper, fills and outlines.

    Raises:
        OrbiflowError: If there are no tilings, the palette is unknown or the size is impossible.
    """
    columns = whole(columns, "columns", 1, 100)
    if not tilings:
        raise OrbiflowError("a sheet of tilings needs at least one")
    chosen = palette(palette_name)
    side = width_px / columns
    gap, name = round(_GAP * side), round(_NAME * side)
    panel = round(side) - 2 * gap
    rasters = [
        _panel(tiling, panel, tiles, label, name, chosen) for label, tiling in tilings.items()
    ]
    step = rasters[0].height + gap
    rows = math.ceil(len(rasters) / columns)
    sheet = Image.new("RGB", (width_px, rows * step + gap), chosen.paper)
    for number, raster in enumerate(rasters):
        row, column = divmod(number, columns)
        sheet.paste(raster.image(), (round(column * side) + gap, row * step + gap))
    return palette_png(sheet, list(dict.fromkeys(c for r in rasters for c in r.colours)))


def _panel(
    tiles: Tiles, width_px: int, count: float, label: str, name_px: int, chosen: Palette
) -> Raster:
    tiling = as_tiling(tiles)
    half = math.sqrt(count * tiling.tile_area * PANEL_ASPECT) / 2
    x, y = tiling.center.tolist()
    window: Window = (x - half, y - half / PANEL_ASPECT, x + half, y + half / PANEL_ASPECT)
    raster = tiling_raster(
        tiling, window, width_px=width_px, palette_name=chosen, outline_px=1.0, strip_px=name_px
    )
    for prototile in tiling.prototiles:
        raster.line(prototile.polygon, chosen.outline, max(2.0, 0.013 * width_px), closed=True)
    low, high = raster.plane_px, raster.height
    strip = np.array([[0, low], [width_px, low], [width_px, high], [0, high]])
    raster.fill_pixels(strip, chosen.paper)  # tiles at the window's edge reach into it
    size = 0.62 * name_px
    size *= min(1.0, width_px / max(1.0, font(size).getlength(label)))
    raster.text(width_px / 2, (low + high) / 2, label, size, anchor="mm")
    return raster
