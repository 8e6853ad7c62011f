"""A picture of the nine isohedral classes: identified edges, tiling and symmetries.

Everything is computed from the table of classes and their groups; nothing is placed by hand.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from orbiflow.arrays import Array, Window
from orbiflow.drawing import (
    CENTER_COLOURS,
    LINE_COLOUR,
    blank_figure,
    cell_ring,
    center_sign,
    fill_rings,
    mark_symmetry,
    outline_cell,
    plane_axes,
    png_bytes,
)
from orbiflow.tiles.tilings import CLASSES, EdgeIdentification, IsohedralClass, Tile, aspects, patch

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

EDGE_COLOURS = ("#1d4e79", "#d98a2b", "#2a9d8f", "#b0413e", "#6b4c9a")
ASPECT_FILLS = ("#f4ecdc", "#c9dcec", "#f2cfa5", "#cfe3d4", "#e3d3ea", "#f5d5cf")
_PANEL = (0.30, 0.68)  # shares of a panel's width for the template and for the tiling


def classes_png(*, width_px: int = 2400) -> bytes:
    """Return a PNG of the nine classes, three by three (paper, figures of templates and symmetries).

    On the left of each panel is the template: identified edges have one colour and arrows that the
    group maps onto each other; an arrow with one barb belongs to a glide reflection. On the right is
    the tiling: a fill for each aspect, the lattice cell, rotation centres and glide lines.

    Raises:
        OrbiflowError: If the picture would be too large or too small.
    """
    height = round(width_px * 0.82)
    figure = blank_figure(width_px, height)
    for number, kind in enumerate(CLASSES.values()):
        row, column = divmod(number, 3)
        _panel(figure, kind, (column / 3, 0.045 + 0.955 * (1 - (row + 1) / 3)), (1 / 3, 0.955 / 3))
    _key(figure, width_px)
    return png_bytes(figure)


def _panel(
    figure: Figure, kind: IsohedralClass, corner: tuple[float, float], size: tuple[float, float]
) -> None:
    (left, bottom), (width, height) = corner, size
    font = figure.get_figwidth()
    figure.text(
        left + 0.045 * width, bottom + 0.86 * height, kind.name, fontsize=1.5 * font, weight="bold"
    )
    figure.text(left + 0.045 * width, bottom + 0.77 * height, kind.group_name, fontsize=1.2 * font)
    middle = (kind.template().min(axis=0) + kind.template().max(axis=0)) / 2
    box = (left + 0.02 * width, bottom, _PANEL[0] * width, 0.8 * height)
    draw_template(plane_axes(figure, _around(middle, 1.42, 1.42), box=box), kind)
    box = (left + 0.33 * width, bottom + 0.04 * height, _PANEL[1] * width * 0.96, 0.92 * height)
    aspect = box[2] * figure.get_figwidth() / (box[3] * figure.get_figheight())
    middle = (middle + cell_ring(kind.group(), middle)[:4].mean(axis=0)) / 2
    window = _around(middle, 4.25 * aspect, 4.25)
    draw_tiling(plane_axes(figure, window, box=box), kind, window)


def _around(middle: Array, half_width: float, half_height: float) -> Window:
    x, y = middle
    return (
        float(x - half_width),
        float(y - half_height),
        float(x + half_width),
        float(y + half_height),
    )


def draw_template(axes: Axes, kind: IsohedralClass) -> None:
    """Draw a class's template: identified edges in one colour, with the arrows that are identified."""
    vertices = kind.template()
    fill_rings(axes, [vertices], ASPECT_FILLS[0], "none", 0)
    for pair, colour in zip(kind.identified_edges, EDGE_COLOURS, strict=False):
        for edge in {pair.first, pair.second}:
            ends = vertices[[edge, (edge + 1) % len(vertices)]]
            axes.plot(*ends.T, color=colour, linewidth=2.2, solid_capstyle="round")
        element = pair.isometry
        arrow = _arrow(kind, pair)
        for ring in (arrow, element(arrow)):
            axes.fill(*ring.T, facecolor=colour, edgecolor=colour, linewidth=0.5, zorder=3)
        if pair.folded:
            middle = vertices[[pair.first, (pair.first + 1) % len(vertices)]].mean(axis=0)
            sign = middle + center_sign(2, 0.09)
            axes.fill(*sign.T, facecolor=colour, edgecolor="#ffffff", linewidth=0.8, zorder=4)
    axes.plot(*vertices.T, "o", color="#1a1a1a", markersize=3, zorder=5)


def _arrow(kind: IsohedralClass, pair: EdgeIdentification) -> Array:
    """Return an arrowhead on the first edge: in its middle, or halfway to its end for a half-turn."""
    vertices = kind.template()
    start, end = vertices[pair.first], vertices[(pair.first + 1) % len(vertices)]
    along = (end - start) / np.linalg.norm(end - start)
    inward = np.array([-along[1], along[0]])  # templates are counter-clockwise
    share = 0.8 if pair.folded else 0.5
    tip = start + share * (end - start) + 0.12 * along
    back = tip - 0.26 * along
    other = back if pair.kind == "glide" else back - 0.11 * inward
    return np.stack([tip, back + (0.17 if pair.kind == "glide" else 0.11) * inward, other])


def draw_tiling(axes: Axes, kind: IsohedralClass, window: Window) -> None:
    """Draw the template's tiling: a fill for each aspect, the lattice cell, all centres and lines."""
    tile = Tile(kind.template(), kind.group(), kind.name)
    elements = patch(tile, window)
    for element, aspect in zip(elements, aspects(tile, elements), strict=True):
        fill_rings(axes, [element(tile.polygon)], ASPECT_FILLS[aspect], "#7a7a7a", 0.6)
    fill_rings(axes, [tile.polygon], "none", "#1a1a1a", 1.6)
    outline_cell(axes, kind.group(), tile.center)
    mark_symmetry(axes, kind.group(), window, size=0.18)


def _key(figure: Figure, width_px: int) -> None:
    height = 0.045
    aspect = width_px / (figure.get_figheight() * figure.dpi * height)
    axes = plane_axes(figure, (0.0, 0.0, aspect, 1.0), box=(0.0, 0.0, 1.0, height))
    font, x = 0.95 * figure.get_figwidth(), 0.6
    for order, colour in CENTER_COLOURS.items():
        axes.fill(*(np.array([x, 0.5]) + center_sign(order, 0.24)).T, facecolor=colour)
        axes.text(x + 0.45, 0.5, f"{order}-fold centre", va="center", fontsize=font)
        x += 3.6
    axes.plot([x, x + 1.2], [0.5, 0.5], color=LINE_COLOUR, linewidth=1.4, linestyle=(0, (5, 3)))
    axes.text(x + 1.5, 0.5, "glide line", va="center", fontsize=font)
    axes.plot([x + 4.2, x + 5.4], [0.5, 0.5], color="#111111", linewidth=1.8)
    axes.text(x + 5.7, 0.5, "lattice cell", va="center", fontsize=font)
