"""What pictures show over a density: dots that leave it readable, lines around regions."""

# matplotlib types no keyword arguments
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density.models import Density
from orbiflow.density.pictures.frames import INK
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.density.regions import DensityLevels, DensityRegion, samples_for
from orbiflow.errors import SettingError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DOT, LIGHT = "#3b528b", "#f4f4f1"
"""Colours of dots without a density, and of the ground beneath them."""

SMALLER = "dots are smaller where they crowd"
MAX_DOTS = 3000

MAX_COVER = 0.3
"""Share of a density's area that dots may hide."""

NEIGHBOURS = 8
"""Number of other dots whose distance says how crowded a place is."""

MIN_WIDTH = 0.5
"""Points (1/72 inch) across the smallest dot on a screen. Those that should be smaller are fainter."""

STEP = 1.1
"""Ratio of one size of dots to the next."""

MIN_INK = 0.03
"""Opacity of the faintest dots."""


def uncrowded(points: Array) -> tuple[Array, Array]:
    """Return places (M, k) and widths (M,) of dots at points (N, k) that hide `MAX_COVER` of a ground.

    Widths are in the unit of the points. Points at one place are one dot; as many dots they would be
    smaller and fainter.

    >>> even = np.stack(np.meshgrid(np.arange(20.0), np.arange(20.0)), axis=-1).reshape(-1, 2)
    >>> _, widths = uncrowded(even)
    >>> round(float(np.median(widths)), 1)
    0.5
    """
    from scipy.spatial import cKDTree

    _, first = np.unique(points.round(9), axis=0, return_index=True)
    places = points[np.sort(first)]
    nearest = min(NEIGHBOURS, len(places) - 1)
    if nearest < 1:
        return places, np.full(len(places), np.inf)
    far = np.asarray(cKDTree(places).query(places, [nearest + 1])[0]).ravel()
    # a disc of this radius holds so many others and the dot itself
    return places, 2 * far * np.sqrt(MAX_COVER / (nearest + 1))


def draw_dots_over(axes: Axes, points: Array, inches: float, *, limit: int, scale: float) -> None:
    """Draw points (N, 2) as dots over a density, smaller where they crowd, as there its peaks are."""
    chosen = thinned(points, limit)
    most, scale = _largest(len(chosen), scale)
    places, widths = uncrowded(chosen)
    steps = np.ceil(np.log(most / (72 * inches * widths).clip(1e-9, most)) / math.log(STEP))
    # one collection a size: a PDF or SVG holds its circle once
    for step in np.unique(steps):
        wanted = most * STEP**-step
        width = max(wanted, min(MIN_WIDTH * scale**0.5, most))
        ink = max((wanted / width) ** 2, MIN_INK)
        axes.scatter(
            *places[steps == step].T, s=width**2, c="#ffffff", edgecolors=INK,
            linewidths=0.12 * width, alpha=0.8 * ink, zorder=5, rasterized=len(chosen) > MAX_DOTS,
        )  # fmt: skip


def draw_dots(
    axes: Axes,
    points: Array,
    alpha: float,
    *,
    fill: str,
    limit: int,
    scale: float,
    rasterized: bool = False,
) -> None:
    """Draw points (N, 2) as dots of one size on a ground of one colour."""
    points = thinned(points, limit)
    width, _ = _largest(len(points), scale)
    axes.scatter(
        *points.T, s=width**2, c=fill, edgecolors="none", alpha=alpha, zorder=5,
        rasterized=rasterized or len(points) > MAX_DOTS,
    )  # fmt: skip


def _largest(count: int, scale: float) -> tuple[float, float]:
    """Return the width of the largest of `count` dots in points (1/72 inch), and the area's factor."""
    scale = max(scale / max(1.0, count / MAX_DOTS) ** 0.7, 0.04)
    return (scale * max(2.0, 9.0 - count / 500)) ** 0.5, scale


def thinned(points: Array, limit: int = MAX_DOTS) -> Array:
    """Return a random choice of at most `limit` of points (N, d), always the same."""
    if len(points) <= limit:
        return points
    return points[np.random.default_rng(0).choice(len(points), limit, replace=False)]


STYLES = ("solid", "dashed", "dotted", "dashdot")
"""Styles of the lines, beginning with the smallest mass."""


def region_lines(density: Density, settings: PlotSettings) -> tuple[DensityRegion, ...]:
    """Return the settings' `regions`, around which lines are drawn, the smallest mass first."""
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
    return tuple(map(levels.highest, sorted(settings.regions)))


def region_note(masses: Sequence[float]) -> str:
    """Return what the lines mean, in words for a caption.

    >>> region_note([0.5, 0.9])
    'lines are about the smallest regions that hold 50 % (solid) and 90 % (dashed)'
    """
    if len(masses) == 1:
        return f"the line is about the smallest region that holds {100 * masses[0]:.10g} %"
    parts = [f"{100 * mass:.10g} % ({style})" for mass, style in zip(masses, STYLES, strict=False)]
    return f"lines are about the smallest regions that hold {', '.join(parts[:-1])} and {parts[-1]}"
