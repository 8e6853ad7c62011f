"""A picture of isohedral classes, computed from their table and groups; nothing is placed by hand."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from orbiflow.arrays import Array, Window
from orbiflow.drawing import (
    CENTER_COLOURS,
    LINE_COLOUR,
    Sheet,
    cell_ring,
    center_sign,
    fill_rings,
    mark_symmetry,
    outline_cell,
    plane_axes,
)
from orbiflow.symmetry import identity
from orbiflow.tiles.tilings import CLASSES, EdgeClass, IsohedralClass, Tile, aspects, patch

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

EDGE_COLOURS = ("#1d4e79", "#d98a2b", "#2a9d8f", "#b0413e", "#6b4c9a")
ASPECT_FILLS = ("#f4ecdc", "#c9dcec", "#f2cfa5", "#cfe3d4", "#e3d3ea", "#f5d5cf")
_KEY_HEIGHT = 0.0369  # of the key to the marks, over the width
_PANEL = (0.30, 0.68)  # shares of a panel's width for the template and for the tiling


def classes_png(
    kinds: Sequence[IsohedralClass] = tuple(CLASSES.values()), *, width_px: int = 2400
) -> bytes:
    """Return a PNG of classes, by default the nine (paper, figures of templates and symmetries).

    On the left of each panel is the template: edges that are images of each other have one colour and
    arrows that the group maps onto each other; an arrow with one barb belongs to a reflection. Straight
    edges are hollow, and those with a mirror across have a bar. On the right is the tiling: a fill for
    each aspect, the lattice cell, rotation centres, mirrors and glide lines.

    Raises:
        OrbiflowError: If the picture would be too large or too small.
    """
    columns = min(3, len(kinds)) if len(kinds) <= 12 else 6
    rows = -(-len(kinds) // columns)
    sheet = Sheet.screen(width_px)
    panel = 0.783 / columns  # height over the picture's width
    height = panel * rows + _KEY_HEIGHT
    figure = sheet.figure(round(width_px * height) / sheet.dpi)
    for number, kind in enumerate(kinds):
        row, column = divmod(number, columns)
        corner = column / columns, 1 - panel * (row + 1) / height
        _class_panel(figure, kind, corner, (1 / columns, panel / height))
    mirrors = any(edge_class.straight for kind in kinds for edge_class in kind.edge_classes)
    mirrors |= any(len(kind.stabiliser) > 1 and kind.has_reflections for kind in kinds)
    draw_key(figure, _KEY_HEIGHT / height, mirrors=mirrors)
    return sheet.file(figure)


def _class_panel(
    figure: Figure, kind: IsohedralClass, corner: tuple[float, float], size: tuple[float, float]
) -> None:
    (left, bottom), (width, height) = corner, size
    font = 3 * width * figure.get_figwidth()
    figure.text(
        left + 0.045 * width, bottom + 0.86 * height, kind.name, fontsize=1.5 * font, weight="bold"
    )
    what = (
        kind.group_name
        if len(kind.stabiliser) == 1
        else f"{kind.group_name}, {kind.stabiliser_name}"
    )
    figure.text(left + 0.045 * width, bottom + 0.77 * height, what, fontsize=1.2 * font)
    middle = (kind.template().min(axis=0) + kind.template().max(axis=0)) / 2
    box = (left + 0.02 * width, bottom, _PANEL[0] * width, 0.8 * height)
    reach = max(1.42, 0.55 * float(np.ptp(kind.template(), axis=0).max()))
    draw_template(plane_axes(figure, _around(middle, reach, reach), box=box), kind)
    box = (left + 0.33 * width, bottom + 0.04 * height, _PANEL[1] * width * 0.96, 0.92 * height)
    aspect = box[2] * figure.get_figwidth() / (box[3] * figure.get_figheight())
    middle = (middle + cell_ring(kind.group(), middle)[:4].mean(axis=0)) / 2
    window = _around(middle, 4.25 * aspect, 4.25)
    draw_tiling(plane_axes(figure, window, box=box), kind, window)


def _around(middle: Array, half_width: float, half_height: float) -> Window:
    (x, y), w, h = middle.tolist(), half_width, half_height
    return x - w, y - h, x + w, y + h


def draw_template(axes: Axes, kind: IsohedralClass) -> None:
    """Draw a class's template: identified edges in one colour, with the arrows that are identified."""
    vertices = kind.template()
    fill_rings(axes, [vertices], ASPECT_FILLS[0], "none", 0)
    for edge_class, colour in zip(kind.edge_classes, EDGE_COLOURS, strict=False):
        marks = [] if edge_class.straight else [_arrow(kind, edge_class)]
        if edge_class.turn and not edge_class.straight and edge_class.turn.isometry.determinant > 0:
            marks.append(edge_class.turn.isometry(marks[0]))
        for edge in edge_class.edges:
            ends = vertices[[edge, (edge + 1) % len(vertices)]]
            axes.plot(*ends.T, color=colour, linewidth=2.2, solid_capstyle="round")
            if edge_class.straight:
                axes.plot(*ends.T, color="#ffffff", linewidth=0.8, zorder=3)
            elif len(marks) > 1:
                sign = ends.mean(axis=0) + center_sign(2, 0.09)
                axes.fill(*sign.T, facecolor=colour, edgecolor="#ffffff", linewidth=0.8, zorder=4)
        for element in (identity(2), *(image.isometry for image in edge_class.images)):
            for ring in map(element, marks):
                axes.fill(*ring.T, facecolor=colour, edgecolor=colour, linewidth=0.5, zorder=3)
    axes.plot(*vertices.T, "o", color="#1a1a1a", markersize=3, zorder=5)


