"""Flat pictures of a density: on the canonical square, of its flow, beside its samples."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from orbiflow.density.density import SymmetricDensity, midpoints
from orbiflow.density.flat_spaces import KleinBottle, Torus
from orbiflow.density.space import Space
from orbiflow.draw.canvas import blank_figure, png_bytes
from orbiflow.draw.field import draw_flow, draw_magnitude
from orbiflow.draw.immersions import edge_pairs, off_cones
from orbiflow.draw.marks import CENTER_COLOURS, center_sign
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import CrystallographicGroup
from orbiflow.symmetry.elements import symmetry_elements
from orbiflow.symmetry.isometry import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

COLOURS = "viridis"
MAX_DOTS = 3000
EDGE_COLOURS = ("#d95f02", "#1f78b4")
"""Of the two pairs of edges that are one edge each."""

_GRID = 240
_INK = "#1a1a1a"


class Shade(NamedTuple):
    """How values become colours: linearly from `low` to `high`; `cut` if some are above `high`."""

    low: float
    high: float
    cut: bool


def density_png(
    density: SymmetricDensity,
    samples: Tensor | None = None,
    *,
    measure: str = "natural",
    width_px: int = 1600,
) -> bytes:
    """PNG of a density on the canonical square, with the edges marked that are the same edge.

    Edges of one colour and number of arrow heads are identified, in the sense of the arrows. Ticks
    are in the user's units where the chart is a plain rescaling of them (torus, Klein bottle).

    Args:
        density: on a two-dimensional space.
        samples: data or samples to draw as dots, chart points (N, 2); of more than `MAX_DOTS`, a
            random choice that is always the same.
        measure: with respect to which the density is drawn (`orbiflow.density.space.MEASURES`).
        width_px: the height follows.

    Raises:
        OrbiflowError: for a space of another dimension, an unknown measure, samples of another
            shape, or a size that cannot be made.
    """
    space = density.space
    values = density_at(density, midpoints(space, _GRID), measure).reshape(_GRID, _GRID).T
    figure = blank_figure(width_px, round(0.98 * width_px))
    size = _font(figure)
    axes = figure.add_axes((0.11, 0.15, 0.7, 0.7143))
    shade = shading(values)
    image = axes.imshow(
        values, extent=(0, 1, 0, 1), origin="lower", cmap=COLOURS, interpolation="bicubic",
        vmin=shade.low, vmax=shade.high,
    )  # fmt: skip
    if samples is not None:
        _dots(axes, _points(space, samples), 0.55)
    place = figure.add_axes((0.865, 0.15, 0.025, 0.7143))
    extend = "max" if shade.cut else "neither"
    _colour_bar(image, place, measure_label(space, measure), size, extend)
    _dress(axes, space, size)
    axes.set_title(f"Density on the {space_title(space)}", fontsize=1.15 * size, pad=14)
    _legend(figure, space, size, samples is not None)
    return png_bytes(figure)


def flow_png(density: SymmetricDensity, *, cells: int = 3, width_px: int = 1600) -> bytes:
    """PNG of the time mean of the flow's vector fields, over the canonical square and its images.

    The square is outlined; the letter F in every cell shows how the cell is the square's image.

    Args:
        density: on a two-dimensional space.
        cells: along each side of the picture, 1 to 9.
        width_px: the height follows.

    Raises:
        OrbiflowError: for a space of another dimension, another number of cells, or a size that
            cannot be made.
    """
    space = density.space
    _check_plane(space)
    if isinstance(cells, bool) or int(cells) != cells or not 1 <= cells <= 9:
        raise OrbiflowError(f"cells must be an integer from 1 to 9, got {cells!r}")
    low, high = 0.5 - cells / 2, 0.5 + cells / 2
    window = (low, low, high, high)
    figure = blank_figure(width_px, round(0.9 * width_px))
    size = _font(figure)
    axes = figure.add_axes((0.03, 0.07, 0.7920, 0.88))
    axes.set_xlim(low, high)
    axes.set_ylim(low, high)  # `draw_magnitude` keeps these

    def mean_field(points: Tensor) -> Tensor:
        return _mean_field(density, points)

    draw_magnitude(axes, mean_field, window)
    draw_flow(axes, mean_field, space.group, window)
    _draw_cells(axes, space.group, window)
    place = figure.add_axes((0.85, 0.07, 0.025, 0.88))
    _colour_bar(axes.images[0], place, "speed, sides of the square per unit time", size)
    axes.set_axis_off()
    caption = f"Flow on the {space_title(space)}: canonical square outlined, its images thin"
    figure.text(0.03, 0.025, caption, fontsize=size, color=_INK)
    return png_bytes(figure)


def samples_png(
    density: SymmetricDensity, data: Tensor, drawn: Tensor, *, width_px: int = 1600
) -> bytes:
    """PNG of data and samples side by side on the canonical square.

    Args:
        density: on a two-dimensional space.
        data, drawn: chart points (N, 2), (M, 2), such as `space.to_chart(table)` and
            `density.sample((M,))`; at most `MAX_DOTS` of each are drawn, the same number where
            there are enough.

    Raises:
        OrbiflowError: for a space of another dimension, points of another shape, or a size that
            cannot be made.
    """
    space = density.space
    _check_plane(space)
    both = [_points(space, points) for points in (data, drawn)]
    count = min(len(points) for points in both) or MAX_DOTS
    figure = blank_figure(width_px, round(0.56 * width_px))
    size = 0.9 * _font(figure)
    for k, (name, points) in enumerate(zip(("data", "samples"), both, strict=True)):
        axes = figure.add_axes((0.085 + 0.485 * k, 0.14, 0.39, 0.6964))
        axes.set_facecolor("#f4f4f1")
        _dots(axes, points, 0.5, limit=count, fill="#3b528b", rim="none")
        _dress(axes, space, size, places=False)
        shown = min(len(points), count, MAX_DOTS)
        few = "" if shown == len(points) else f"{shown} of "
        axes.set_title(f"{few}{len(points)} {name}", fontsize=1.1 * size, pad=8)
    return png_bytes(figure)


def space_title(space: Space) -> str:
    """The space's name in a sentence.

    >>> space_title(KleinBottle())
    'Klein bottle'
    """
    return space.name.replace("-", " ").replace("klein", "Klein")


def measure_label(space: Space, measure: str) -> str:
    """What a density of `space` in that measure is, for a colour bar."""
    if measure == "uniform":
        return "density, times that of the uniform distribution"
    if measure == "square":
        return "density, per area of the canonical square"
    unit = getattr(space, "unit", "steradian").removesuffix("s")
    return f"density, per {unit}{'²' if hasattr(space, 'unit') else ''}"


def shading(values: Array, weights: Array | None = None) -> Shade:
    """Colours from 0 to the largest value, or, if a few are far above it, to what 99.8 % are below.

    Args:
        values: of any shape.
        weights: of the same shape, default all the same.
    """
    flat, order = values.ravel(), values.argsort(axis=None)
    share = np.cumsum(np.ones_like(flat) if weights is None else weights.ravel()[order])
    top, high = float(flat.max()), float(flat[order[np.searchsorted(share, 0.998 * share[-1])]])
    cut = top > 1.3 * high > 0
    return Shade(0.0, high if cut else max(top, 1e-300), cut)


@torch.no_grad()
def density_at(density: SymmetricDensity, points: Tensor, measure: str) -> Array:
    """Density (N,) at chart points (N, 2) of the square; at cone points, next to them.

    Raises:
        OrbiflowError: for an unknown measure.
    """
    if hasattr(density.space, "cone_vectors"):
        points = off_cones(points)
    like = next(iter(density.flow.parameters()), points)
    return density.log_prob(points.to(like), measure=measure).double().cpu().exp().numpy()


def _colour_bar(
    image: AxesImage, place: Axes, label: str, size: float, extend: str = "neither"
) -> None:
    bar = place.figure.colorbar(image, cax=place, extend=extend)
    bar.set_label(label, fontsize=size, color=_INK)
    bar.ax.tick_params(labelsize=0.9 * size)
    bar.ax.yaxis.get_offset_text().set_fontsize(0.9 * size)
    bar.outline.set_visible(False)


def _dress(axes: Axes, space: Space, size: float, *, places: bool = True) -> None:
    axes.set_xlim(0, 1)
    axes.set_ylim(0, 1)
    axes.set_aspect("equal")
    for spine in axes.spines.values():
        spine.set_visible(False)
    axes.tick_params(labelsize=0.9 * size, length=0.3 * size, pad=0.5 * size)
    axes.set_xticks([])
    axes.set_yticks([])
    if isinstance(space, Torus | KleinBottle):
        (x_name, x_ticks), (y_name, y_ticks) = _angle_ticks(space)
        quarters = np.linspace(0, 1, 5)
        axes.set_xticks(quarters, x_ticks)
        axes.set_yticks(quarters, y_ticks)
        axes.set_xlabel(x_name, fontsize=size, color=_INK)
        axes.set_ylabel(y_name, fontsize=size, color=_INK, labelpad=0.2 * size)
    for number, pair in enumerate(edge_pairs(space.group)):
        for edge in pair:
            _arrow(axes, edge, EDGE_COLOURS[number % 2], number + 1, size)
    for corner, order in _cones(space.group):
        sign = np.array(corner) + center_sign(order, 0.018)
        axes.fill(
            *sign.T, facecolor=CENTER_COLOURS[order], edgecolor="#ffffff", linewidth=0.08 * size,
            zorder=8, clip_on=False,
        )  # fmt: skip
        if places:
            _place(axes, space, corner, size)


def _arrow(axes: Axes, edge: Array, colour: str, heads: int, size: float) -> None:
    """An edge with as many heads in its middle as the number of its pair."""
    axes.plot(*edge.T, color=colour, linewidth=0.28 * size, clip_on=False, zorder=6)
    along = edge[1] - edge[0]
    across = np.array([-along[1], along[0]])
    for k in range(heads):
        tip = edge[0] + (0.53 + 0.035 * (k - (heads - 1) / 2)) * along
        back = tip - 0.035 * along
        ring = np.stack([tip, back + 0.016 * across, back - 0.016 * across])
        axes.fill(
            *ring.T, facecolor=colour, edgecolor="#ffffff", linewidth=0.06 * size,
            clip_on=False, zorder=7,
        )  # fmt: skip


def _cones(group: CrystallographicGroup) -> list[tuple[tuple[float, float], int]]:
    """Corners of the square that are rotation centres, and their orders."""
    found = symmetry_elements(group, np.full(2, 0.5), 1.0).centers
    corners = [(x, y) for x in (0.0, 1.0) for y in (0.0, 1.0)]
    return [
        (corner, center.order)
        for corner in corners
        for center in found
        if np.allclose(center.point, corner)
    ]


def _place(axes: Axes, space: Space, corner: tuple[float, float], size: float) -> None:
    """Where in the data's columns a cone point lies."""
    digits = 2 if len(space.columns) == 3 else 0
    row = space.from_chart(torch.tensor([corner], dtype=torch.float64))[0].round(digits) + 0.0
    text = ", ".join(f"{n} {v:.{digits}f}" for n, v in zip(space.columns, row, strict=True))
    axes.annotate(
        text.replace("-", "\N{MINUS SIGN}"), corner, xytext=(0, size * (2 * corner[1] - 1)),
        textcoords="offset points", ha="right" if corner[0] else "left",
        va="bottom" if corner[1] else "top", fontsize=0.85 * size, color=_INK,
    )  # fmt: skip


