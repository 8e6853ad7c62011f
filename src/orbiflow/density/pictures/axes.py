"""Axes of pictures on the canonical square: which window, ticks, edges that are one, cone points."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.pictures.surfaces import edge_pairs
from orbiflow.density.spaces import Space, whole_turn
from orbiflow.drawing import (
    CENTER_COLOURS,
    Sheet,
    center_sign,
)
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import CrystallographicGroup, symmetry_elements

if TYPE_CHECKING:
    from matplotlib.axes import Axes

EDGE_COLOURS = ("#d95f02", "#1f78b4")
"""Of the two pairs of edges that are one edge each."""

INK = "#1a1a1a"
LONGEST_NAME = 40

HEAD = 0.035
"""Length of an arrow's head, in sides of the square."""

LETTER = 0.56
"""Mean width of a letter, in ems."""


class View(NamedTuple):
    """A window of side 1 onto the chart of a space, with the names of the data's columns.

    - `low`: (d,), its lower corner; the square's own except on the torus.
    """

    space: Space
    names: tuple[str, ...]
    low: Array

    def to_chart(self, points: Tensor) -> Tensor:
        """Points (N, d) of the window, [0, 1]^d, as chart points."""
        return points + torch.tensor(self.low, dtype=points.dtype)

    def places(self, points: Tensor) -> Array:
        """Chart points (N, d) in the window, [0, 1]^d.

        Raises:
            OrbiflowError: for points of another shape.
        """
        moved = chart_points(self.space, points) - torch.tensor(self.low)
        # a translation commutes with the torus' group, and is 0 elsewhere
        return self.space.project(moved).numpy()


def chart_points(space: Space, points: Tensor) -> Tensor:
    """Points (N, d) to draw, float64.

    Raises:
        OrbiflowError: for another shape.
    """
    if points.ndim != 2 or points.shape[1] != space.dim:
        raise OrbiflowError(f"expected chart points (N, {space.dim}), got {tuple(points.shape)}")
    return points.detach().double().cpu()


def view_of(
    space: Space, names: Sequence[str] | None = None, center: Sequence[float] | None = None
) -> View:
    """The window of a space's flat pictures.

    Args:
        names: of the data's columns on torus and Klein bottle, default `space.columns`.
        center: of the torus' window, an angle per column in the space's unit; default 0, so that
            angles run from minus half a turn to half a turn.

    Raises:
        OrbiflowError: for another number of names or angles, an angle that is not finite, or a
            centre on another space, whose window is the canonical square.
    """
    names = tuple(space.columns if names is None else names)
    if len(names) != len(space.columns):
        raise OrbiflowError(f"expected {len(space.columns)} names of columns, got {list(names)}")
    if not space.is_torus:
        if center is not None:
            raise OrbiflowError(f"the window is centred on the torus, not on the {space.name}")
        return View(space, names, np.zeros(space.dim))
    turns = np.zeros(space.dim)
    if center is not None:
        turns = np.array(center, dtype=float) / whole_turn(unit_of(space))
    if turns.shape != (space.dim,) or not np.isfinite(turns).all():
        raise OrbiflowError(f"the centre needs {space.dim} finite angles, got {center!r}")
    # 3.14 radians are meant as pi: the ticks would be cut off beside the window's edge
    even = np.round(24 * turns) / 24
    turns = np.where(abs(turns - even) < 1e-3, even, turns)
    return View(space, names, turns - 0.5)


def space_title(space: Space) -> str:
    """The space's name in a sentence.

    >>> from orbiflow.density import make_space
    >>> space_title(make_space("klein-bottle"))
    'Klein bottle'
    """
    return space.name.replace("-", " ").replace("klein", "Klein")


def unit_of(space: Space) -> str:
    """The unit of a space's angles, "" where it has none."""
    return space.unit or ""


def column_name(view: View, column: int) -> str:
    """A column's name, short enough for an axis."""
    name = view.names[column]
    return name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 1]}…"


def axis_label(view: View, column: int) -> str:
    """Name and unit of an angle."""
    return f"{column_name(view, column)} ({unit_of(view.space)})"


def fitted(label: str, side: float, sheet: Sheet) -> str:
    """The label of an axis of so many inches, in print no longer than that.

    >>> fitted("a name that goes on and on (degrees)", 1.5, Sheet.column())
    'a name that g… (degrees)'
    """
    room = int(side / (LETTER * sheet.em))
    if not sheet.printed or len(label) <= room:
        return label
    name, opening, unit = label.rpartition(" (")
    ending = opening + unit if room - len(unit) > 8 else ""
    room -= len(ending)
    return (name if len(name) <= room else f"{name[: room - 1]}…") + ending


def angle_axis(view: View, axis: int) -> tuple[str, list[float], list[str]]:
    """Label, places and texts of the ticks of one axis, for a space that `ANGLE_AXES` has."""
    return ANGLE_AXES[view.space.name](view, axis)


def _torus_axis(view: View, axis: int) -> tuple[str, list[float], list[str]]:
    low = float(view.low[axis])
    quarters = range(math.ceil(4 * low - 1e-9), math.floor(4 * low + 4 + 1e-9) + 1)
    places = [k / 4 - low for k in quarters]
    texts = [angle_text(k / 4, unit_of(view.space)) for k in quarters]
    return axis_label(view, axis), places, texts


