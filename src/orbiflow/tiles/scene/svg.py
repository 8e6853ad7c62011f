"""Scenes as SVG, for Inkscape, Illustrator, browsers and cutters; and the SVG of a tile or a tiling.

One user unit is one millimetre, and layers are those of Inkscape. A scene's copies are one short
line each; `tile_svg` and `tiling_svg` write plain paths without symbols, transforms or style
sheets, which some programs drop.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator, Sequence
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from orbiflow.arrays import Array, Window, checked_window
from orbiflow.drawing import DEFAULT_PALETTE, palette
from orbiflow.tiles.pictures import default_window
from orbiflow.tiles.scene.scene import (
    Box,
    Curve,
    Layer,
    Motif,
    Part,
    Raster,
    Scene,
    Style,
    Uses,
    rectangle,
)
from orbiflow.tiles.tilings import Colouring, Tile, Tiles, as_tiling, colouring, patch

_HEADER = """<?xml version="1.0" encoding="UTF-8"?>
<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" \
xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape" version="1.1" \
width="{width}mm" height="{height}mm" viewBox="0 0 {width} {height}">
"""


def write_svg(scene: Scene, *, decimals: int = 3) -> str:
    """Return the scene as an SVG document, with so many decimals of coordinates in mm.

    Edges that two tiles share have the same numbers up to the last of them.
    """
    number = Numbers(decimals)
    parts = [_HEADER.format(width=number(scene.width), height=number(scene.height))]
    parts.append(f"  <title>{escape(scene.title)}</title>\n")
    if scene.notes:
        parts.append(f"  <desc>{escape(' '.join(scene.notes))}</desc>\n")
    parts.append(_definitions(scene, number))
    for layer in scene.layers:
        parts.append(_layer_start(layer))
        for item in layer.items:
            if isinstance(item, Uses):
                reach = float(np.abs(scene.points(item.symbol)).max())
                parts.extend(_uses(item, reach, number))
            elif isinstance(item, Curve):
                parts.append(f'    <path d="{path_data(item, number)}"/>\n')
            else:
                own = _image(item) if isinstance(item, Raster) else _part(item, number)
                parts.append("    " + own)
        parts.append("  </g>\n")
    parts.append("</svg>\n")
    return "".join(parts)


class Numbers:
    """A format for numbers: a fixed number of decimals, without zeros at the end."""

    def __init__(self, decimals: int) -> None:
        self.decimals = decimals

    def __call__(self, value: float) -> str:
        text = f"{value:.{self.decimals}f}"
        text = text.rstrip("0").rstrip(".") if self.decimals else text
        return "0" if text in ("-0", "") else text


def path_data(curve: Curve, number: Numbers | None = None) -> str:
    """Return the d attribute of a path, in absolute coordinates.

    >>> path_data(Curve.polyline([[0, 0], [2, 0], [2, 1.5]], closed=True))
    'M0,0L2,0 2,1.5Z'
    """
    number = number or Numbers(3)
    (x, y), last = curve.start.tolist(), len(curve.pieces) - 1
    parts, before = [f"M{number(x)},{number(y)}"], ""
    for k, (piece, straight) in enumerate(
        zip(curve.pieces.tolist(), curve.straight.tolist(), strict=True)
    ):
        if straight and curve.closed and k == last:
            break  # Z draws it
        command = "L" if straight else "C"
        points = piece[3:] if straight else piece[1:]
        parts.append(" " if command == before else command)
        parts.append(" ".join(f"{number(x)},{number(y)}" for x, y in points))
        before = command
    return "".join(parts) + ("Z" if curve.closed else "")


def _definitions(scene: Scene, number: Numbers) -> str:
    parts = []
    for name, curve in scene.symbols.items():
        parts.append(f'    <path id="{name}" d="{path_data(curve, number)}"/>\n')
    for name, motif in scene.motifs.items():
        parts.append(_motif(name, motif, number))
    if any(layer.clipped for layer in scene.layers):
        box = scene.clip
        x, y, width, height = map(number, (box.left, box.top, box.width, box.height))
        window = f'<rect x="{x}" y="{y}" width="{width}" height="{height}"/>'
        parts.append(f'    <clipPath id="window">{window}</clipPath>\n')
    return "  <defs>\n" + "".join(parts) + "  </defs>\n" if parts else ""


def _motif(name: str, motif: Motif, number: Numbers) -> str:
    """Return a group that is drawn once and used by every copy."""
    parts, clip = [], ""
    if motif.within is not None:
        clip = f' clip-path="url(#within-{name})"'
        parts.append(
            f'    <clipPath id="within-{name}"><use xlink:href="#{motif.within}"/></clipPath>\n'
        )
    parts.append(f'    <g id="{name}"{clip}>\n')
    parts += ["      " + _image(raster) for raster in motif.rasters]
    parts += ["      " + _part(part, number) for part in motif.parts]
    return "".join(parts) + "    </g>\n"


def _image(raster: Raster) -> str:
    values = [*raster.linear.T.ravel().tolist(), *raster.offset.tolist()]
    place = ",".join(f"{value:.9g}" for value in values)
    data = base64.b64encode(raster.png).decode("ascii")
    width, height = raster.size
    return (
        f'<image width="{width}" height="{height}" transform="matrix({place})" '
        f'preserveAspectRatio="none" xlink:href="data:image/png;base64,{data}"/>\n'
    )


def _part(part: Part, number: Numbers) -> str:
    path = "".join(path_data(curve, number) for curve in part.curves)
    opacity = f' opacity="{part.opacity:.3g}"' if part.opacity < 1 else ""
    return f'<path{_style_attributes(part.style)}{opacity} d="{path}"/>\n'


def _layer_start(layer: Layer) -> str:
    name = quoteattr(layer.name)
    key = quoteattr(layer.name.replace(" ", "-"))
    clip = ' clip-path="url(#window)"' if layer.clipped else ""
    ink = f' color="{layer.ink}"' if layer.ink else ""
    return (
        f'  <g id={key} inkscape:groupmode="layer" inkscape:label={name}'
        f"{clip}{ink}{_style_attributes(layer.style)}>\n"
    )


def _style_attributes(style: Style) -> str:
    """Return fill and stroke as attributes, with a space before each."""
    text = f' fill="{style.fill or "none"}"'
    if style.stroke is None:
        return text + ' stroke="none"'
    width = Numbers(4)(style.width)
    return text + f' stroke="{style.stroke}" stroke-width="{width}" stroke-linejoin="round"'


def _uses(uses: Uses, reach: float, number: Numbers) -> Iterator[str]:
    """Yield a line for each copy, its matrix as exact as keeps the symbol's far end in its place."""
    fine = Numbers(number.decimals + max(1, math.ceil(math.log10(max(reach, 1.0)))))
    # columns first, as SVG has them
    matrices = [",".join(fine(value) for value in linear.T.ravel()) for linear in uses.linear]
    still = [bool(np.abs(linear - np.eye(2)).max() < 1e-12) for linear in uses.linear]
    for which, (x, y) in zip(uses.which.tolist(), uses.offsets.tolist(), strict=True):
        place = f"{number(x)},{number(y)}"
        how = f"translate({place})" if still[which] else f"matrix({matrices[which]},{place})"
        yield f'    <use xlink:href="#{uses.symbol}" transform="{how}"/>\n'


