"""A picture of the flow that carries a base distribution to a density."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from PIL import Image
from torch import Tensor

from orbiflow.density.models import Density, FlowDensity
from orbiflow.density.pictures.axes import INK, require_plane, space_title, view_of
from orbiflow.density.pictures.frames import Room, colour_bar, make_frame, printed_room
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.drawing import Picture, Sheet, draw_flow, draw_magnitude
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import CrystallographicGroup

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CELLS = 3
"""Number of cells along each side of the picture."""

SPEED = "speed, sides of the square per unit time"
SCREEN = Room(1.8, 3.8, 10.8, 2.7, 1.7, 1.5)
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
    view = view_of(space, center=None if space.is_round else settings.center)
    low, high = 0.5 - CELLS / 2, 0.5 + CELLS / 2
    window = (low, low, high, high)
    printed = printed_room(sheet, 0.4, 0.6, 0.6, SPEED, ("0.00",))
    frame = make_frame(sheet, printed if sheet.printed else SCREEN)
    axes = frame.axes
    axes.set_xlim(low, high)
    axes.set_ylim(low, high)  # `draw_magnitude` keeps these

    def field(points: Tensor) -> Tensor:
        return mean_field(density, view.to_chart(points))

    draw_magnitude(axes, field, window)
    draw_flow(axes, field, space.group, window, pen=sheet.pen)
    draw_cells(axes, space.group, window, pen=sheet.pen)
    colour_bar(axes.images[0], frame, sheet, SPEED)
    axes.set_axis_off()
    weight, flow = flow_of(density)
    part = "" if flow is density else f", {100 * weight:.0f} % of the density"
    title = f"Flow{part} on the {space_title(space)}"
    signs = "canonical square outlined, its images thin"
    if not sheet.printed:
        frame.figure.text(0.03, 0.025, f"{title}: {signs}", fontsize=sheet.text, color=INK)
    return Picture(frame.figure, sheet, title, f"The {signs}.")


def flow_of(density: Density) -> tuple[float, FlowDensity]:
    """Return the weight and the density of the flow to draw."""
    part = density.flow_part
    if part is None:
        raise OrbiflowError("the density has no flow: draw another picture of it")
    return part


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
    flow = flow_of(density)[1].flow
    like = next(iter(flow.parameters()), points)
    vectors = [field(points.to(like)) for field in flow.segments]
    return torch.stack(vectors).mean(dim=0).double().cpu()


def draw_cells(
    axes: Axes, group: CrystallographicGroup, window: Any, *, pen: Callable[[float], float] = float
) -> None:
    """Draw the images of the canonical square in a window, a letter F in each, the square outlined."""
    thin = pen(0.7)
    for t in np.arange(np.floor(window[0]), np.ceil(window[2]) + 1):
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
