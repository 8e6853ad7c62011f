"""Lines around the smallest regions that hold a mass, over a density's colours."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models import Density
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.density.regions import DensityLevels, samples_for
from orbiflow.drawing import Sheet
from orbiflow.errors import SettingError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Patch

STYLES = ("solid", "dashed", "dotted", "dashdot")
"""Styles of the lines, beginning with the smallest mass."""

HALO, LINE = "#16202a", "#ffffff"


class RegionLine(NamedTuple):
    """A region of highest density: its mass, and the log density at its edge in natural measure."""

    mass: float
    log_prob: float


def region_lines(density: Density, settings: PlotSettings) -> tuple[RegionLine, ...]:
    """Return the lines for the settings' `regions`, the smallest mass first."""
    if not settings.regions:
        return ()
    space = density.space
    if space.dim != 2:
        raise SettingError(
            f"{{regions}} are drawn in two dimensions, this {space.name} has {space.dim}: `orbiflow "
            "density region` finds their thresholds"
        )
    count = samples_for(settings.regions, settings.region_samples)
    levels = DensityLevels(density, samples=count, seed=settings.seed % 2**63)
    return tuple(
        RegionLine(mass, levels.highest(mass).log_prob) for mass in sorted(settings.regions)
    )


def region_note(lines: Sequence[RegionLine]) -> str:
    """Return what the lines mean, in words for a caption.

    >>> region_note([RegionLine(0.5, -1.0), RegionLine(0.9, -2.0)])
    'lines are about the smallest regions that hold 50 % (solid) and 90 % (dashed)'
    """
    if len(lines) == 1:
        percent = f"{100 * lines[0].mass:.10g} %"
        return f"the line is about the smallest region that holds {percent}"
    parts = [
        f"{100 * line.mass:.10g} % ({style})" for line, style in zip(lines, STYLES, strict=False)
    ]
    return f"lines are about the smallest regions that hold {', '.join(parts[:-1])} and {parts[-1]}"


def draw_regions(
    axes: Axes,
    lines: Sequence[RegionLine],
    log_natural: Array,
    extent: tuple[float, float, float, float],
    sheet: Sheet,
    clip: Patch | None = None,
) -> None:
    """Draw lines where the density is that of each region's edge, cut along the patch `clip`.

    `log_natural` has its logarithms (R, C) in natural measure, the lowest row first, NaN where there
    is none; `extent` is left, right, bottom and top of these pixels on the axes.
    """
    from matplotlib.patheffects import Stroke

    rows, columns = log_natural.shape
    left, right, below, above = extent
    x = left + (right - left) * (np.arange(columns) + 0.5) / columns
    y = below + (above - below) * (np.arange(rows) + 0.5) / rows
    for line, style in zip(lines, STYLES, strict=False):
        if not np.nanmin(log_natural) < line.log_prob < np.nanmax(log_natural):
            continue
        width = 0.11 * sheet.text
        drawn = axes.contour(
            x, y, log_natural, levels=[line.log_prob], colors=LINE, linestyles=style,
            linewidths=width, zorder=4,
        )  # fmt: skip
        halo = Stroke(linewidth=1.9 * width, foreground=HALO, alpha=0.55)
        if clip is not None:
            drawn.set_clip_path(clip)
        drawn.set_path_effects([halo, Stroke(linewidth=width, foreground=LINE)])


def log_natural(density: Density, values: Array, points: Tensor, measure: str) -> Array:
    """Return logarithms (N,) in natural measure of values (N,) in another one at points (N, d)."""
    own = np.log(np.maximum(values, 1e-300))
    if measure == "natural":
        return own
    factor = density.space.log_density_factor
    shift = factor(points, "natural") - factor(points, measure)
    return own + shift.double().cpu().numpy()
