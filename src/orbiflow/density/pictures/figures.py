"""Figures of a density, of points beside it, and of its flow: on the canonical square or on a map."""

# matplotlib types no keyword arguments
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import torch
from PIL import Image
from torch import Tensor

from orbiflow.density.models import Density
from orbiflow.density.pictures import frames, grounds
from orbiflow.density.pictures.coastlines import coastlines_for
from orbiflow.density.pictures.colours import bar_label, bar_ticks
from orbiflow.density.pictures.frames import INK, chart_points, require_plane, space_title, view_of
from orbiflow.density.pictures.grounds import Ground
from orbiflow.density.pictures.maps import Map
from orbiflow.density.pictures.projections import chosen_map
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.density.pictures.square import Cell, Square
from orbiflow.density.regions import DensityRegion
from orbiflow.density.spaces import Space
from orbiflow.drawing import Picture, Sheet, draw_flow, draw_magnitude
from orbiflow.symmetry import CrystallographicGroup

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GroundName = Literal["square", "map"]


def plane_ground(space: Space, settings: PlotSettings) -> Square:
    """Return the canonical square or, where there is none, the lattice's cell."""
    return (Square if space.has_square else Cell)(space, settings)


def _ground(
    ground: Ground | GroundName, space: Space, points: Tensor | None, settings: PlotSettings
) -> Ground:
    """Return the ground of a name; a map is the one that suits the points (N, 2)."""
    if ground == "square":
        return plane_ground(space, settings)
    if isinstance(ground, Ground):
        return ground
    about = chart_points(space, torch.empty(0, 2) if points is None else points)
    return Map(space, chosen_map(space, about, settings), coastlines_for(space, settings))


def density_picture(
    density: Density,
    samples: Tensor | None = None,
    settings: PlotSettings | None = None,
    *,
    sheet: Sheet | None = None,
    ground: Ground | GroundName = "square",
    regions: Sequence[DensityRegion] | None = None,
) -> Picture:
    """Draw a density on the canonical square, on a lattice cell, or directions and axes on a map.

    Edges of the square of one colour and number of arrow heads are one edge, in the sense of the
    arrows. Ticks are in the user's units where the chart is a plain rescaling of them (torus, Klein
    bottle). A map has its graticule, and the density is evaluated at each of its pixels, which end at
    a curve; of axes it shows one end. Peaks narrower than a pixel are averaged over it, and a note
    says so.

    Args:
        density: A density on a two-dimensional space.
        samples: Data or samples to draw as dots, chart points (N, 2). Of too many a random choice is
            drawn, always the same; dots are smaller where they crowd, so that peaks stay in sight.
        settings: How it is drawn.
        sheet: The sheet. Default: that of the settings.
        ground: What it is drawn on, "square" or "map".
        regions: Regions to draw lines around. Default: those of the settings.

    Raises:
        OrbiflowError: If the space has another dimension, or samples or settings do not fit it.
    """
    settings = settings or PlotSettings()
    sheet, ground = sheet or settings.sheet, _ground(ground, density.space, samples, settings)
    regions = grounds.region_lines(density, settings) if regions is None else regions
    colouring = ground.colouring(density, settings)
    shade = colouring.shade
    label = bar_label(shade, ground.space, settings.measure)
    places = None if samples is None else ground.places(samples)
    most = settings.samples or grounds.MAX_DOTS
    masses = sorted(settings.regions or ())
    notes = [*([] if places is None else [grounds.SMALLER]), colouring.reason]
    notes += [grounds.region_note(masses)] if masses else []
    notes += [colouring.averaging] if colouring.averaging else []
    count = None if places is None else (min(most, len(places)), len(places))
    caption = ground.caption(notes, count)
    room = ground.room(sheet, label, [tick.text for tick in bar_ticks(shade)])
    room = room.with_words(caption, sheet)
    page = frames.PanelPage(sheet, room, ground.aspect)
    axes, side = page.axes(), page.side
    image = colouring.draw(axes)
    colouring.draw_regions(axes, regions, sheet)
    if places is not None:
        scale = _dot_scale(ground, sheet, side)
        grounds.draw_dots_over(axes, places, side / ground.width, limit=most, scale=scale)
    ground.draw_axes(axes, sheet, side, frames.Panel())
    frames.colour_bar(image, page, sheet, label, shade)
    title = f"Density on the {space_title(ground.space)}"
    if not sheet.printed:
        ground.write_title(axes, sheet, title)
        frames.write_caption(page.figure, caption, sheet)
    return Picture(page.figure, sheet, title, caption)


