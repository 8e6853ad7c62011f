"""Pictures on the plane of a plane group, whose fundamental domain is outlined."""

# matplotlib types no keyword arguments
# pyright: reportUnknownMemberType=false

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models import Density
from orbiflow.density.pictures import frames
from orbiflow.density.pictures.colours import square_pixel
from orbiflow.density.pictures.grounds import Ground, Pixels
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.density.pictures.square import Square
from orbiflow.density.spaces import QuotientSpace, Space
from orbiflow.drawing import Sheet, mark_symmetry
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import DirichletDomain

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PIXELS = 300
"""Pixels along the longer side at which a density is evaluated."""

DOMAIN, CELL = "#ffd166", "#111111"
"""Colours of the outlines of the fundamental domain and of the lattice's cell."""


class Cell(Square):
    """A lattice cell of a plane group in the data's coordinates, about the fundamental domain."""

    caption_below = True

    def __init__(self, space: Space, settings: PlotSettings) -> None:
        group = space.data_group
        if group is None or space.dim != 2:
            raise OrbiflowError(
                f"a picture needs two dimensions, this {space.name} has {space.dimensions}"
            )
        names = settings.names
        if isinstance(space, QuotientSpace) and space.cartesian is not space:
            space, names = space.cartesian, None  # angles and marks are those of the plane
        self.space, self.group = space, group
        self.view = frames.view_of(space, names, settings.center)
        site = space.from_chart(torch.tensor(space.domain.site)[None])[0]
        self.domain = DirichletDomain(group, site)
        corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) - 0.5
        self.rings = (site + corners @ group.lattice.T, self.domain.corners())
        every = np.concatenate(self.rings)
        self.low, self.high = every.min(axis=0), every.max(axis=0)
        self.width, height = map(float, self.high - self.low)
        self.aspect = self.width / height

    def places(self, points: Tensor) -> Array:
        data = self.space.from_chart(frames.chart_points(self.space, points))
        return self.domain.project(data)

    def pixels_for(self, density: Density) -> int:  # noqa: ARG002
        return PIXELS

    def pixels(self, count: int) -> Pixels:
        sides = self.high - self.low
        step = float(max(sides)) / count
        columns, rows = (round(float(side) / step) for side in sides)
        x: Array = self.low[0] + sides[0] * (np.arange(columns) + 0.5) / columns
        y: Array = self.low[1] + sides[1] * (np.arange(rows) + 0.5) / rows
        points = self.space.cover(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
        side = square_pixel(self.space, step / self.space.volume**0.5)
        extent = (self.low[0], self.high[0], self.low[1], self.high[1])
        size, every = f"1/{count} of the longer side", np.ones((rows, columns), bool)
        return Pixels(points, every, every.ravel(), None, side, size, extent)

    def room(self, sheet: Sheet, label: str, ticks: Sequence[str]) -> frames.Room:
        if sheet.printed:
            return super().room(sheet, label, ticks)
        return frames.Room(6.67, 3.6, 11.52, 4.2, 3.33, 1.52)

    def draw_axes(self, axes: Axes, sheet: Sheet, side: float, panel: frames.Panel) -> None:
        """Draw ticks, outlines, and the marks of the group's centres and lines."""
        axes.set_xlim(self.low[0], self.high[0])
        axes.set_ylim(self.low[1], self.high[1])
        axes.set_aspect("equal")
        for spine in axes.spines.values():
            spine.set_visible(False)
        window = (*self.low.tolist(), *self.high.tolist())
        size = 0.5 * (1.1 * sheet.em / side if sheet.printed else 0.03) * self.width
        mark_symmetry(axes, self.group, window, size=size, pen=sheet.pen)
        for ring, colour, width in zip(self.rings, (CELL, DOMAIN), (0.8, 1.8), strict=True):
            closed = np.concatenate([ring, ring[:1]])
            style: dict[str, Any] = {"solid_joinstyle": "miter", "zorder": 6, "clip_on": False}
            axes.plot(*closed.T, color=CELL, linewidth=sheet.pen(width + 1.0), **style)
            axes.plot(*closed.T, color=colour, linewidth=sheet.pen(width), **style)
        self._draw_ticks(axes, sheet, side, panel.labelled)

    def _draw_ticks(self, axes: Axes, sheet: Sheet, side: float, labelled: bool) -> None:
        from matplotlib.ticker import MaxNLocator

        size = sheet.text
        style: dict[str, Any] = {"fontsize": size, "color": frames.INK, "parse_math": False}
        axes.tick_params(
            labelsize=sheet.small, length=0.3 * size, width=sheet.pen(0.8), labelleft=labelled
        )
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(MaxNLocator(5))
        first, second = (frames.cut(name, frames.MAX_NAME) for name in self.view.names)
        axes.set_xlabel(frames.shortened(first, side, sheet), **style)
        if labelled:
            axes.set_ylabel(frames.shortened(second, side, sheet), **style)

    def caption(self, notes: Sequence[str], dots: tuple[int, int] | None) -> str:
        parts = [
            "Yellow outlines the fundamental domain, which holds each point of the space once",
            "black outlines a cell of the lattice",
            "signs are centres of rotation, solid lines mirrors, dashed ones glides",
        ]
        parts += ["Dots are points, in the domain"] if dots else []
        return frames.sentences([*parts, *notes])

    write_on_screen = Ground.write_on_screen  # no legend
