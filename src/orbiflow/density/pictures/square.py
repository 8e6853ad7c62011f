"""Flat pictures of a density: on the canonical square, beside its samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict, Unpack

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models import (
    BlendedDensity,
    SymmetricDensity,
    midpoints,
)
from orbiflow.density.pictures.axes import (
    View,
    check_plane,
    dress,
    space_title,
    view_of,
)
from orbiflow.density.pictures.dots import (
    MAX_DOTS,
    dot_shrink,
    draw_dots_over,
)
from orbiflow.density.pictures.frame import framed, shade_bar
from orbiflow.density.pictures.legend import (
    SMALLER,
    caption,
    legend,
)
from orbiflow.density.pictures.regions import (
    RegionLine,
    draw_regions,
    log_natural,
    region_note,
)
from orbiflow.density.pictures.scale import (
    Shade,
    bar_label,
    bar_ticks,
    shading,
)
from orbiflow.density.pictures.values import (
    chosen_scale,
    density_on_grid,
    is_sharp,
)
from orbiflow.drawing import Picture, Sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage

COLOURS = "viridis"

_GRID, _FINE_GRID = 240, 360
"""Pixels along a side at which a density is evaluated: of a flow, and with kernels beside it."""


class AxesOptions(TypedDict, total=False):
    """Of `samples_picture`."""

    names: Sequence[str] | None
    center: Sequence[float] | None


class DensityOptions(AxesOptions, total=False):
    """Of `density_picture` and `samples_picture`."""

    measure: str
    scale: str


class SquareOptions(DensityOptions, total=False):
    """Of `density_picture`."""

    regions: Sequence[RegionLine]


def density_png(
    density: SymmetricDensity,
    samples: Tensor | None = None,
    *,
    width_px: int = 1600,
    **options: Unpack[SquareOptions],
) -> bytes:
    """PNG of `density_picture`, which has the `options`, for a screen; the height follows.

    Raises:
        OrbiflowError: as `density_picture`, and for a size that cannot be made.
    """
    return density_picture(density, samples, sheet=Sheet.screen(width_px), **options).file()


def density_picture(
    density: SymmetricDensity,
    samples: Tensor | None = None,
    *,
    measure: str = "natural",
    scale: str = "linear",
    names: Sequence[str] | None = None,
    center: Sequence[float] | None = None,
    sheet: Sheet | None = None,
    most: int = MAX_DOTS,
    regions: Sequence[RegionLine] = (),
) -> Picture:
    """A density on the canonical square, with the edges marked that are the same edge.

    Edges of one colour and number of arrow heads are identified, in the sense of the arrows. Ticks
    are in the user's units where the chart is a plain rescaling of them (torus, Klein bottle).
    Peaks narrower than a pixel are averaged over it, and a note says so.

    Args:
        density: on a two-dimensional space.
        samples: data or samples to draw as dots, chart points (N, 2); of more than `most`, a random
            choice that is always the same; smaller where they crowd, so that peaks stay in sight.
        measure: with respect to which the density is drawn (`orbiflow.density.spaces.space.MEASURES`).
        scale: of the colours, one of `orbiflow.figures.density_scale.SCALES`.
        names, center: of the axes; see `orbiflow.figures.density_axes.view_of`.
        sheet: default a screen of 1600 pixels.
        regions: of highest density, whose edges are drawn as lines.

    Raises:
        OrbiflowError: for a space of another dimension, an unknown measure or scale, samples of
            another shape, or names or a centre that do not fit.
    """
    sheet = sheet or Sheet.screen()
    space = density.space
    check_plane(space)
    view = view_of(space, names, center)
    drawn = square_colours(density, view, measure, scale)
    shade, count = drawn.shade, len(drawn.places)
    label = bar_label(shade, space, measure)
    frame = framed(sheet, view, label, [tick.text for tick in bar_ticks(shade)])
    image = drawn.on(frame.axes)
    if regions:
        middles = (np.arange(count) + 0.5) / count
        draw_regions(frame.axes, regions, middles, middles, drawn.log_natural().T, sheet)
    if samples is not None:
        shrink = dot_shrink(sheet, frame.side)
        draw_dots_over(frame.axes, view.places(samples), frame.side, limit=most, shrink=shrink)
    shade_bar(image, frame, sheet, shade, label)
    dress(frame.axes, view, sheet)
    title = f"Density on the {space_title(space)}"
    signs: dict[str, Any] = {"dots": samples is not None}
    signs["notes"] = [*([SMALLER] if signs["dots"] else []), drawn.why]
    signs["notes"] += [region_note(regions)] if regions else []
    if is_sharp(density, 1 / count):
        signs["notes"].append(average_note(count))
    if not sheet.printed:
        frame.axes.set_title(title, fontsize=1.15 * sheet.text, pad=14)
        legend(frame.figure, space, sheet, **signs)
    return Picture(frame.figure, sheet, title, caption(space, **signs))


class Coloured(NamedTuple):
    """A density on the window of a square: places of its pixels (N, N) on the colour bar, first x.

    - `why`: the scale is linear or logarithmic.
    - `log_natural`: called, (N, N) logarithms of the density in natural measure: for lines alone.
    """

    places: Array
    shade: Shade
    why: str
    log_natural: Callable[[], Array]

    def on(self, axes: Axes) -> AxesImage:
        """The picture of it."""
        return axes.imshow(
            self.places.T, extent=(0, 1, 0, 1), origin="lower", cmap=COLOURS,
            interpolation="bicubic", vmin=0, vmax=1,
        )  # fmt: skip


def square_colours(density: SymmetricDensity, view: View, measure: str, scale: str) -> Coloured:
    """The colours of a density's picture on the square.

    Raises:
        OrbiflowError: for an unknown measure or scale.
    """
    space, count = density.space, _FINE_GRID if isinstance(density, BlendedDensity) else _GRID
    middles = (torch.arange(count, dtype=torch.float64) + 0.5) / count
    values = density_on_grid(density, middles + view.low[0], middles + view.low[1], measure)
    areas = space.log_area(midpoints(space, count)).exp().numpy().reshape(count, count)
    chosen = chosen_scale(density, measure, scale)
    shade = shading(values, areas, log=chosen.log)

    def logs() -> Array:
        ends = torch.meshgrid(*(middles + low for low in view.low), indexing="ij")
        points = torch.stack(ends, dim=-1).reshape(-1, 2)
        return log_natural(density, values.ravel(), points, measure).reshape(count, count)

    return Coloured(shade.places(values), shade, chosen.why, logs)


def average_note(count: int) -> str:
    """What a picture of `count` pixels along a side says of peaks that are narrower."""
    return f"peaks narrower than 1/{count} of a side are averaged over it"