def _legend(figure: Figure, space: Space, size: float, dots: bool) -> None:
    from matplotlib.lines import Line2D

    entries = [
        Line2D(
            [],
            [],
            color=colour,
            linewidth=0.28 * size,
            marker=">",
            label=f"both {text} edges are one edge",
        )
        for colour, text in zip(EDGE_COLOURS, ("orange", "blue"), strict=True)
    ]
    for order in sorted({order for _, order in _cones(space.group)}, reverse=True):
        outline = center_sign(order, 1.0)
        style: dict[str, Any] = {"marker": np.concatenate([outline, outline[:1]])}
        style |= {"color": CENTER_COLOURS[order], "markersize": size, "linestyle": "none"}
        turn = {2: "half", 4: "quarter"}[order]
        entries.append(
            Line2D([], [], label=f"cone point of a {turn} turn: no flow moves it", **style)
        )
    if dots:
        style = {"markerfacecolor": "#ffffff", "markeredgecolor": _INK, "linestyle": "none"}
        entries.append(Line2D([], [], marker="o", label="points", **style))
    if hasattr(space, "cone_vectors"):
        note = "the square stretches areas: dots crowd where it shrinks them"
        entries.append(Line2D([], [], linestyle="none", label=note))
    figure.legend(
        handles=entries, loc="lower left", bbox_to_anchor=(0.05, 0.005), ncols=2, frameon=False,
        fontsize=0.9 * size,
    )  # fmt: skip


