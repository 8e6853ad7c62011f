"""Pictures of data and samples on a torus of any dimension: every pair of angles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models import Density
from orbiflow.density.pictures.axes import (
    INK,
    LETTER,
    View,
    angle_axis,
    legible,
    shortened,
    space_title,
    view_of,
)
from orbiflow.density.pictures.colours import density_at
from orbiflow.density.pictures.overlays import MAX_DOTS, draw_dots
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.drawing import Picture, Sheet
from orbiflow.errors import OrbiflowError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MAX_COLUMNS = 8
_DATA, _SAMPLES = "#d95f02", "#3b528b"
_BINS = 36
_SCREEN = (6.67, 5.46, 3.03, 4.24)
"""Room at the left, below, at the right and above, in ems."""

_MIN_SIDE = 0.5
"""Inches of the smallest printed panel."""


def corner_picture(
    density: Density,
    data: Tensor | None,
    samples: Tensor,
    settings: PlotSettings | None = None,
    *,
    sheet: Sheet | None = None,
) -> Picture:
    """Draw every pair of angles: data below the diagonal, samples above, histograms on it.

    A single angle has its histograms and the density as a line.

    Args:
        density: A density on a torus of 1 to `MAX_COLUMNS` angles.
        data: Chart points (N, d). Without data the samples are below the diagonal, too.
        samples: Chart points (M, d). Of too many points some are drawn as dots, all are counted in
            the histograms.
        settings: How it is drawn.
        sheet: The sheet. Default: that of the settings.

    Raises:
        OrbiflowError: If the space is another one or has more angles, points have another shape,
            names or a centre do not fit, or a printed sheet is too narrow for so many angles.
    """
    settings, space = settings or PlotSettings(), density.space
    sheet, most = sheet or settings.sheet, settings.samples or MAX_DOTS
    if not space.is_torus or space.dim > MAX_COLUMNS:
        raise OrbiflowError(f"pairs are drawn of 1 to {MAX_COLUMNS} angles, not of {space!r}")
    view, dim = view_of(space, settings.names, settings.center), space.dim
    above = view.places(samples)
    below = above if data is None else view.places(data)
    grid = _grid(sheet, dim)
    for row, column in np.ndindex(dim, dim):
        axes = grid.panel(row, column)
        if row == column:
            _draw_histograms(axes, sheet, above[:, row], None if data is None else below[:, row])
        else:
            points = below if row > column else above
            colour = _DATA if row > column and data is not None else _SAMPLES
            draw_dots(
                axes, points[:, [column, row]], 0.4, limit=most, fill=colour,
                scale=grid.dot_scale, rasterized=dim > 3,
            )  # fmt: skip
        _draw_ticks(axes, view, row, column, grid)
        if dim == 1:
            t = torch.linspace(0, 1, 721, dtype=torch.float64)
            line = density_at(density, view.to_chart(t[:, None]), "square")
            axes.plot(t.numpy(), line, color=INK, linewidth=sheet.pen(1.6, 0.6))
    counts = None if data is None else len(below), len(above)
    _write_heads(grid, dim, *counts, most)
    title = f"{'Angles' if dim > 1 else 'Angle'} on the {space_title(space)}"
    return Picture(grid.figure, sheet, title, _caption(view, *counts, most))


class _Grid(NamedTuple):
    """A square of panels of `side` inches, gaps included, at (`left`, `below`) inches in a figure."""

    figure: Figure
    sheet: Sheet
    dim: int
    side: float
    left: float
    below: float

    def panel(self, row: int, column: int) -> Axes:
        """Make the axes of a panel."""
        x = self.left + column * self.side
        y = self.below + (self.dim - 1 - row) * self.side
        width, height = self.figure.get_size_inches()
        inner = 0.93 * self.side
        return self.figure.add_axes((x / width, y / height, inner / width, inner / height))

    @property
    def dot_scale(self) -> float:
        """The factor of the dots' area."""
        if not self.sheet.printed:
            return min(1.0, 3 / self.dim)
        return max(0.08, (self.side / 5.6) ** 2)

    @property
    def text(self) -> float:
        """Size of the labels' letters, in points."""
        return self.sheet.text * (0.95 if self.sheet.printed or self.dim <= 4 else 0.67)

    @property
    def small(self) -> float:
        """Size of the ticks' letters, in points."""
        return self.sheet.small if self.sheet.printed else 0.79 * self.text


