"""Drawings of a tile and of a tiling, in curves: plain paths without symbols or transforms.

Some programs drop symbols, transforms and style sheets.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orbiflow.arrays import Array, Window, checked_window
from orbiflow.drawing import DEFAULT_PALETTE, Sheet, palette
from orbiflow.tiles.pictures.printed import MIN_WIDTH, PrintedPicture
from orbiflow.tiles.scene import INCH, Box, Curve, Layer, Scene, Style, rectangle, write_svg
from orbiflow.tiles.tilings import (
    Colouring,
    Tile,
    Tiles,
    as_tiling,
    colouring,
    default_window,
    patch,
)

TILE_WIDTH, TILING_WIDTH = 100.0, 300.0
"""Widths of the pages of `tile_svg` and `tiling_svg` in mm."""

OUTLINE_SHARE = 1 / 1200
"""Width of the lines between tiles, as a share of the page's."""

DECIMALS = 4
"""Decimals of the coordinates in mm."""


def tile_svg(tile: Tile, *, y_down: bool = False, title: str = "") -> str:
    """Return the SVG of one tile, on a page with a small margin; arguments as for `tiling_svg`."""
    colours = palette(DEFAULT_PALETTE)
    low, high = tile.polygon.min(axis=0), tile.polygon.max(axis=0)
    margin = 0.04 * float((high - low).max())
    page = _Page((*(low - margin), *(high + margin)), TILE_WIDTH, y_down)
    style = Style(colours.fill(1), colours.outline, 0.3)
    layer = Layer("tile", "tiles", style, (page.curve(tile.polygon),))
    note = "A tile of the plane, made with orbiflow"
    return write_svg(page.scene([layer], title or _name(tile), note), decimals=DECIMALS)


def tiling_svg(
    tile: Tiles,
    window: Window | None = None,
    *,
    colours: Colouring | None = None,
    y_down: bool = False,
    title: str = "",
) -> str:
    """Return the SVG of the tiles that meet a window, clipped to it: one closed path per tile.

    Each colour's paths are a group, with the ids "colour-1", "colour-2" ... Every tile has a stroke,
    so that no paper shines through between neighbours. For another size or palette see `export`.

    Args:
        tile, window, colours, y_down: As for `tiling_raster`.
        title: The file's title. Default: the class.

    Raises:
        OrbiflowError: If the window is empty or holds too many tiles.
    """
    scene = tiling_scene(tile, window, colours=colours, y_down=y_down, title=title)
    return write_svg(scene, decimals=DECIMALS)


def tiling_picture(
    tile: Tiles,
    window: Window | None = None,
    *,
    colours: Colouring | None = None,
    y_down: bool = False,
    sheet: Sheet | None = None,
) -> PrintedPicture:
    """Return the picture of `tiling_raster` for print, in curves."""
    sheet = sheet or Sheet.column()
    kind = tile.isohedral_class if isinstance(tile, Tile) else ""
    count = len(as_tiling(tile).prototiles)
    title = f"Tiling by copies of {'a tile' if count == 1 else f'{count} tiles'}"
    title += f" of class {kind}" if kind else ""
    width = sheet.width * INCH
    scene = tiling_scene(tile, window, colours=colours, y_down=y_down, title=title, width=width)
    return PrintedPicture(scene, sheet)


def tiling_scene(
    tile: Tiles,
    window: Window | None = None,
    *,
    colours: Colouring | None = None,
    y_down: bool = False,
    title: str = "",
    width: float = TILING_WIDTH,
) -> Scene:
    """Return the tiles that meet a window on a page of this width in mm; arguments as `tiling_svg`."""
    chosen, tiling = palette(DEFAULT_PALETTE), as_tiling(tile)
    colours = colours or colouring(tiling)
    page = _Page(window or default_window(tile), width, y_down)
    groups: list[list[Curve]] = [[] for _ in range(colours.count)]
    for element in patch(tiling, page.window):
        polygon = tiling.prototiles[element.prototile].polygon
        groups[colours.colour(element)].append(page.curve(element(polygon)))
    border = rectangle(Box(0.0, 0.0, page.width, page.height))
    layers = [Layer("paper", "paper", Style(chosen.paper), (border,))]
    for number, curves in enumerate(groups):
        style = Style(chosen.fill(number), chosen.outline, max(OUTLINE_SHARE * width, MIN_WIDTH))
        layers.append(Layer(f"colour {number + 1}", "tiles", style, tuple(curves), clipped=True))
    what = "An isohedral tiling" if len(tiling.prototiles) == 1 else "A tiling"
    note = (
        f"{what} of the plane ({_name(tile)}), made with orbiflow. "
        "Each path is one tile; groups collect the tiles of one colour."
    )
    return page.scene(layers, title or f"Tiling {_name(tile)}", note)


class _Page:
    """A window of a tile's coordinates on a page in millimetres, with y pointing down."""

    def __init__(self, window: Sequence[float], width_mm: float, y_down: bool) -> None:
        xmin, ymin, xmax, ymax = self.window = checked_window(window)
        self.width, self.height = width_mm, width_mm * (ymax - ymin) / (xmax - xmin)
        self._origin = np.array([xmin, ymin if y_down else ymax])
        self._scale = np.array([1.0, 1.0 if y_down else -1.0]) * (width_mm / (xmax - xmin))

    def curve(self, ring: Array) -> Curve:
        return Curve.polyline((ring - self._origin) * self._scale, closed=True)

    def scene(self, layers: list[Layer], title: str, note: str) -> Scene:
        return Scene(self.width, self.height, tuple(layers), title=title, notes=(note,))


def _name(tile: Tiles) -> str:
    kind = tile.isohedral_class if isinstance(tile, Tile) else ""
    return " ".join(part for part in (kind, tile.group.name) if part) or "tile"