def _draw_cells(axes: Axes, group: CrystallographicGroup, window: Any) -> None:
    for t in np.arange(np.floor(window[0]), np.ceil(window[2]) + 1):
        axes.axvline(t, color="#ffffff", linewidth=0.7, alpha=0.7, zorder=4)
        axes.axhline(t, color="#ffffff", linewidth=0.7, alpha=0.7, zorder=4)
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]])
    for colour, width in (("#111111", 3.6), ("#ffd166", 1.8)):
        axes.plot(*square.T, color=colour, linewidth=width, solid_joinstyle="miter", zorder=5)
    letter = np.array(
        [[0, 0], [0, 5], [3, 5], [3, 4], [1, 4], [1, 3], [2.4, 3], [2.4, 2], [1, 2], [1, 0]]
    )
    letter = 0.07 + 0.026 * letter
    middle = np.full(2, 0.5)
    for g in group.elements_near(middle, window[2] - window[0], source=middle):
        axes.fill(*g(letter).T, facecolor="#ffd166", edgecolor="#111111", linewidth=0.5, zorder=6)


def _dots(
    axes: Axes,
    points: Array,
    alpha: float,
    *,
    limit: int = MAX_DOTS,
    fill: str = "#ffffff",
    rim: str = _INK,
) -> None:
    if len(points) > (limit := min(limit, MAX_DOTS)):
        points = points[np.random.default_rng(0).choice(len(points), limit, replace=False)]
    axes.scatter(
        *points.T, s=max(2.0, 9.0 - len(points) / 500), c=fill, edgecolors=rim, linewidths=0.35,
        alpha=alpha, zorder=3,
    )  # fmt: skip


