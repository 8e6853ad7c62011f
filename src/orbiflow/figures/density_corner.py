"""Data and samples of angles on a torus of any dimension: every pair against each other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from orbiflow.density.models.symmetric import SymmetricDensity
from orbiflow.errors import OrbiflowError
from orbiflow.figures.canvas import blank_figure, png_bytes
from orbiflow.figures.density_axes import INK, View, angle_axis, font, view_of
from orbiflow.figures.density_square import MAX_DOTS, draw_dots
from orbiflow.figures.density_values import density_at
from orbiflow.symmetry.isometry import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_COLUMNS = 8
_DATA, _DRAWN = "#d95f02", "#3b528b"
_BINS = 36


def corner_png(
    density: SymmetricDensity,
    data: Tensor | None,
    drawn: Tensor,
    *,
    names: Sequence[str] | None = None,
    center: Sequence[float] | None = None,
    width_px: int = 1600,
) -> bytes:
    """PNG of every pair of angles: data below the diagonal, samples above, both along it.

    Of a single angle, the histograms and the density as a line.

    Args:
        density: on a torus of 1 to `MOST_COLUMNS` angles.
        data, drawn: chart points (N, d), (M, d); at most `MAX_DOTS` of each are drawn as dots, all
            are counted on the diagonal. Without data the samples are below the diagonal, too.
        names, center: of the axes; see `orbiflow.figures.density_axes.view_of`.
        width_px: the height is the same.

    Raises:
        OrbiflowError: for another space or more angles, points of another shape, names or a centre
            that do not fit, or a size that cannot be made.
    """
    space = density.space
    if not space.is_torus or space.dim > MOST_COLUMNS:
        raise OrbiflowError(f"pairs are drawn of 1 to {MOST_COLUMNS} angles, not of {space!r}")
    view, dim = view_of(space, names, center), space.dim
    above = view.places(drawn)
    below = above if data is None else view.places(data)
    figure = blank_figure(width_px, width_px)
    size = font(figure) * (1.0 if dim <= 4 else 0.7)
    side, shrink = 0.84 / dim, min(1.0, 3 / dim)
    for row in range(dim):
        for column in range(dim):
            box = (0.11 + column * side, 0.09 + (dim - 1 - row) * side, 0.93 * side, 0.93 * side)
            axes = figure.add_axes(box)
            if row == column:
                _counts(axes, above[:, row], None if data is None else below[:, row])
            else:
                points, colour = (below, _DATA) if row > column else (above, _DRAWN)
                fill = _DRAWN if data is None else colour
                draw_dots(axes, points[:, [column, row]], 0.4, fill=fill, rim="none", shrink=shrink)
            _label(axes, view, row, column, size)
            if dim == 1:
                t = torch.linspace(0, 1, 721, dtype=torch.float64)
                line = density_at(density, view.to_chart(t[:, None]), "square")
                axes.plot(t.numpy(), line, color=INK, linewidth=1.6)
    _heads(figure, dim, None if data is None else len(below), len(above))
    return png_bytes(figure)


def _counts(axes: Axes, drawn: Array, data: Array | None) -> None:
    """Histograms over the same bins, each of area 1."""
    bins = np.linspace(0, 1, _BINS + 1).tolist()
    if data is not None:
        axes.hist(data, bins=bins, density=True, color=_DATA, alpha=0.35)
    axes.hist(drawn, bins=bins, density=True, histtype="step", color=_DRAWN, linewidth=1.3)


def _heads(figure: Figure, dim: int, data: int | None, drawn: int) -> None:
    """How many points there are, in their colours."""

    def shown(count: int, what: str) -> str:
        few = f"{MAX_DOTS} of " if count > MAX_DOTS and dim > 1 else ""
        return f"{few}{count} {what}"

    below, above = (" below the diagonal", " above") if dim > 1 else ("", "")
    heads = [] if data is None else [(shown(data, f"data{below}"), _DATA)]
    heads.append((shown(drawn, f"samples{above if heads else ''}"), _DRAWN))
    if dim == 1:
        heads.append(("density", INK))
    for k, (text, colour) in enumerate(heads):
        figure.text(
            0.11 + (0.45 if dim > 1 else 0.3) * k,
            0.95,
            text,
            fontsize=1.05 * font(figure),
            color=colour,
        )


def _label(axes: Axes, view: View, row: int, column: int, size: float) -> None:
    """Ticks of quarter turns, with texts along the left and the lower rim."""
    dim = view.space.dim
    axes.set_facecolor("#f4f4f1")
    for spine in axes.spines.values():
        spine.set_color("#c8c8c4")
    axes.tick_params(labelsize=0.75 * size, length=0.25 * size, color="#8a8a86")
    label, at, texts = angle_axis(view, column)
    axes.set_xlim(0, 1)
    axes.set_xticks(at, _thin(at, texts, dim, row == dim - 1, column == dim - 1))
    if row == dim - 1:
        axes.set_xlabel(label, fontsize=0.95 * size, color=INK, parse_math=False)
    if row == column:
        axes.set_yticks([])
        return
    label, at, texts = angle_axis(view, row)
    axes.set_ylim(0, 1)
    axes.set_yticks(at, _thin(at, texts, dim, column == 0, row == 1))
    if column == 0:
        axes.set_ylabel(label, fontsize=0.95 * size, color=INK, parse_math=False)


def _thin(at: list[float], texts: list[str], dim: int, wanted: bool, last: bool) -> list[str]:
    """Texts of ticks without those that would touch others, in this panel or the next."""
    return [
        text if wanted and (last or place < 0.9) and (dim < 4 or k % 2 == 0) else ""
        for k, (place, text) in enumerate(zip(at, texts, strict=True))
    ]
