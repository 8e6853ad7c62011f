"""Pictures on the canonical square, whose edges are marked where they are one, or a lattice's cell."""

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
from orbiflow.density.spaces import QuotientSpace, Space
from orbiflow.drawing import CENTER_COLOURS, Sheet, center_sign, mark_symmetry
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import CrystallographicGroup, DirichletDomain, symmetry_elements

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_GRID, _FINE_GRID = 240, 360
"""Pixels along a side at which a density is evaluated: of a flow, and with kernels beside it."""

EDGE_COLOURS = ("#d95f02", "#1f78b4")
"""Colours of the two pairs of edges that are one edge each."""

HEAD = 0.035
"""Length of an arrow's head on a screen, in sides of the square."""

SCREEN = frames.Room(6.67, 3.6, 11.52, 4.2, 3.33, 1.52)
"""Room on a screen, with a title above."""

TURNS, SIGNS = {2: "half", 4: "quarter"}, {2: "Lenses", 4: "Squares"}
"""Names of the turns of cone points, and of their signs."""

CROWDED = "dots crowd where the square shrinks areas"


class Square(Ground):
    """The canonical square of a two-dimensional space."""

    def __init__(self, space: Space, settings: PlotSettings) -> None:
        frames.require_plane(space)
        self.space = space
        self.view = frames.view_of(space, settings.names, settings.center)

    def places(self, points: Tensor) -> Array:
        return self.view.places(points)

    def pixels_for(self, density: Density) -> int:
        return _FINE_GRID if density.has_fine_detail else _GRID

    def pixels(self, count: int) -> Pixels:
        middles = (torch.arange(count, dtype=torch.float64) + 0.5) / count
        grid = torch.stack(torch.meshgrid(middles, middles, indexing="xy"), dim=-1)
        points = self.view.to_chart(grid.reshape(-1, 2))
        areas = self.space.log_area(points).exp().numpy()
        if frames.real_spans(self.space):  # the window is even in the data
            areas = np.ones_like(areas)
        side, every = square_pixel(self.space, 1 / count), np.ones((count, count), bool)
        size = f"1/{count} of a side"
        return Pixels(points, every, every.ravel(), areas, side, size, (0, 1, 0, 1))

    def room(self, sheet: Sheet, label: str, ticks: Sequence[str]) -> frames.Room:
        if not sheet.printed:
            return SCREEN
        edges = (5.4, 3.8, 0.8) if self._has_ticks else (1.0, 2.8, 2.8)
        return frames.printed_room(sheet, *edges, label, ticks)

    def panels_room(self, sheet: Sheet) -> tuple[frames.Room, bool]:
        edges = (5.4, 4.2, 1.6, 2.4, 4.2) if self._has_ticks else (1.0, 1.0, 1.0, 2.4, 1.6)
        room, stacked = (
            frames.Room(*edges, 0.0),
            sheet.printed and sheet.width < frames.NARROW_INCHES,
        )
        return (room._replace(gap=room.below + 2.0) if stacked else room), stacked

    def draw_axes(self, axes: Axes, sheet: Sheet, side: float, panel: frames.Panel) -> None:
        """Draw ticks, edges with their arrows, and cone points with their places in the data."""
        axes.set_xlim(0, 1)
        axes.set_ylim(0, 1)
        axes.set_aspect("equal")
        self._draw_ticks(axes, sheet, side, panel.labelled)
        # signs that can be made out in a small square and are no larger than letters in a large one
        head = 1.1 * sheet.em / side if sheet.printed else HEAD
        real = frames.real_spans(self.space)
        for spine in axes.spines.values():
            spine.set_visible(bool(real))
            spine.set_color("#8a8a86")
        for order, pair in enumerate([] if real else edge_pairs(self.space.group)):
            for edge in pair:
                _draw_edge(axes, edge, EDGE_COLOURS[order % 2], order + 1, sheet, head)
        for corner, order in cone_points(self.space.group):
            sign = np.array(corner) + center_sign(order, 0.5 * head)
            axes.fill(
                *sign.T, facecolor=CENTER_COLOURS[order], edgecolor="#ffffff",
                linewidth=0.08 * sheet.text, zorder=8, clip_on=False,
            )  # fmt: skip
            if panel.alone:
                self._write_place(axes, corner, sheet)

    def caption(self, notes: Sequence[str], dots: tuple[int, int] | None) -> str:
        parts = list[str]()
        if not frames.real_spans(self.space):
            parts += ["The edges with one arrow head are one edge, and so are those with two"]
        parts += [
            f"{SIGNS[order]} are cone points of a {TURNS[order]} turn, which no flow moves"
            for order in self._orders
        ]
        parts += ["Dots are points"] if dots else []
        parts += [CROWDED] if dots and self.space.is_round else []
        return frames.sentences([*parts, *notes])

    @property
    def _has_ticks(self) -> bool:
        return self.space.unit is not None

    @property
    def _orders(self) -> list[int]:
        return sorted({order for _, order in cone_points(self.space.group)}, reverse=True)

    def _draw_ticks(self, axes: Axes, sheet: Sheet, side: float, labelled: bool) -> None:
        size = sheet.text
        axes.tick_params(
            labelsize=sheet.small, length=0.3 * size, pad=0.4 * size, width=sheet.pen(0.8)
        )
        axes.set_xticks([])
        axes.set_yticks([])
        if not self._has_ticks:
            return
        style: dict[str, Any] = {"fontsize": size, "color": frames.INK, "parse_math": False}
        label, at, texts = frames.angle_axis(self.view, 0)
        axes.set_xticks(at, frames.legible(at, texts, side, sheet.small))
        axes.set_xlabel(frames.shortened(label, side, sheet), **style)
        label, at, texts = frames.angle_axis(self.view, 1)
        axes.set_yticks(at, texts if labelled else [""] * len(at))
        if labelled:
            axes.set_ylabel(frames.shortened(label, side, sheet), labelpad=0.2 * size, **style)

    def _write_place(self, axes: Axes, corner: tuple[float, float], sheet: Sheet) -> None:
        """Write where in the data's columns a cone point lies."""
        row = self.space.from_chart(torch.tensor([corner], dtype=torch.float64))[0]
        if len(row) == 2:
            texts = map(frames.degrees_text, row.round() + 0.0, ("NS", "EW"))
        else:
            texts = map("{} {:.2f}".format, self.space.columns, row.round(2) + 0.0)
        axes.annotate(
            ", ".join(texts).replace("-", "\N{MINUS SIGN}"), corner,
            xytext=(0, sheet.text * (2 * corner[1] - 1)), textcoords="offset points",
            ha="right" if corner[0] else "left", va="bottom" if corner[1] else "top",
            fontsize=sheet.small, color=frames.INK,
        )  # fmt: skip


