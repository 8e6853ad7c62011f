"""Pictures of a tile and of tilings, in pixels, for print, or as plain curves."""

from __future__ import annotations

import math
from collections.abc import Mapping

from PIL import Image, ImageDraw

from orbiflow.arrays import Window
from orbiflow.drawing import DEFAULT_PALETTE, Sheet, font, palette, palette_png
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_whole
from orbiflow.tiles.page import Layer, Page, Style, symbol_of
from orbiflow.tiles.pictures.sketch import LEAST_LINE, ScenePicture
from orbiflow.tiles.tilings import Colouring, Tile, Tiles, as_tiling, default_window
from orbiflow.tiles.write import INCH, scene_image

OUTLINE_SHARE = 1 / 720  # width of the lines between tiles, as a share of the page's
TILE_MARGIN = 0.04  # the margin around a single tile, as a share of its longer side


def tile_picture(
    tile: Tiles, *, y_down: bool = False, sheet: Sheet | None = None, title: str = ""
) -> ScenePicture:
    """Return a picture of one tile with a small margin; arguments as for `tiling_picture`.

    Of a tiling it shows a copy of each prototile.
    """
    low, high = as_tiling(tile).box
    margin = TILE_MARGIN * float((high - low).max())
    sheet, chosen = sheet or Sheet.column(100.0), palette(DEFAULT_PALETTE)
    window = (*(low - margin).tolist(), *(high + margin).tolist())
    page = Page.of_window(tile, window, sheet.width * INCH, y_down=y_down)
    width, first = 0.003 * page.size[0], int(len(page.polygons) == 1)
    layers = tuple(
        Layer(symbol_of(k), "tiles", Style(chosen.fill(first + k), chosen.outline, width), (ring,))
        for k, ring in enumerate(page.polygons)
    )
    note = "A tile of the plane, made with orbiflow"
    return ScenePicture(page.empty(layers, title=title or _name(tile), notes=(note,)), sheet)


def tiling_picture(
    tile: Tiles,
    window: Window | None = None,
    *,
    colours: Colouring | None = None,
    y_down: bool = False,
    sheet: Sheet | None = None,
    outline: float = OUTLINE_SHARE,
    title: str = "",
) -> ScenePicture:
    """Return the tiles that meet a window, edge to edge, clipped to it.

    Every tile has an outline, so that no paper shines through between neighbours. For another size or
    palette see `export`.

    Args:
        tile: A tile or a tiling.
        window: The window (xmin, ymin, xmax, ymax) in the tile's units. Default: `default_window`.
        colours: Which tile has which colour. Default: `colouring(tile)`.
        y_down: Whether the tile's y axis points down, as in images.
        sheet: The sheet. Default: 1600 pixels.
        outline: The outline's width as a share of the page's.
        title: The title. Default: the class and group.

    Raises:
        OrbiflowError: If the size is impossible, or the window is empty or holds too many tiles.
    """
    sheet, tiling, chosen = sheet or Sheet.screen(1600), as_tiling(tile), palette(DEFAULT_PALETTE)
    window = window or default_window(tiling)
    page = Page.of_window(tile, window, sheet.width * INCH, y_down=y_down, colouring=colours)
    width = outline * page.size[0]
    line = Style(None, chosen.outline, max(width, LEAST_LINE) if sheet.printed else width)
    what = "An isohedral tiling" if len(tiling.prototiles) == 1 else "A tiling"
    note = (
        f"{what} of the plane ({_name(tile)}), made with orbiflow. "
        "Each path is one tile; groups collect the tiles of one colour."
    )
    named = {"title": title or f"Tiling {_name(tile)}", "notes": (note,)}
    return ScenePicture(page.scene(chosen, line, clipped=True, **named), sheet)


PANEL_ASPECT = 1.25  # width over height of the part of a tiling that a panel of `tilings_png` shows
PANEL_TILES = 22  # the number of tiles that fit into it, by area
NAME_SHARE, GAP_SHARE = 0.13, 0.05  # a panel's name, and the space around it, in panel widths


def tilings_png(tilings: Mapping[str, Tiles], *, columns: int = 6, width_px: int = 1600) -> bytes:
    """Return a PNG of several tilings side by side, in which neighbours have different colours.

    Args:
        tilings: The tilings by name, which is written below each.
        columns: The number of tilings in a row.
        width_px: The sheet's width in pixels; its height follows.

    Raises:
        OrbiflowError: If there are no tilings or the size is impossible.
    """
    columns = as_whole(columns, "columns", 1, 100)
    if not tilings:
        raise OrbiflowError("a sheet of tilings needs at least one")
    side, chosen = width_px / columns, palette(DEFAULT_PALETTE)
    gap, name = round(GAP_SHARE * side), round(NAME_SHARE * side)
    panel = round(side) - 2 * gap
    pictures = [_panel(tiling, panel) for tiling in tilings.values()]
    step = pictures[0].height + name + gap
    rows = math.ceil(len(pictures) / columns)
    sheet = Image.new("RGB", (width_px, rows * step + gap), chosen.paper)
    pen = ImageDraw.Draw(sheet)
    for number, (label, picture) in enumerate(zip(tilings, pictures, strict=True)):
        row, column = divmod(number, columns)
        left, top = round(column * side) + gap, row * step + gap
        sheet.paste(picture, (left, top))
        size = 0.62 * name
        size *= min(1.0, panel / max(1.0, font(size).getlength(label)))
        at = left + panel / 2, top + picture.height + name / 2
        pen.text(at, label, "#1a1a1a", font(size), anchor="mm")
    return palette_png(sheet, [chosen.paper, "#1a1a1a", chosen.outline, *chosen.colours])


def _panel(tiles: Tiles, width_px: int) -> Image.Image:
    """Return a small tiling whose prototiles have a thick outline."""
    tiling, chosen = as_tiling(tiles), palette(DEFAULT_PALETTE)
    half = math.sqrt(PANEL_TILES * tiling.tile_area * PANEL_ASPECT) / 2
    x, y = tiling.center.tolist()
    window = (x - half, y - half / PANEL_ASPECT, x + half, y + half / PANEL_ASPECT)
    page = Page.of_window(tiling, window, float(width_px))
    scene = page.scene(chosen, Style(None, chosen.outline, 1.0), clipped=True)
    thick = Style(None, chosen.outline, max(2.0, 0.013 * width_px))
    return scene_image(scene.with_layers(Layer("prototiles", "tiles", thick, tuple(page.polygons))))


def _name(tile: Tiles) -> str:
    kind = tile.isohedral_class if isinstance(tile, Tile) else ""
    return " ".join(part for part in (kind, tile.group.name) if part) or "tile"
