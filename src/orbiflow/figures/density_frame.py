"""The square of a flat picture of a density and the room around it, in units of the texts' size."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from orbiflow.figures.density_axes import ANGLE_AXES, INK, LETTER, View
from orbiflow.figures.sheet import Sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage


class Room(NamedTuple):
    """In ems; `right` holds the colour bar, `gap` from the square and `bar` wide."""

    left: float
    below: float
    right: float
    above: float
    gap: float
    bar: float


SCREEN = Room(6.67, 9.29, 11.52, 5.26, 3.33, 1.52)
"""With a title above, and a legend of five lines below."""


class Framed(NamedTuple):
    """A figure, the axes of its square of `side` inches, and those of its colour bar."""

    figure: Figure
    axes: Axes
    bar: Axes
    side: float


def framed(
    sheet: Sheet,
    view: View | None,
    label: str = "",
    ticks: Sequence[str] = ("0.00",),
    *,
    room: Room | None = None,
) -> Framed:
    """A square with a colour bar beside it.

    Args:
        sheet: whose width all of it has.
        view: of the square, whose ticks and labels need room; None where there are none.
        label, ticks: of the bar; in print a long label takes more lines.
        room: in place of what sheet and view ask for.
    """
    room = room or (_printed(sheet, view, label, ticks) if sheet.printed else SCREEN)
    side = sheet.width - sheet.em * (room.left + room.right)
    height = side + sheet.em * (room.below + room.above)
    figure = sheet.figure(height)

    def axes(left: float, width: float) -> Axes:
        box = (
            left / sheet.width, sheet.em * room.below / height, width / sheet.width, side / height
        )  # fmt: skip
        return figure.add_axes(box)

    left = sheet.em * room.left
    bar = axes(left + side + sheet.em * room.gap, sheet.em * room.bar)
    return Framed(figure, axes(left, side), bar, side)


def side_by_side(sheet: Sheet, view: View) -> tuple[Figure, tuple[Axes, Axes], float]:
    """A figure with two squares, and their side in inches: ticks have texts below, and at the left."""
    angles = view.space.name in ANGLE_AXES
    left, right, gap, below = (5.4, 1.6, 3.0, 4.2) if angles else (1.0, 1.0, 1.6, 1.0)
    side = (sheet.width - sheet.em * (left + gap + right)) / 2
    height = side + sheet.em * (below + 2.4)
    figure = sheet.figure(height)
    first, second = (
        figure.add_axes(
            (
                (sheet.em * left + k * (side + sheet.em * gap)) / sheet.width,
                sheet.em * below / height, side / sheet.width, side / height,
            )
        )
        for k in (0, 1)
    )  # fmt: skip
    return figure, (first, second), side


def _printed(sheet: Sheet, view: View | None, label: str, ticks: Sequence[str]) -> Room:
    """No more than ticks, labels and places of cone points take."""
    if view is None:
        left, below, above = 0.4, 0.6, 0.6
    elif view.space.name in ANGLE_AXES:
        left, below, above = 5.4, 3.8, 0.8
    else:
        left, below, above = 1.0, 2.8, 2.8
    gap, bar = 1.4, 1.1
    right = gap + bar + 1.4 + max(map(len, ticks), default=0) * LETTER * sheet.small / sheet.text
    for lines in range(1, 6):  # each takes room from the square, and so from the lines
        room = Room(left, below, right + 0.4 + 1.25 * lines, above, gap, bar)
        side = sheet.width - sheet.em * (room.left + room.right)
        if len(bar_label_lines(sheet, label, side)) <= lines:
            break
    return room


def bar_label_lines(sheet: Sheet, label: str, side: float) -> list[str]:
    """A bar's label in lines no longer than `side` inches, about as long as each other."""
    most = max(12, int(side / (LETTER * sheet.em)))
    lines = -(-len(label) // most)
    return textwrap.wrap(label, min(most, len(label) // max(lines, 1) + 6)) or [""]


def colour_bar(
    image: AxesImage, frame: Framed, sheet: Sheet, label: str, extend: str = "neither"
) -> None:
    """The bar of an image's colours."""
    bar = frame.figure.colorbar(image, cax=frame.bar, extend=extend)
    if sheet.printed:
        label = "\n".join(bar_label_lines(sheet, label, frame.side))
    bar.set_label(label, fontsize=sheet.text, color=INK)
    bar.ax.tick_params(labelsize=sheet.small, width=sheet.pen(0.8), length=0.3 * sheet.text)
    bar.ax.yaxis.get_offset_text().set_fontsize(sheet.small)
    bar.outline.set_visible(False)
