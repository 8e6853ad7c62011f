"""Small pictures of densities for pages of many.

In two dimensions they show the canonical square, or a map of directions; of one angle the data's
histogram and the density; of a few angles every pair of samples, and each alone; of many a stripe for
each.
"""

# matplotlib types no keyword arguments
# pyright: reportUnknownMemberType=false

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import ArrayLike

from orbiflow.arrays import Array
from orbiflow.density.models import Density
from orbiflow.density.pictures.colours import COLOURS
from orbiflow.density.pictures.figures import plane_ground
from orbiflow.density.pictures.frames import INK, view_of
from orbiflow.density.pictures.maps import Map
from orbiflow.density.pictures.projections import chosen_map
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.drawing import Sheet

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SIZE = (360, 240)
"""Width and height in pixels, half as many again as a page shows."""

SHEET = Sheet(SIZE[0] / 100, 8.0, dpi=100)
BARS = "#b9c4d0"
PIXELS, MAP_PIXELS = 120, 14_000
"""Points along a side at which a density is evaluated, and of a map in all."""

SAMPLES, SEED = 4_000, 0
MAX_PAIRS = 6
"""Number of angles up to which pairs are drawn, instead of stripes."""


@torch.no_grad()
def density_thumbnail(density: Density, data: ArrayLike) -> bytes:
    """Return a PNG of 360 x 240 pixels, the same every time.

    Colours are by logarithms where most of the picture would be dark otherwise. `data` (N, k) are those
    that the density was fitted to; rows that lack angles are left out.
    """
    space, table = density.space, np.asarray(data, dtype=np.float64)
    whole = table[~np.isnan(table).any(axis=1)]
    figure = SHEET.figure(SIZE[1] / 100)
    if space.has_chart and space.dim == 2:
        _draw_plane(figure, density, whole)
    elif space.has_square and space.dim == 1:
        _draw_angle(figure, density, whole)
    else:
        drawn = density.sample((SAMPLES,), torch.Generator().manual_seed(SEED))
        places = view_of(space).places(drawn) if space.has_chart else (drawn.numpy() + 1) / 2
        if space.has_chart and not space.has_square:
            places = (places - places.min(axis=0)) / np.ptp(places, axis=0)
        draw = _draw_pairs if places.shape[1] <= MAX_PAIRS else _draw_stripes
        draw(figure, places)
    return SHEET.file(figure)


def _draw_plane(figure: Figure, density: Density, data: Array) -> None:
    """Draw the canonical square, a lattice's cell, or a map that suits data (N, k)."""
    space, settings = density.space, PlotSettings()
    if space.is_round:
        ground = Map(space, chosen_map(space, space.to_chart(data)))
    else:
        ground = plane_ground(space, settings)
    axes = figure.add_axes((0.01, 0.01, 0.98, 0.98))
    count = MAP_PIXELS if space.is_round else PIXELS
    ground.colouring(density, settings, count).draw(axes)
    axes.set_aspect("equal")
    axes.set_axis_off()


def _draw_angle(figure: Figure, density: Density, data: Array) -> None:
    """Draw bars of the data under the density's line, from minus half a turn to half a turn."""
    view = view_of(density.space)
    count = min(72, max(12, round(2 * len(data) ** (1 / 3))))
    places = view.places(density.space.to_chart(data))[:, 0]
    t = torch.linspace(0, 1, SIZE[0], dtype=torch.float64)
    line = density.log_prob(view.to_chart(t[:, None]), measure="square").exp().numpy()
    axes = figure.add_axes((0.02, 0.03, 0.96, 0.94))
    bars, *_ = axes.hist(places, count, range=(0, 1), density=True, rwidth=0.95, color=BARS)
    axes.plot(t, line, color=INK, linewidth=1.5)
    top = float(np.max(bars))
    axes.set(xlim=(0, 1), ylim=(0, 1.05 * min(max(top, float(line.max())), 4 * top)))
    axes.set_axis_off()


def _draw_pairs(figure: Figure, places: Array) -> None:
    """Draw every pair of angles below the diagonal, each alone on it."""
    dim, side = places.shape[1], SIZE[1] // places.shape[1]
    room = (1 - SIZE[1] / SIZE[0]) / 2
    edges = {"left": room, "right": 1 - room, "bottom": 0, "top": 1, "wspace": 0.05, "hspace": 0.05}
    panels = figure.subplots(dim, dim, squeeze=False, gridspec_kw=edges)
    for (row, column), axes in np.ndenumerate(panels):
        axes.set_axis_off()
        if row == column:
            axes.hist(places[:, row], side // 2, range=(0, 1), color=BARS)
            axes.set_xlim(0, 1)
        elif row > column:
            bins = max(12, side // 3)
            counts, _ = np.histogramdd(places[:, [row, column]], (bins, bins), ((0, 1), (0, 1)))
            # a square root: most cells of many angles are nearly empty
            shades, most = np.sqrt(counts), max(1.0, float(np.quantile(counts, 0.995))) ** 0.5
            axes.imshow(shades, COLOURS, interpolation="bicubic", vmax=most, origin="lower")


def _draw_stripes(figure: Figure, places: Array) -> None:
    """Draw a stripe for each angle, from the top, each as bright as its largest bin."""
    edges = {"left": 0, "right": 1, "bottom": 0, "top": 1, "hspace": 0.05}
    panels = figure.subplots(places.shape[1], 1, squeeze=False, gridspec_kw=edges)
    for axes, column in zip(panels.flat, places.T, strict=True):
        axes.imshow(np.histogram(column, 90, (0, 1))[0][None], COLOURS, vmin=0, aspect="auto")
        axes.set_axis_off()
