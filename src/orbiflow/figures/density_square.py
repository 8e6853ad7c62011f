"""Flat pictures of a density: on the canonical square, beside its samples."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from orbiflow.density.models.blend import BlendedDensity
from orbiflow.density.models.symmetric import SymmetricDensity, midpoints
from orbiflow.figures.canvas import blank_figure, png_bytes
from orbiflow.figures.density_axes import (
    INK,
    check_plane,
    dress,
    font,
    legend,
    space_title,
    view_of,
)
from orbiflow.figures.density_scale import Shade, bar_label, bar_ticks, minor_places, shading
from orbiflow.figures.density_values import density_on_grid, is_sharp, takes_logarithms
from orbiflow.symmetry.isometry import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage

COLOURS = "viridis"
MAX_DOTS = 3000

_GRID, _FINE_GRID = 240, 360
"""Pixels along a side at which a density is evaluated: of a flow, and with kernels beside it."""


def density_png(
    density: SymmetricDensity,
    samples: Tensor | None = None,
    *,
    measure: str = "natural",
    scale: str = "linear",
    names: Sequence[str] | None = None,
    center: Sequence[float] | None = None,
    width_px: int = 1600,
) -> bytes:
    """PNG of a density on the canonical square, with the edges marked that are the same edge.

    Edges of one colour and number of arrow heads are identified, in the sense of the arrows. Ticks
    are in the user's units where the chart is a plain rescaling of them (torus, Klein bottle).
    Peaks narrower than a pixel are averaged over it, and a note says so.

    Args:
        density: on a two-dimensional space.
        samples: data or samples to draw as dots, chart points (N, 2); of more than `MAX_DOTS`, a
            random choice that is always the same. They hide what they lie on.
        measure: with respect to which the density is drawn (`orbiflow.density.spaces.space.MEASURES`).
        scale: of the colours, one of `orbiflow.figures.density_scale.SCALES`.
        names, center: of the axes; see `orbiflow.figures.density_axes.view_of`.
        width_px: the height follows.

    Raises:
        OrbiflowError: for a space of another dimension, an unknown measure or scale, samples of
            another shape, names or a centre that do not fit, or a size that cannot be made.
    """
    space, count = density.space, _FINE_GRID if isinstance(density, BlendedDensity) else _GRID
    check_plane(space)
    view = view_of(space, names, center)
    middles = (torch.arange(count, dtype=torch.float64) + 0.5) / count
    values = density_on_grid(density, middles + view.low[0], middles + view.low[1], measure)
    areas = space.log_area(midpoints(space, count)).exp().numpy().reshape(count, count)
    shade = shading(values, areas, log=takes_logarithms(density, measure, scale))
    figure = blank_figure(width_px, round(0.94 * width_px))
    size = font(figure)
    axes = figure.add_axes((0.11, 0.163, 0.7, 0.7447))
    image = axes.imshow(
        shade.places(values).T, extent=(0, 1, 0, 1), origin="lower", cmap=COLOURS,
        interpolation="bicubic", vmin=0, vmax=1,
    )  # fmt: skip
    if samples is not None:
        draw_dots(axes, view.places(samples), 0.55)
    place = figure.add_axes((0.865, 0.163, 0.025, 0.7447))
    _shade_bar(image, place, shade, bar_label(shade, space, measure), size)
    dress(axes, view, size)
    axes.set_title(f"Density on the {space_title(space)}", fontsize=1.15 * size, pad=14)
    notes = [average_note(count)] if is_sharp(density, 1 / count) else []
    legend(figure, space, size, dots=samples is not None, notes=notes)
    return png_bytes(figure)


def samples_png(
    density: SymmetricDensity,
    data: Tensor,
    drawn: Tensor,
    *,
    names: Sequence[str] | None = None,
    center: Sequence[float] | None = None,
    width_px: int = 1600,
) -> bytes:
    """PNG of data and samples side by side on the canonical square.

    Args:
        density: on a two-dimensional space.
        data, drawn: chart points (N, 2), (M, 2), such as `space.to_chart(table)` and
            `density.sample((M,))`; at most `MAX_DOTS` of each are drawn, the same number where
            there are enough.
        names, center: of the axes; see `orbiflow.figures.density_axes.view_of`.

    Raises:
        OrbiflowError: for a space of another dimension, points of another shape, names or a centre
            that do not fit, or a size that cannot be made.
    """
    space = density.space
    check_plane(space)
    view = view_of(space, names, center)
    both = [view.places(points) for points in (data, drawn)]
    count = min(len(points) for points in both) or MAX_DOTS
    figure = blank_figure(width_px, round(0.56 * width_px))
    size = 0.9 * font(figure)
    for k, (name, points) in enumerate(zip(("data", "samples"), both, strict=True)):
        axes = figure.add_axes((0.085 + 0.485 * k, 0.14, 0.39, 0.6964))
        axes.set_facecolor("#f4f4f1")
        draw_dots(axes, points, 0.5, limit=count, fill="#3b528b", rim="none")
        dress(axes, view, size, places=False)
        shown = min(len(points), count, MAX_DOTS)
        few = "" if shown == len(points) else f"{shown} of "
        axes.set_title(f"{few}{len(points)} {name}", fontsize=1.1 * size, pad=8)
    return png_bytes(figure)


def average_note(count: int) -> str:
    """What a picture of `count` pixels along a side says of peaks that are narrower."""
    return f"peaks narrower than 1/{count} of a side are averaged over it"


def colour_bar(
    image: AxesImage, place: Axes, label: str, size: float, extend: str = "neither"
) -> None:
    """The bar of an image's colours, in the axes `place`."""
    bar = place.figure.colorbar(image, cax=place, extend=extend)
    bar.set_label(label, fontsize=size, color=INK)
    bar.ax.tick_params(labelsize=0.9 * size)
    bar.ax.yaxis.get_offset_text().set_fontsize(0.9 * size)
    bar.outline.set_visible(False)


def draw_dots(
    axes: Axes,
    points: Array,
    alpha: float,
    *,
    limit: int = MAX_DOTS,
    fill: str = "#ffffff",
    rim: str = INK,
    shrink: float = 1.0,
) -> None:
    """Points (N, 2) of the window as dots, at most `limit` and `MAX_DOTS` of them.

    Args:
        shrink: what to multiply the dots' area by.
    """
    points = thinned(points, min(limit, MAX_DOTS))
    axes.scatter(
        *points.T, s=shrink * max(2.0, 9.0 - len(points) / 500), c=fill, edgecolors=rim,
        linewidths=0.35, alpha=alpha, zorder=3,
    )  # fmt: skip


def thinned(points: Array, limit: int = MAX_DOTS) -> Array:
    """A random choice of at most `limit` of points (N, d), always the same."""
    if len(points) <= limit:
        return points
    return points[np.random.default_rng(0).choice(len(points), limit, replace=False)]


def _shade_bar(image: AxesImage, place: Axes, shade: Shade, label: str, size: float) -> None:
    extend = {(True, False): "max", (False, True): "min"}.get((shade.cut, shade.faint), "neither")
    colour_bar(image, place, label, size, extend)
    ticks = bar_ticks(shade)
    place.set_yticks([tick.at for tick in ticks], [tick.text for tick in ticks])
    place.set_yticks(minor_places(shade), minor=True)