def _angle_ticks(space: Torus | KleinBottle) -> tuple[tuple[str, list[str]], ...]:
    """Name and five tick labels of the horizontal and of the vertical axis."""
    if isinstance(space, Torus):
        # as `from_chart` writes angles
        labels = [angle_text(t, space.unit) for t in (0, 0.25, 0.5, -0.25, 0)]
        labels[2] = f"±{labels[2]}"
        return tuple((name, labels) for name in space.columns)
    x = [angle_text(t / 4, space.unit) for t in range(-1, 4)]
    y = [angle_text(t / 8, space.unit) for t in range(5)]
    return (space.columns[1], x), (space.columns[0], y)


def angle_text(turns: float, unit: str) -> str:
    """An angle in its unit.

    >>> angle_text(0.375, "radians"), angle_text(0.25, "degrees")
    ('3π/4', '90°')
    """
    if unit == "radians":
        part = Fraction(turns) * 2
        over = f"/{part.denominator}" if part.denominator > 1 else ""
        times = "" if abs(part.numerator) == 1 else str(abs(part.numerator))
        text = f"{times}π{over}" if part else "0"
    else:
        text = f"{abs(turns) * 360:g}°" if unit == "degrees" else f"{abs(turns):g}"
    return f"\N{MINUS SIGN}{text}" if turns < 0 else text


@torch.no_grad()
def _mean_field(density: SymmetricDensity, points: Tensor) -> Tensor:
    fields = list(density.flow.segments)
    like = next(iter(density.flow.parameters()), points)
    return torch.stack([field(points.to(like)) for field in fields]).mean(dim=0).double().cpu()


def _points(space: Space, points: Tensor) -> Array:
    if points.ndim != 2 or points.shape[1] != space.dim:
        raise OrbiflowError(f"expected chart points (N, {space.dim}), got {tuple(points.shape)}")
    return space.project(points.detach().double().cpu()).numpy()


def _check_plane(space: Space) -> None:
    if space.dim != 2:
        raise OrbiflowError(f"a picture needs two dimensions, this {space.name} has {space.dim}")


def _font(figure: Figure) -> float:
    return 9.5 * figure.get_figwidth() / 8