def _klein_axis(view: View, axis: int) -> tuple[str, list[float], list[str]]:
    # the first column, theta, goes up: half a turn; phi starts a quarter before 0
    turns = [k / 4 - 0.25 for k in range(5)] if axis == 0 else [k / 8 for k in range(5)]
    texts = [angle_text(t, unit_of(view.space)) for t in turns]
    return axis_label(view, 1 - axis), [k / 4 for k in range(5)], texts


ANGLE_AXES: dict[str, Callable[[View, int], tuple[str, list[float], list[str]]]] = {
    "torus": _torus_axis,
    "klein-bottle": _klein_axis,
}
"""By the name of the space: those whose chart is a plain rescaling of angles."""


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


def degrees(value: float, signs: str) -> str:
    """An angle with the letters of its positive and negative sense, or plain where there are none.

    >>> degrees(-30.0, "NS"), degrees(180.0, "EW"), degrees(330.0, "")
    ('30° S', '180°', '330°')
    """
    if not signs:
        return f"{value:g}°".replace("-", "\N{MINUS SIGN}")
    letter = "" if value in (0, 180, -180) else f" {signs[int(value < 0)]}"
    return f"{abs(value):g}°{letter}"


def dress(
    axes: Axes, view: View, sheet: Sheet, *, places: bool = True, upward: bool = True
) -> None:
    """Ticks, edges with their arrows, and cone points.

    Args:
        axes: square ones.
        places: whether to say where the cone points lie in the data.
        upward: whether the ticks at the left have texts, and the axis its name.
    """
    space, size = view.space, sheet.text
    side = axes.get_position().width * sheet.width
    axes.set_xlim(0, 1)
    axes.set_ylim(0, 1)
    axes.set_aspect("equal")
    for spine in axes.spines.values():
        spine.set_visible(False)
    axes.tick_params(labelsize=sheet.small, length=0.3 * size, pad=0.4 * size, width=sheet.pen(0.8))
    axes.set_xticks([])
    axes.set_yticks([])
    if space.name in ANGLE_AXES:
        label, at, texts = angle_axis(view, 0)
        axes.set_xticks(at, apart(at, texts, side, sheet))
        label = fitted(label, side, sheet)
        axes.set_xlabel(label, fontsize=size, color=INK, parse_math=False)
        label, at, texts = angle_axis(view, 1)
        label = fitted(label, side, sheet)
        axes.set_yticks(at, texts if upward else [""] * len(at))
        if upward:
            axes.set_ylabel(label, fontsize=size, color=INK, labelpad=0.2 * size, parse_math=False)
    # signs that can be made out in a small square and are no larger than letters in a large one
    head = 1.1 * sheet.em / side if sheet.printed else HEAD
    for order, pair in enumerate(edge_pairs(space.group)):
        for edge in pair:
            _arrow(axes, edge, EDGE_COLOURS[order % 2], order + 1, sheet, head)
    for corner, order in cones(space.group):
        sign = np.array(corner) + center_sign(order, 0.5 * head)
        axes.fill(
            *sign.T, facecolor=CENTER_COLOURS[order], edgecolor="#ffffff", linewidth=0.08 * size,
            zorder=8, clip_on=False,
        )  # fmt: skip
        if places:
            _place(axes, space, corner, sheet)


def apart(at: list[float], texts: list[str], side: float, sheet: Sheet) -> list[str]:
    """Texts of ticks along an axis of so many inches: every second one where all would touch."""
    widest = max(map(len, texts)) * LETTER * sheet.small / 72
    if len(at) < 3 or 1.3 * widest < (at[1] - at[0]) * side:
        return texts
    return [text if k % 2 == 0 else "" for k, text in enumerate(texts)]


def check_plane(space: Space) -> None:
    """
    Raises:
        OrbiflowError: unless the space has two dimensions.
    """
    if space.dim != 2:
        raise OrbiflowError(f"a picture needs two dimensions, this {space.name} has {space.dim}")


def _arrow(axes: Axes, edge: Array, colour: str, heads: int, sheet: Sheet, length: float) -> None:
    """An edge with as many heads in its middle as the number of its pair."""
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


def cones(group: CrystallographicGroup) -> list[tuple[tuple[float, float], int]]:
    """Corners of the square that are rotation centres, and their orders."""
    found = symmetry_elements(group, np.full(2, 0.5), 1.0).centers
    corners = [(x, y) for x in (0.0, 1.0) for y in (0.0, 1.0)]
    return [
        (corner, center.order)
        for corner in corners
        for center in found
        if np.allclose(center.point, corner)
    ]


def _place(axes: Axes, space: Space, corner: tuple[float, float], sheet: Sheet) -> None:
    """Where in the data's columns a cone point lies."""
    row = space.from_chart(torch.tensor([corner], dtype=torch.float64))[0]
    if len(space.columns) == 2:
        text = ", ".join(map(degrees, row.round() + 0.0, ("NS", "EW")))
    else:
        row = row.round(2) + 0.0
        text = ", ".join(f"{n} {v:.2f}" for n, v in zip(space.columns, row, strict=True))
    axes.annotate(
        text.replace("-", "\N{MINUS SIGN}"), corner, xytext=(0, sheet.text * (2 * corner[1] - 1)),
        textcoords="offset points", ha="right" if corner[0] else "left",
        va="bottom" if corner[1] else "top", fontsize=sheet.small, color=INK,
    )  # fmt: skip
