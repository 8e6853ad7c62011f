"""What a `Raster` shows as curves, for print."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from orbiflow.figures.raster import Filled, Raster
from orbiflow.figures.sheet import Picture, Sheet
from orbiflow.symmetry.isometry import Array

if TYPE_CHECKING:
    from matplotlib.path import Path

LEAST = 0.25
"""Width in points below which lines fade in print."""


def vector_picture(raster: Raster, sheet: Sheet, *, title: str, caption: str) -> Picture:
    """The picture as wide as the sheet; lines as wide in proportion.

    Args:
        raster: without a strip: its words would be as small as the sheet is narrow, and the caption
            has them.
    """
    from matplotlib.collections import LineCollection, PathCollection

    figure = sheet.figure(sheet.width * raster.height / raster.width, raster.paper)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_xlim(0, raster.width)
    axes.set_ylim(raster.height, 0)
    point = 72 * sheet.width / raster.width
    for order, shape in enumerate(raster.shapes):
        colour = raster.colours[shape.colour]
        if isinstance(shape, Filled):
            path = _path([shape.points, *shape.holes])
            # a hairline of its own colour: else the paper shows where two fills meet
            made = PathCollection(
                [path], facecolors=colour, edgecolors=colour, linewidths=0.1, joinstyle="round"
            )
        else:
            width = max(point * shape.width, LEAST)
            made = LineCollection(
                [shape.points], colors=colour, linewidths=width, capstyle="round",
                joinstyle="round",
            )  # fmt: skip
        made.set_zorder(order)
        axes.add_collection(made, autolim=False)
    return Picture(figure, sheet, title, caption)


def _path(rings: list[Array]) -> Path:
    from matplotlib.path import Path

    parts = [Path(np.concatenate([ring, ring[:1]]), closed=True) for ring in rings]
    return Path.make_compound_path(*parts)