TILE_WIDTH, TILING_WIDTH = 100.0, 300.0
"""Widths of the pages of `tile_svg` and `tiling_svg` in mm."""


def tile_svg(tile: Tile, *, y_down: bool = False, title: str = "") -> str:
    """Return the SVG of one tile, on a page with a small margin; arguments as for `tiling_svg`."""
    colours = palette(DEFAULT_PALETTE)
    low, high = tile.polygon.min(axis=0), tile.polygon.max(axis=0)
    margin = 0.04 * float((high - low).max())
    page = _Page((*(low - margin), *(high + margin)), TILE_WIDTH, y_down)
    style = Style(colours.fill(1), colours.outline, 0.3)
    layer = Layer("tile", "tiles", style, (page.curve(tile.polygon),))
    return page.document([layer], title or _name(tile), "A tile of the plane, made with orbiflow")


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
    chosen, tiling = palette(DEFAULT_PALETTE), as_tiling(tile)
    colours = colours or colouring(tiling)
    page = _Page(window or default_window(tile), TILING_WIDTH, y_down)
    groups: list[list[Curve]] = [[] for _ in range(colours.count)]
    for element in patch(tiling, page.window):
        polygon = tiling.prototiles[element.prototile].polygon
        groups[colours.colour(element)].append(page.curve(element(polygon)))
    border = rectangle(Box(0.0, 0.0, page.width, page.height))
    layers = [Layer("paper", "paper", Style(chosen.paper), (border,))]
    for number, curves in enumerate(groups):
        style = Style(chosen.fill(number), chosen.outline, 0.25)
        layers.append(Layer(f"colour {number + 1}", "tiles", style, tuple(curves), clipped=True))
    what = "An isohedral tiling" if len(tiling.prototiles) == 1 else "A tiling"
    note = (
        f"{what} of the plane ({_name(tile)}), made with orbiflow. "
        "Each path is one tile; groups collect the tiles of one colour."
    )
    return page.document(layers, title or f"Tiling {_name(tile)}", note)


class _Page:
    """A window of a tile's coordinates on a page in millimetres, with y pointing down."""

    def __init__(self, window: Sequence[float], width_mm: float, y_down: bool) -> None:
        xmin, ymin, xmax, ymax = self.window = checked_window(window)
        self.width, self.height = width_mm, width_mm * (ymax - ymin) / (xmax - xmin)
        self._origin = np.array([xmin, ymin if y_down else ymax])
        self._scale = np.array([1.0, 1.0 if y_down else -1.0]) * (width_mm / (xmax - xmin))

    def curve(self, ring: Array) -> Curve:
        return Curve.polyline((ring - self._origin) * self._scale, closed=True)

    def document(self, layers: list[Layer], title: str, note: str) -> str:
        scene = Scene(self.width, self.height, tuple(layers), title=title, notes=(note,))
        return write_svg(scene, decimals=4)


def _name(tile: Tiles) -> str:
    kind = tile.isohedral_class if isinstance(tile, Tile) else ""
    return " ".join(part for part in (kind, tile.group.name) if part) or "tile"
