"""What densities and points are drawn on, and the dots and lines that are drawn over them."""

# matplotlib types no keyword arguments
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models import Density, Pixel
from orbiflow.density.pictures import frames
from orbiflow.density.pictures.colours import (
    COLOURS,
    Shade,
    chosen_scale,
    density_over,
    is_sharp,
    shading,
)
from orbiflow.density.pictures.frames import INK
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.density.regions import DensityLevels, DensityRegion, samples_for
from orbiflow.density.spaces import Space
from orbiflow.drawing import Sheet
from orbiflow.errors import SettingError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage
    from matplotlib.patches import Polygon


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


HALO, LINE = "#16202a", "#ffffff"
"""Colours of lines around regions: their rim, and the line."""


class Pixels(NamedTuple):
    """The pixels of a ground, in a rectangle whose lowest row is the first.

    - `points`: Chart points (N, 2) of those that are drawn.
    - `shown`: Which pixels are drawn, (rows, columns) of bool.
    - `within`: Which of these the scale of the colours is made for, (N,) of bool.
    - `areas`: Their natural areas (N,), up to a factor; None if all are the same.
    - `side`: How wide a pixel is. `size`: The same in words.
    - `extent`: Left, right, bottom and top of the rectangle on the axes.
    """

    points: Tensor
    shown: Array
    within: Array
    areas: Array | None
    side: Pixel
    size: str
    extent: tuple[float, float, float, float]

    def table(self, values: Array, elsewhere: float) -> Array:
        """Return values (N,) in the rectangle, (rows, columns), with another value elsewhere."""
        table = np.full(self.shown.shape, elsewhere)
        table[self.shown] = values
        return table


@dataclass(frozen=True, eq=False)
class GroundColouring:
    """The colours of a density on a ground.

    - `places`: Place of each pixel on the colour bar, (rows, columns), the lowest row first.
    - `extent`: Left, right, bottom and top of the pixels on the axes.
    - `shade`: The scale of the colours. `reason`: Why it is linear or logarithmic.
    - `averaging`: A note on peaks narrower than a pixel, "" if there are none.
    - `logs`: Logarithms of the density in natural measure, shaped as `places`, NaN where there is none;
      None if there are no lines around regions.
    - `outline`: Ring (N, 2) beyond which nothing is drawn, None for the whole rectangle.
    """

    places: Array
    extent: tuple[float, float, float, float]
    shade: Shade
    reason: str
    averaging: str
    logs: Array | None
    outline: Array | None = None

    def draw(self, axes: Axes) -> AxesImage:
        """Draw the colours as one image, cut along the outline, without seams or steps at its rim."""
        image = axes.imshow(
            self.places, extent=self.extent, origin="lower", cmap=COLOURS,
            interpolation="bicubic", vmin=0, vmax=1, aspect="auto", zorder=1,
        )  # fmt: skip
        if self.outline is not None:
            image.set_clip_path(self._clip(axes))
        return image

    def draw_regions(self, axes: Axes, lines: Sequence[DensityRegion], sheet: Sheet) -> None:
        """Draw lines where the density is that of each region's edge, cut along the outline."""
        if self.logs is None:
            return
        from matplotlib.patheffects import Stroke

        logs, (left, right, below, above) = self.logs, self.extent
        rows, columns = logs.shape
        x = left + (right - left) * (np.arange(int(columns)) + 0.5) / columns
        y = below + (above - below) * (np.arange(int(rows)) + 0.5) / rows
        width, clip = 0.11 * sheet.text, self._clip(axes)
        for line, style in zip(lines, STYLES, strict=False):
            if not np.nanmin(logs) < line.log_prob < np.nanmax(logs):
                continue
            drawn = axes.contour(
                x, y, logs, levels=[line.log_prob], colors=LINE, linestyles=style,
                linewidths=width, zorder=4,
            )  # fmt: skip
            halo = Stroke(linewidth=1.9 * width, foreground=HALO, alpha=0.55)
            if clip is not None:
                drawn.set_clip_path(clip)
            drawn.set_path_effects([halo, Stroke(linewidth=width, foreground=LINE)])

    def _clip(self, axes: Axes) -> Polygon | None:
        from matplotlib.patches import Polygon

        if self.outline is None:
            return None
        return Polygon(self.outline.tolist(), closed=True, transform=axes.transData)


class Ground(ABC):
    """A window of a space of two dimensions, seen from above.

    - `width`, `aspect`: Its width in units of the axes, and its width over its height.
    - `title_gap`: Distance of a panel's title, in sizes of the text.
    """

    space: Space
    width = aspect = 1.0
    title_gap = 0.7
    outline: Array | None = None

    @abstractmethod
    def places(self, points: Tensor) -> Array:
        """Return where chart points (N, 2) lie on the axes."""

    @abstractmethod
    def pixels(self, count: int) -> Pixels:
        """Return so many pixels: along the longer side, or of a map in all."""

    @abstractmethod
    def pixels_for(self, density: Density) -> int:
        """Return how many pixels a density needs."""

    @abstractmethod
    def room(self, sheet: Sheet, label: str, ticks: Sequence[str]) -> frames.Room:
        """Return the room around a single picture and its colour bar."""

    @abstractmethod
    def panels_room(self, sheet: Sheet) -> tuple[frames.Room, bool]:
        """Return the room around two panels, and whether one is above the other."""

    @abstractmethod
    def draw_axes(self, axes: Axes, sheet: Sheet, side: float, panel: frames.Panel) -> None:
        """Draw what surrounds the picture, and the marks on it."""

    @abstractmethod
    def caption(self, notes: Sequence[str], dots: tuple[int, int] | None) -> str:
        """Return what is seen, and `notes`, as sentences; of `dots`, how many are shown of how many."""

    def samples_caption(self, notes: Sequence[str]) -> str:
        """Return the caption of points on two grounds."""
        return self.caption(notes, (0, 0))

    def colouring(
        self, density: Density, settings: PlotSettings, count: int | None = None
    ) -> GroundColouring:
        """Return the colours of a density, on as many `pixels` as it needs or on a `count` of them."""
        pixels = self.pixels(count or self.pixels_for(density))
        values = density_over(density, pixels.points, settings.measure, pixels.side)
        log, reason = chosen_scale(density, settings.measure, settings.scale)
        areas = None if pixels.areas is None else pixels.areas[pixels.within]
        shade = shading(values[pixels.within], areas, log=log)
        logs = None
        if settings.regions:
            naturals = log_natural(density, values, pixels.points, settings.measure)
            logs = pixels.table(naturals, math.nan)
        note = ""
        if is_sharp(density, pixels.side):
            note = f"peaks narrower than {pixels.size} are averaged over it"
        places = pixels.table(shade.places(values), 0.0)
        return GroundColouring(places, pixels.extent, shade, reason, note, logs, self.outline)

    def fill(self, axes: Axes) -> None:
        """Fill the ground with one light colour."""
        axes.set_facecolor(LIGHT)

    def write_title(self, axes: Axes, sheet: Sheet, title: str) -> None:
        """Write the title above the picture."""
        axes.set_title(title, fontsize=1.15 * sheet.text, pad=14)


def log_natural(density: Density, values: Array, points: Tensor, measure: str) -> Array:
    """Return logarithms (N,) in natural measure of values (N,) in another one at points (N, d)."""
    logs = np.log(np.maximum(values, 1e-300))
    if measure == "natural":
        return logs
    factor = density.space.log_density_factor
    shift = factor(points, "natural") - factor(points, measure)
    return logs + shift.double().cpu().numpy()
