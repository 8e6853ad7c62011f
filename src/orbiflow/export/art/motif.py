"""What is drawn on a tile in curves: a list of parts, from the bottom up, in the tile's units."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import groupby
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from orbiflow.export.art.paint import Grid, Paint
from orbiflow.export.curves import Curve
from orbiflow.export.drawing import curves_path
from orbiflow.export.scene import INK, Style
from orbiflow.symmetry.isometry import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DOTS = 100


class Part(NamedTuple):
    """Curves drawn as one.

    - `curves`: closed ones are filled, holes run the other way.
    - `style`: fill and stroke; `INK` is a colour that shows on the tile's own. Widths are in the
      tile's units.
    - `opacity`: 0 to 1.
    """

    curves: tuple[Curve, ...]
    style: Style
    opacity: float = 1.0

    @property
    def inked(self) -> bool:
        return INK in (self.style.fill, self.style.stroke)

    def moved(self, linear: Array, offset: Array) -> Part:
        """Under a map p -> linear p + offset."""
        scale = float(np.sqrt(abs(np.linalg.det(linear))))
        return Part(
            tuple(curve.moved(linear, offset) for curve in self.curves),
            self.style._replace(width=self.style.width * scale),
            self.opacity,
        )


@dataclass(frozen=True, eq=False)
class Motif:
    """Parts from the bottom up."""

    parts: tuple[Part, ...] = ()

    def moved(self, linear: Array, offset: Array) -> Motif:
        """As `Part.moved`."""
        return replace(self, parts=tuple(part.moved(linear, offset) for part in self.parts))


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
