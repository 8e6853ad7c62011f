"""Lines about the smallest regions that hold a mass, over a density's colours."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import torch

from orbiflow.arrays import Array
from orbiflow.density.models import SymmetricDensity
from orbiflow.density.spaces import Space
from orbiflow.drawing import Sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Patch

STYLES = ("solid", "dashed", "dotted", "dashdot")
"""Of lines, from the smallest mass; as many regions at most."""

HALO, LINE = "#16202a", "#ffffff"


class RegionLine(NamedTuple):
    """A region of highest density: its mass, and the log density at its edge, in natural measure."""

    mass: float
    log_prob: float


def region_note(lines: Sequence[RegionLine]) -> str:
    """What the lines are, in words for a caption.

    >>> region_note([RegionLine(0.9, -2.0), RegionLine(0.5, -1.0)])
    'lines are about the smallest regions that hold 50 % (solid) and 90 % (dashed)'
    """
    said = [
        f"{100 * line.mass:.10g} % ({style})"
        for line, style in zip(_in_order(lines), STYLES, strict=False)
    ]
    if len(said) == 1:
        return f"the line is about the smallest region that holds {said[0].split(' (')[0]}"
    return f"lines are about the smallest regions that hold {', '.join(said[:-1])} and {said[-1]}"


def draw_regions(
    axes: Axes,
    lines: Sequence[RegionLine],
    x: Array,
    y: Array,
    log_natural: Array,
    sheet: Sheet,
    clip: Patch | None = None,
) -> None:
    """Lines where the density is that of each region's edge.

    Args:
        x, y: (C,), (R,) places of the pixels' middles on the axes.
        log_natural: (R, C) logarithms of the density in natural measure; NaN where there is none.
        clip: beyond which nothing is drawn.
    """
    from matplotlib.patheffects import Stroke

    for line, style in zip(_in_order(lines), STYLES, strict=False):
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


def log_natural(
    density: SymmetricDensity, values: Array, points: torch.Tensor, measure: str
) -> Array:
    """Logarithms (N,) in natural measure of values (N,) in another one at chart points (N, d)."""
    space: Space = density.space
    own = np.log(np.maximum(values, 1e-300))
    if measure == "natural":
        return own
    natural, other = (space.log_density_factor(points, name) for name in ("natural", measure))
    shift = natural - other
    return own + shift.double().cpu().numpy()


def _in_order(lines: Sequence[RegionLine]) -> list[RegionLine]:
    return sorted(lines, key=lambda line: line.mass)