def samples_picture(
    density: Density,
    data: Tensor | None,
    samples: Tensor,
    settings: PlotSettings | None = None,
    *,
    sheet: Sheet | None = None,
    ground: Ground | GroundName = "square",
) -> Picture:
    """Draw data (N, 2) and samples (M, 2) on two grounds; without data, the density and samples.

    Points are of the chart, such as `space.to_chart(table)` and `density.sample((M,))`, as many of
    each.
    """
    settings, points = settings or PlotSettings(), samples if data is None else data
    sheet, ground = sheet or settings.sheet, _ground(ground, density.space, points, settings)
    panels = {"data": data, "samples": samples}
    places = {n: ground.places(points) for n, points in panels.items() if points is not None}
    count = min(
        [
            settings.samples or grounds.MAX_DOTS,
            *(len(rows) for rows in places.values() if len(rows)),
        ]
    )
    colouring = ground.colouring(density, settings) if data is None else None
    bar = "from the least (dark) to the largest (light) density"
    words = ground.samples_caption([] if colouring is None else [f"{colouring.reason}, {bar}"])
    room, stacked = ground.panels_room(sheet)
    room = room.with_words(words, sheet)
    shape, gap = (2, 1) if stacked else (1, 2), sheet.em * room.gap
    page = frames.PanelPage(sheet, room, ground.aspect, shape, (gap, gap))
    for number, (name, points) in enumerate(panels.items()):
        axes, side = page.axes(number), page.side
        if colouring is not None and points is None:
            colouring.draw(axes)
        else:
            ground.fill(axes)
            scale = _dot_scale(ground, sheet, side)
            grounds.draw_dots(axes, places[name], 0.5, limit=count, fill=grounds.DOT, scale=scale)
        panel = frames.Panel(False, stacked or number == 0, points is not None)
        ground.draw_axes(axes, sheet, side, panel)
        head = "density"
        if points is not None:
            shown = min(count, len(places[name]))
            head = f"{f'{shown} of ' if shown < len(points) else ''}{len(points)} {name}"
        axes.set_title(head, fontsize=sheet.text, pad=ground.title_gap * sheet.text)
    if not sheet.printed:
        frames.write_caption(page.figure, words, sheet)
    title = (
        f"{'Density' if data is None else 'Data'} and samples on the {space_title(ground.space)}"
    )
    return Picture(page.figure, sheet, title, words)


def _dot_scale(ground: Ground, sheet: Sheet, side: float) -> float:
    """Return what to multiply the area of dots by, on axes `side` inches wide: 1 on a screen."""
    return max(0.2, (max(1.0, side / ground.aspect) / 5.6) ** 2) if sheet.printed else 1.0


CELLS = 3
"""Number of cells along each side of the picture."""

SPEED = "speed, sides of the square per unit time"
SCREEN = frames.Room(1.8, 3.8, 10.8, 2.7, 1.7, 1.5)
"""Room on a screen, with a caption below."""