def _arrow(kind: IsohedralClass, edge_class: EdgeClass) -> Array:
    """Return an arrowhead on a class's first edge: in its middle, or further on for a half-turn.

    Of an edge with a mirror across it is a bar.
    """
    vertices = kind.template()
    start, end = vertices[edge_class.edge], vertices[(edge_class.edge + 1) % len(vertices)]
    along = (end - start) / np.linalg.norm(end - start)
    inward = np.array([-along[1], along[0]])  # templates are counter-clockwise
    if edge_class.turn and edge_class.turn.isometry.determinant < 0:
        middle, bar = (start + end) / 2, np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        return middle + bar * (0.025, 0.12) @ np.stack([along, inward])
    share = 0.8 if edge_class.turn else 0.5
    tip = start + share * (end - start) + 0.12 * along
    back = tip - 0.26 * along
    one_barb = any(image.isometry.determinant < 0 for image in edge_class.images)
    other = back if one_barb else back - 0.11 * inward
    return np.stack([tip, back + (0.17 if one_barb else 0.11) * inward, other])


def draw_tiling(axes: Axes, kind: IsohedralClass, window: Window) -> None:
    """Draw the template's tiling: a fill for each aspect, the lattice cell, all centres and lines."""
    tile = Tile(kind.template(), kind.group(), kind.name)
    elements = patch(tile, window)
    for element, aspect in zip(elements, aspects(tile, elements), strict=True):
        fill_rings(
            axes, [element(tile.polygon)], ASPECT_FILLS[aspect % len(ASPECT_FILLS)], "#7a7a7a", 0.6
        )
    fill_rings(axes, [tile.polygon], "none", "#1a1a1a", 1.6)
    outline_cell(axes, kind.group(), tile.center)
    mark_symmetry(axes, kind.group(), window, size=0.18)


def draw_key(figure: Figure, height: float = 0.045, *, mirrors: bool = False) -> None:
    """Draw what the marks of symmetry mean, in a strip at the bottom of a figure of this share."""
    aspect = figure.get_figwidth() / (figure.get_figheight() * height)
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
    if mirrors:
        axes.plot([x + 9, x + 10.2], [0.5, 0.5], color=LINE_COLOUR, linewidth=1.4)
        axes.text(x + 10.5, 0.5, "mirror", va="center", fontsize=font)