def edge_pairs(group: CrystallographicGroup) -> list[tuple[Array, Array]]:
    """Return pairs of edges (2, 2) of the unit square that `group` identifies, start with start.

    Neighbouring edges both start at the corner where they meet.
    """
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    edges = [corners[[0, 3]], corners[[1, 2]], corners[[0, 1]], corners[[3, 2]]]
    middle = np.full(2, 0.5)
    pairs: list[tuple[Array, Array]] = []
    for g in group.elements_near(middle, 1.5, source=middle)[1:]:
        for k, edge in enumerate(edges):
            for other in edges[k + 1 :]:
                image = g(edge)
                if np.allclose(image.mean(axis=0), other.mean(axis=0)):
                    turn = -1 if np.allclose(image[1], edge[1]) else 1
                    pairs.append((edge[::turn].copy(), image[::turn].copy()))
    return pairs


def cone_points(group: CrystallographicGroup) -> list[tuple[tuple[float, float], int]]:
    """Return the corners of the square that are rotation centres, with their orders."""
    centers = symmetry_elements(group, np.full(2, 0.5), 1.0).centers
    corners = [(x, y) for x in (0.0, 1.0) for y in (0.0, 1.0)]
    return [(c, sign.order) for c in corners for sign in centers if np.allclose(sign.point, c)]


def _draw_edge(
    axes: Axes, edge: Array, colour: str, heads: int, sheet: Sheet, length: float
) -> None:
    """Draw an edge with as many arrow heads in its middle as the number of its pair."""
    size = sheet.text
    width = (0.16 if sheet.printed else 0.28) * size
    axes.plot(*edge.T, color=colour, linewidth=width, clip_on=False, zorder=6)
    along = edge[1] - edge[0]
    across = np.array([-along[1], along[0]])
    for k in range(heads):
        tip = edge[0] + (0.5 + length * (0.86 + k - (heads - 1) / 2)) * along
        back = tip - length * along
        ring = np.stack([tip, back + 0.46 * length * across, back - 0.46 * length * across])
        axes.fill(
            *ring.T, facecolor=colour, edgecolor="#ffffff", linewidth=0.06 * size,
            clip_on=False, zorder=7,
        )  # fmt: skip


PIXELS = 300
"""Pixels along the longer side at which a density is evaluated."""

DOMAIN, CELL = "#ffd166", "#111111"
"""Colours of the outlines of the fundamental domain and of the lattice's cell."""


class Cell(Square):
    """A lattice cell of a plane group in the data's coordinates, about the fundamental domain."""

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
