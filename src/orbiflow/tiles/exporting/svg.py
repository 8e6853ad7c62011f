"""SVG of a tile and of a tiling, for Inkscape, Illustrator, browsers and cutters.

Plain paths in millimetres: no symbols, no transforms, no style sheets, which some programs drop.
"""

from __future__ import annotations

from collections.abc import Iterable
from xml.sax.saxutils import escape

import numpy as np

from orbiflow.arrays import Array, Window
from orbiflow.drawing import (
    DEFAULT_PALETTE,
    Palette,
    palette,
)
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.pictures import default_window
from orbiflow.tiles.tilings import (
    Colouring,
    Tile,
    Tiles,
    as_tiling,
    colouring,
    patch,
)

_HEADER = """<?xml version="1.0" encoding="UTF-8"?>
<svg xmlns="http://www.w3.org/2000/svg" version="1.1" width="{width}mm" height="{height}mm" \
viewBox="0 0 {width} {height}">
  <title>{title}</title>
  <desc>{description}</desc>
"""


def tile_svg(
    tile: Tile,
    *,
    width_mm: float = 100.0,
    palette_name: str | Palette = DEFAULT_PALETTE,
    fill: str | None = None,
    outline_mm: float = 0.3,
    y_down: bool = False,
    title: str = "",
) -> str:
    """SVG of the tile alone, on a page of `width_mm` with a small margin.

    Args:
        fill: a colour, "none" for cutting, default the palette's second.
        outline_mm: width of the outline.
        y_down: whether the tile's y axis points down, as in images.
        title: for the file's metadata; default the class.

    Raises:
        OrbiflowError: for an unknown palette or a page without size.
    """
    colours = palette(palette_name)
    low, high = tile.polygon.min(axis=0), tile.polygon.max(axis=0)
    margin = 0.04 * float((high - low).max())
    window = (*(low - margin), *(high + margin))
    page = _Page(window, width_mm, y_down)
    style = f'fill="{fill or colours.fill(1)}"{_stroke(colours.outline, outline_mm)}'
    path = f'  <path id="tile" {style} d="{page.path(tile.polygon)}"/>\n'
    return page.document(path, title or _name(tile), "A tile of the plane, made with orbiflow")


def tiling_svg(
    tile: Tiles,
    window: Window | None = None,
    *,
    width_mm: float = 300.0,
    palette_name: str | Palette = DEFAULT_PALETTE,
    colours: Colouring | None = None,
    outline_mm: float = 0.25,
    y_down: bool = False,
    title: str = "",
) -> str:
    """SVG of the tiles that meet `window`, clipped to it: one closed path per tile.

    Paths are in one group per colour, with the ids "colour-1", "colour-2" ... Every tile has a
    stroke, so that no paper shines through between neighbours.

    Args:
        tile: a tile or a tiling.
        window: (xmin, ymin, xmax, ymax) in the tile's units, default `default_window`.
        colours: default `colouring(tile)`.
        outline_mm: width of the outline; 0 means a hairline in the tile's own colour.
        y_down: whether the tile's y axis points down, as in images.
        title: for the file's metadata; default the class.

    Raises:
        OrbiflowError: for an unknown palette, or a window that is empty or holds too many tiles.
    """
    chosen = palette(palette_name)
    tiling = as_tiling(tile)
    colours = colours or colouring(tiling)
    page = _Page(window or default_window(tile), width_mm, y_down)
    groups: list[list[Array]] = [[] for _ in range(colours.count)]
    for element in patch(tiling, page.window):
        polygon = tiling.prototiles[element.prototile].polygon
        groups[colours.colour(element)].append(element(polygon))
    parts = ['  <defs>\n    <clipPath id="window">' + page.rectangle() + "</clipPath>\n  </defs>\n"]
    parts.append(f'  <g id="paper" fill="{chosen.paper}">{page.rectangle()}</g>\n')
    parts.append('  <g id="tiling" clip-path="url(#window)">\n')
    for number, rings in enumerate(groups):
        fill = chosen.fill(number)
        stroke = _stroke(chosen.outline, outline_mm) if outline_mm > 0 else _stroke(fill, 0.1)
        parts.append(f'    <g id="colour-{number + 1}" fill="{fill}"{stroke}>\n')
        parts.extend(f'      <path d="{page.path(ring)}"/>\n' for ring in rings)
        parts.append("    </g>\n")
    parts.append("  </g>\n")
    return page.document(
        "".join(parts), title or f"Tiling {_name(tile)}".strip(), _description(tile)
    )


class _Page:
    """From the tile's coordinates to millimetres on a page with y pointing down."""

    def __init__(self, window: Iterable[float], width_mm: float, y_down: bool) -> None:
        xmin, ymin, xmax, ymax = (float(value) for value in window)
        if not (width_mm > 0 and np.isfinite(width_mm) and xmax > xmin and ymax > ymin):
            raise OrbiflowError(
                f"a page needs a positive width and a window with xmin < xmax, ymin < ymax; got "
                f"{width_mm} mm and {(xmin, ymin, xmax, ymax)}"
            )
        self.window: Window = (xmin, ymin, xmax, ymax)
        self.scale = width_mm / (xmax - xmin)
        self.width, self.height = width_mm, width_mm * (ymax - ymin) / (xmax - xmin)
        self._origin = np.array([xmin, ymin if y_down else ymax])
        self._signs = np.array([1.0, 1.0 if y_down else -1.0])

    def path(self, ring: Array) -> str:
        points = (ring - self._origin) * self._signs * self.scale
        # a tenth of a micrometre
        return "M" + "L".join(f"{_number(x)},{_number(y)}" for x, y in points) + "Z"

    def rectangle(self) -> str:
        return f'<rect x="0" y="0" width="{_number(self.width)}" height="{_number(self.height)}"/>'

    def document(self, body: str, title: str, description: str) -> str:
        header = _HEADER.format(
            width=_number(self.width),
            height=_number(self.height),
            title=escape(title),
            description=escape(description),
        )
        return header + body + "</svg>\n"


def _number(value: float) -> str:
    text = f"{value:.4f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def _stroke(colour: str, width: float) -> str:
    return f' stroke="{colour}" stroke-width="{_number(width)}" stroke-linejoin="round"'


def _name(tile: Tiles) -> str:
    kind = tile.isohedral_class if isinstance(tile, Tile) else ""
    return " ".join(part for part in (kind, tile.group.name) if part) or "tile"


def _description(tile: Tiles) -> str:
    what = "An isohedral tiling" if len(as_tiling(tile).prototiles) == 1 else "A tiling"
    return (
        f"{what} of the plane ({_name(tile)}), made with orbiflow. "
        "Each path is one tile; groups collect the tiles of one colour."
    )
