"""A contact sheet of tilings: each in its colours, the prototiles outlined, its name below."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from PIL import Image

from orbiflow.arguments import whole
from orbiflow.arrays import Window
from orbiflow.drawing import (
    DEFAULT_PALETTE,
    Palette,
    Raster,
    font,
    palette,
    palette_png,
)
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.pictures.tilings import tiling_raster
from orbiflow.tiles.tilings import Tiles, as_tiling

ASPECT = 1.25
"""Width over height of the part of a tiling that a panel shows."""

_NAME, _GAP = 0.13, 0.05  # height of a panel's name, and the space around it, in panel widths


def tilings_png(
    tilings: Mapping[str, Tiles],
    *,
    columns: int = 6,
    width_px: int = 1600,
    tiles: float = 22.0,
    palette_name: str | Palette = DEFAULT_PALETTE,
) -> bytes:
    """PNG of several tilings side by side, tiles that share an edge in different colours.

    Args:
        tilings: by name, which is written below each.
        columns: how many in a row.
        width_px: of the sheet; its height follows.
        tiles: how many fit into a panel, by area.

    Raises:
        OrbiflowError: if there are none, for an unknown palette, or a size that cannot be made.
    """
    columns = whole(columns, "columns", 1, 100)
    if not tilings:
        raise OrbiflowError("a sheet of tilings needs one at least")
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
    half = math.sqrt(count * tiling.tile_area * ASPECT) / 2
    x, y = tiling.center.tolist()
    window: Window = (x - half, y - half / ASPECT, x + half, y + half / ASPECT)
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
