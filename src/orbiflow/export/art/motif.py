"""What is drawn on a tile in curves, as pixels of the tile's raster."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from orbiflow.export.art.paint import Grid, Paint
from orbiflow.export.drawing import curves_path
from orbiflow.export.scene import INK, Motif, Part
from orbiflow.symmetry.isometry import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DOTS = 100


def paint_motif(paint: Paint, motif: Motif) -> None:
    """Draw it, antialiased, on what is there."""
    grid = paint.grid
    placed = motif.moved(grid.density * np.eye(2), -grid.density * grid.corner)
    for inked, parts in groupby(placed.parts, key=lambda part: part.inked):
        canvas = _canvas(list(parts), grid)
        alpha = canvas[..., 3]
        if inked:
            paint.ink(alpha)
        else:
            paint.lay(canvas[..., :3] * alpha[..., None], alpha)


def _canvas(parts: list[Part], grid: Grid) -> Array:
    """(height, width, 4) RGBA, straight, 0 to 1."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import PathCollection

    figure, axes = _axes(grid)
    for part in parts:
        fill, stroke = (
            "#000000" if colour == INK else colour
            for colour in (part.style.fill, part.style.stroke)
        )
        collection = PathCollection(
            [curves_path(part.curves)],
            facecolors=fill or "none",
            edgecolors=stroke or "none",
            linewidths=part.style.width * 72 / DOTS if stroke else 0,
            alpha=part.opacity if part.opacity < 1 else None,
            joinstyle="round",
            capstyle="round",
        )
        axes.add_collection(collection, autolim=False)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba(), dtype=np.float32) / 255


def _axes(grid: Grid) -> tuple[Figure, Axes]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(grid.width / DOTS, grid.height / DOTS), dpi=DOTS)
    figure.patch.set_alpha(0)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_xlim(0, grid.width)
    axes.set_ylim(grid.height, 0)
    return figure, axes