def _grid(sheet: Sheet, dim: int) -> _Grid:
    """Make a figure with room for the panels."""
    left, below, right, above = (5.2, 4.0, 1.2, 2.2) if sheet.printed else _SCREEN
    side = (sheet.width - sheet.em * (left + right)) / dim
    if sheet.printed and side < _MIN_SIDE:
        least = 25.4 * (dim * _MIN_SIDE + sheet.em * (left + right))
        raise OrbiflowError(
            f"pairs of {dim} angles need a figure at least {least:.0f} mm wide, got "
            f"{25.4 * sheet.width:.0f} mm"
        )
    figure = sheet.figure(dim * side + sheet.em * (below + above))
    return _Grid(figure, sheet, dim, side, sheet.em * left, sheet.em * below)


def _draw_histograms(axes: Axes, sheet: Sheet, samples: Array, data: Array | None) -> None:
    """Draw histograms over the same bins, each of area 1."""
    bins = np.linspace(0, 1, _BINS + 1).tolist()
    if data is not None:
        axes.hist(data, bins=bins, density=True, color=_DATA, alpha=0.35)
    thin = sheet.pen(1.3, 0.6)
    axes.hist(samples, bins=bins, density=True, histtype="step", color=_SAMPLES, linewidth=thin)


def _write_heads(grid: _Grid, dim: int, data: int | None, samples: int, most: int) -> None:
    """Write what is drawn in its colour, with its number; in print the caption has the numbers."""

    def shown(count: int, what: str) -> str:
        few = f"{most} of " if count > most and dim > 1 else ""
        return what if grid.sheet.printed else f"{few}{count} {what}"

    diagonal = "" if grid.sheet.printed else " the diagonal"
    below, above = (f" below{diagonal}", " above") if dim > 1 else ("", "")
    heads = [] if data is None else [(shown(data, f"data{below}"), _DATA)]
    heads.append((shown(samples, f"samples{above if heads else ''}"), _SAMPLES))
    if dim == 1:
        heads.append(("density", INK))
    width, height = grid.figure.get_size_inches()
    y = (grid.below + dim * grid.side + 0.6 * grid.sheet.em) / height
    size = grid.sheet.text * (1.0 if grid.sheet.printed else 1.05)
    reach = dim * grid.side / width
    widths = [(len(text) + 1.5) * LETTER * size / 72 / width for text, _ in heads]
    step = max(reach * (0.53 if dim > 1 else 0.36), max(widths[:-1], default=0.0))
    x = grid.left / width
    if x + step * (len(heads) - 1) + widths[-1] > 1:  # a narrow figure
        x, step = 0.4 * grid.sheet.em / width, 0.0
    for (text, colour), own in zip(heads, widths, strict=True):
        grid.figure.text(x, y, text, fontsize=size, color=colour)
        x += step or own


def _caption(view: View, data: int | None, samples: int, most: int) -> str:
    counts = [(data, "data")] if data is not None else []
    counts.append((samples, "samples"))
    text = " and ".join(f"{count} {what}" for count, what in counts)
    few = f", at most {most} of each as dots" if view.space.dim > 1 else ""
    return f"{text}{few}. Angles in {view.space.unit}."


def _draw_ticks(axes: Axes, view: View, row: int, column: int, grid: _Grid) -> None:
    """Draw ticks of quarter turns, with texts along the left and the lower rim."""
    dim, size = view.space.dim, grid.text
    style: dict[str, Any] = {"fontsize": size, "color": INK, "parse_math": False}
    axes.set_facecolor("#f4f4f1")
    for spine in axes.spines.values():
        spine.set_color("#c8c8c4")
        spine.set_linewidth(grid.sheet.pen(0.8))
    axes.tick_params(
        labelsize=grid.small, length=0.25 * size, width=grid.sheet.pen(0.8), pad=0.3 * size,
        color="#8a8a86",
    )  # fmt: skip
    label, at, texts = angle_axis(view, column)
    axes.set_xlim(0, 1)
    axes.set_xticks(at, _legible_texts(at, texts, grid, row == dim - 1, column == dim - 1))
    if row == dim - 1:
        axes.set_xlabel(shortened(label, grid.side, grid.sheet), **style)
    if row == column:
        axes.set_yticks([])
        return
    label, at, texts = angle_axis(view, row)
    axes.set_ylim(0, 1)
    axes.set_yticks(at, _legible_texts(at, texts, grid, column == 0, row == 1, upward=True))
    if column == 0:
        axes.set_ylabel(shortened(label, grid.side, grid.sheet), **style)


def _legible_texts(
    at: list[float],
    texts: list[str],
    grid: _Grid,
    wanted: bool,
    last: bool,
    *,
    upward: bool = False,
) -> list[str]:
    """Return texts of ticks without those that would touch others, in this panel or the next."""
    if not wanted:
        return [""] * len(at)
    if grid.sheet.printed and not upward:
        texts = legible(at, texts, grid.side, grid.sheet)
    return [
        text if (last or place < 0.9) and (grid.dim < 4 or k % 2 == 0) else ""
        for k, (place, text) in enumerate(zip(at, texts, strict=True))
    ]
