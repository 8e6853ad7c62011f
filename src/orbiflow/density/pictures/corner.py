"""Pictures of data and samples on a torus of any dimension: every pair of angles."""

# matplotlib types no keyword arguments
# pyright: reportUnknownMemberType=false

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models import Density
from orbiflow.density.pictures import frames
from orbiflow.density.pictures.colours import density_at
from orbiflow.density.pictures.grounds import LIGHT, MAX_DOTS, draw_dots
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.drawing import Picture, Sheet
from orbiflow.errors import OrbiflowError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
        samples: Chart points (M, d). No more are drawn than there are data. Of too many points some are
            drawn as dots, as many of each, and all are counted in the histograms.
        settings: How it is drawn.
        sheet: The sheet. Default: that of the settings.

    Raises:
        OrbiflowError: If the space is another one or has more angles, points have another shape,
            names or a centre do not fit, or a printed sheet is too narrow for so many angles.
    """
    settings, space = settings or PlotSettings(), density.space
    sheet, most = sheet or settings.sheet, settings.samples or MAX_DOTS
    if not space.is_torus or space.dim > MAX_COLUMNS:
        raise OrbiflowError(
            f"pairs are drawn of 1 to {MAX_COLUMNS} angles on a torus, and other pictures in two "
            f"dimensions; this {space.name} has {space.dim}: draw columns of `orbiflow density sample`"
        )
    dim = space.dim
    panels = _Panels(sheet, frames.view_of(space, settings.names, settings.center))
    above = panels.view.places(samples)
    below = None if data is None else panels.view.places(data)
    if below is not None:  # as many of each
        above = above[: len(below)]
        most = min(most, len(above))
    for row, column in np.ndindex(dim, dim):
        axes = panels.axes(row, column)
        if row == column:
            _draw_histograms(axes, sheet, above[:, row], None if below is None else below[:, row])
        else:
            points = above if below is None or row < column else below
            draw_dots(
                axes, points[:, [column, row]], 0.4, limit=most,
                fill=_SAMPLES if points is above else _DATA, scale=panels.dot_scale,
                rasterized=dim > 3,
            )  # fmt: skip
        panels.draw_ticks(axes, row, column)
        if dim == 1:
            t = torch.linspace(0, 1, 721, dtype=torch.float64)
            line = density_at(density, panels.view.to_chart(t[:, None]), "natural")
            line = line * panels.view.volume  # as the histograms have it
            axes.plot(t.numpy(), line, color=frames.INK, linewidth=sheet.pen(1.6, 0.6))
    counts = {} if below is None else {"data": len(below)}
    counts["samples"] = len(above)
    panels.write_heads(counts, most)
    title = f"{'Angles' if dim > 1 else 'Angle'} on the {frames.space_title(space)}"
    if real := frames.real_spans(space):
        title = "Angles beside real columns" if len(real) < dim else "Real columns"
    caption = " and ".join(f"{count} {what}" for what, count in counts.items())
    caption += f", at most {most} of each as dots" if dim > 1 else ""
    unit = "" if len(real) == dim else f" Angles in {space.unit}."
    return Picture(panels.figure, sheet, title, f"{caption}.{unit}")


def _draw_histograms(axes: Axes, sheet: Sheet, samples: Array, data: Array | None) -> None:
    """Draw histograms over the same bins, each of area 1."""
    bins = np.linspace(0, 1, _BINS + 1).tolist()
    if data is not None:
        axes.hist(data, bins=bins, density=True, color=_DATA, alpha=0.35)
    thin = sheet.pen(1.3, 0.6)
    axes.hist(samples, bins=bins, density=True, histtype="step", color=_SAMPLES, linewidth=thin)


class _Panels:
    """A square of panels of `side` inches, gaps included, at (`left`, `below`) inches in a figure.

    - `dot_scale`: The factor of the dots' area.
    - `text`, `small`: Sizes of the labels' and of the ticks' letters, in points.
    """

    def __init__(self, sheet: Sheet, view: frames.View) -> None:
        self.sheet, self.view, self.dim = sheet, view, view.space.dim
        left, below, right, above = (5.2, 4.0, 1.2, 2.2) if sheet.printed else _SCREEN
        self.side = (sheet.width - sheet.em * (left + right)) / self.dim
        if sheet.printed and self.side < _MIN_SIDE:
            least = 25.4 * (self.dim * _MIN_SIDE + sheet.em * (left + right))
            raise OrbiflowError(
                f"pairs of {self.dim} angles need a figure at least {least:.0f} mm wide, got "
                f"{25.4 * sheet.width:.0f} mm"
            )
        self.figure = sheet.figure(self.dim * self.side + sheet.em * (below + above))
        self.left, self.below = sheet.em * left, sheet.em * below
        if sheet.printed:
            self.dot_scale = max(0.08, (self.side / 5.6) ** 2)
            self.text, self.small = 0.95 * sheet.text, sheet.small
        else:
            self.dot_scale = min(1.0, 3 / self.dim)
            self.text = sheet.text * (0.95 if self.dim <= 4 else 0.67)
            self.small = 0.79 * self.text

    def axes(self, row: int, column: int) -> Axes:
        """Make the axes of a panel."""
        x = self.left + column * self.side
        y = self.below + (self.dim - 1 - row) * self.side
        return frames.axes_at(self.figure, x, y, 0.93 * self.side, 0.93 * self.side)

    def write_heads(self, counts: dict[str, int], most: int) -> None:
        """Write what is drawn in its colour, with its number; in print the caption has the numbers."""
        sheet, dim = self.sheet, self.dim
        where = {"data": f" below{'' if sheet.printed else ' the diagonal'}", "samples": " above"}
        heads: list[tuple[str, str]] = []
        for what, count in counts.items():
            text = what + (where[what] if dim > 1 and "data" in counts else "")
            few = f"{most} of " if count > most and dim > 1 else ""
            colour = _DATA if what == "data" else _SAMPLES
            heads.append((text if sheet.printed else f"{few}{count} {text}", colour))
        if dim == 1:
            heads.append(("density", frames.INK))
        width, height = self.figure.get_size_inches()
        y = (self.below + dim * self.side + 0.6 * sheet.em) / height
        size = sheet.text * (1.0 if sheet.printed else 1.05)
        reach = dim * self.side / width
        widths = [(len(text) + 1.5) * frames.LETTER_EMS * size / 72 / width for text, _ in heads]
        step = max(reach * (0.53 if dim > 1 else 0.36), max(widths[:-1], default=0.0))
        x = self.left / width
        if x + step * (len(heads) - 1) + widths[-1] > 1:  # a narrow figure
            x, step = 0.4 * sheet.em / width, 0.0
        for (text, colour), width_of_text in zip(heads, widths, strict=True):
            self.figure.text(x, y, text, fontsize=size, color=colour)
            x += step or width_of_text

    def draw_ticks(self, axes: Axes, row: int, column: int) -> None:
        """Draw ticks of quarter turns, with texts along the left and the lower rim."""
        sheet, size, last = self.sheet, self.text, self.dim - 1
        style: dict[str, Any] = {"fontsize": size, "color": frames.INK, "parse_math": False}
        axes.set_facecolor(LIGHT)
        for spine in axes.spines.values():
            spine.set_color("#c8c8c4")
            spine.set_linewidth(sheet.pen(0.8))
        axes.tick_params(
            labelsize=self.small, length=0.25 * size, width=sheet.pen(0.8), pad=0.3 * size,
            color="#8a8a86",
        )  # fmt: skip
        label, at, texts = frames.angle_axis(self.view, column)
        axes.set_xlim(0, 1)
        axes.set_xticks(at, self._apart(at, texts, row == last))
        if row == last:
            axes.set_xlabel(frames.shortened(label, self.side, sheet), **style)
        if row == column:
            axes.set_yticks([])
            return
        label, at, texts = frames.angle_axis(self.view, row)
        axes.set_ylim(0, 1)
        axes.set_yticks(at, self._apart(at, texts, column == 0))
        if column == 0:
            axes.set_ylabel(frames.shortened(label, self.side, sheet), **style)

    def _apart(self, at: list[float], texts: list[str], wanted: bool) -> list[str]:
        """Return texts of ticks without those that would touch others, or those of the next panel."""
        shown = [""] * len(at)
        if not wanted:
            return shown
        inner = [k for k, place in enumerate(at) if self.dim == 1 or 0.05 < place < 0.95]
        some = [at[k] for k in inner], [texts[k] for k in inner]
        for k, text in zip(inner, frames.legible(*some, self.side, self.small), strict=True):
            shown[k] = text
        return shown