def flow_picture(
    density: Density, settings: PlotSettings | None = None, *, sheet: Sheet | None = None
) -> Picture:
    """Draw the time mean of a flow's vector fields, over the canonical square and its images.

    The square is outlined; the letter F in every cell shows how the cell is the square's image. Of a
    density with kernels beside the flow, the flow's part alone is drawn.

    Args:
        density: A density on a two-dimensional space.
        settings: How it is drawn.
        sheet: The sheet. Default: that of the settings.

    Raises:
        OrbiflowError: If the space has another dimension, or a centre does not fit.
    """
    settings, space = settings or PlotSettings(), density.space
    sheet = sheet or settings.sheet
    require_plane(space)
    view = view_of(space, center=settings.center)
    low, high = 0.5 - CELLS / 2, 0.5 + CELLS / 2
    window = (low, low, high, high)
    printed = frames.printed_room(sheet, 0.4, 0.6, 0.6, SPEED, ("0.00",))
    page = frames.PanelPage(sheet, printed if sheet.printed else SCREEN)
    axes = page.axes()
    axes.set_xlim(low, high)
    axes.set_ylim(low, high)  # `draw_magnitude` keeps these

    def field(points: Tensor) -> Tensor:
        return mean_field(density, view.to_chart(points))

    draw_magnitude(axes, field, window)
    draw_flow(axes, field, space.group, window, pen=sheet.pen)
    draw_cells(axes, space.group, window, pen=sheet.pen)
    frames.colour_bar(axes.images[0], page, sheet, SPEED)
    axes.set_axis_off()
    weight, flow = carried_part(density)
    part = "" if flow is density else f", {100 * weight:.0f} % of the density"
    title = f"Flow{part} on the {space_title(space)}"
    signs = "canonical square outlined, its images thin"
    if not sheet.printed:
        page.figure.text(0.03, 0.025, f"{title}: {signs}", fontsize=sheet.text, color=INK)
    return Picture(page.figure, sheet, title, f"The {signs}.")


def carried_part(density: Density) -> tuple[float, Density]:
    """Return the first part that a flow carries, with its weight; without one, the density itself."""
    return next(
        ((weight, part) for weight, part in density.parts() if part.is_carried), (1.0, density)
    )


def few_colours(png: bytes) -> bytes:
    """Return a picture of a flow in 256 colours, a third of the bytes."""
    buffer = io.BytesIO()
    # no dither: it would triple the bytes
    few = Image.open(io.BytesIO(png)).convert("RGB").quantize(kmeans=1, dither=Image.Dither.NONE)
    few.save(buffer, "PNG", optimize=True)
    return buffer.getvalue()


@torch.no_grad()
def mean_field(density: Density, points: Tensor) -> Tensor:
    """Return the time mean of the flow's fields (..., d) at chart points (..., d), float64."""
    return carried_part(density)[1].drift(points)


def draw_cells(
    axes: Axes, group: CrystallographicGroup, window: Any, *, pen: Callable[[float], float] = float
) -> None:
    """Draw the images of the canonical square in a window, a letter F in each, the square outlined."""
    thin = pen(0.7)
    for t in range(math.floor(window[0]), math.ceil(window[2]) + 1):
        axes.axvline(t, color="#ffffff", linewidth=thin, alpha=0.7, zorder=4)
        axes.axhline(t, color="#ffffff", linewidth=thin, alpha=0.7, zorder=4)
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]])
    for colour, width in (("#111111", 3.6), ("#ffd166", 1.8)):
        axes.plot(*square.T, color=colour, linewidth=pen(width), solid_joinstyle="miter", zorder=5)
    letter = np.array(
        [[0, 0], [0, 5], [3, 5], [3, 4], [1, 4], [1, 3], [2.4, 3], [2.4, 2], [1, 2], [1, 0]]
    )
    letter = 0.07 + 0.026 * letter
    middle = np.full(2, 0.5)
    for g in group.elements_near(middle, window[2] - window[0], source=middle):
        axes.fill(
            *g(letter).T, facecolor="#ffd166", edgecolor="#111111", linewidth=pen(0.5),
            zorder=6,
        )  # fmt: skip
