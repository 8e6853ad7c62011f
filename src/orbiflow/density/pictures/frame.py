"""The axes of a flat picture of a density and the room around them, in units of the texts' size."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from orbiflow.density.pictures.axes import (
    ANGLE_AXES,
    INK,
    LETTER,
    View,
)
from orbiflow.density.pictures.scale import (
    Shade,
    bar_ticks,
    minor_places,
)
from orbiflow.drawing import Sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage


class Room(NamedTuple):
    """In ems, round the axes of a picture.

    - `gap`, `bar`: from the axes to the colour bar, and how wide that is.
    - `under`: whether the bar is below the axes and within `below`, or beside them and within `right`.
    """

    left: float
    below: float
    right: float
    above: float
    gap: float
    bar: float
    under: bool = False


SCREEN = Room(6.67, 10.4, 11.52, 5.26, 3.33, 1.52)
"""With a title above, and a legend of five lines below."""

NARROW = 70 / 25.4
"""Inches of a printed figure below which there is no room beside the axes."""


class Framed(NamedTuple):
    """A figure, its axes, `side` inches wide, those of its colour bar, and whether that is below."""

    figure: Figure
    axes: Axes
    bar: Axes
    side: float
    under: bool = False


def framed(
    sheet: Sheet,
    view: View | None,
    label: str = "",
    ticks: Sequence[str] = ("0.00",),
    *,
    room: Room | None = None,
    aspect: float = 1.0,
) -> Framed:
    """Axes with a colour bar beside them, or, where the sheet is narrow, below.

    Args:
        sheet: whose width all of it has.
        view: of the square, whose ticks and labels need room; None where there are none.
        label, ticks: of the bar; in print a long label takes more lines.
        room: in place of what sheet and view ask for.
        aspect: of the axes, width over height.
    """
    room = room or (_printed(sheet, view, label, ticks) if sheet.printed else SCREEN)
    side = sheet.width - sheet.em * (room.left + room.right)
    inner = side / aspect
    height = inner + sheet.em * (room.below + room.above)
    figure = sheet.figure(height)

    def axes(left: float, below: float, width: float, high: float) -> Axes:
        return figure.add_axes(
            (left / sheet.width, below / height, width / sheet.width, high / height)
        )

    left, below = sheet.em * room.left, sheet.em * room.below
    gap, thick = sheet.em * room.gap, sheet.em * room.bar
    if room.under:
        bar = axes(left, below - gap - thick, side, thick)
    else:
        bar = axes(left + side + gap, below, thick, inner)
    return Framed(figure, axes(left, below, side, inner), bar, side, room.under)


def two_panels(
    sheet: Sheet, room: Room, aspect: float = 1.0, *, stacked: bool = False
) -> tuple[Figure, tuple[Axes, Axes], float]:
    """A figure with two equal axes, `room.gap` apart, side by side or the first above the second.

    Returns:
        The figure, its axes, and their width in inches.
    """
    left, gap, right = (sheet.em * room[k] for k in (0, 4, 2))
    side = sheet.width - left - right
    side = side if stacked else (side - gap) / 2
    inner = side / aspect
    below = sheet.em * room.below
    height = below + sheet.em * room.above + (2 * inner + gap if stacked else inner)
    figure = sheet.figure(height)
    corners = [(left, below + inner + gap), (left, below)]
    if not stacked:
        corners = [(left + k * (side + gap), below) for k in (0, 1)]
    first, second = (
        figure.add_axes((x / sheet.width, y / height, side / sheet.width, inner / height))
        for x, y in corners
    )
    return figure, (first, second), side


def _printed(sheet: Sheet, view: View | None, label: str, ticks: Sequence[str]) -> Room:
    """No more than ticks, labels and places of cone points take."""
    if view is None:
        left, below, above = 0.4, 0.6, 0.6
    elif view.space.name in ANGLE_AXES:
        left, below, above = 5.4, 3.8, 0.8
    else:
        left, below, above = 1.0, 2.8, 2.8
    if sheet.width < NARROW:
        return bar_under(sheet, Room(left, below, 1.4, above, below, 1.0), label)
    return bar_beside(sheet, Room(left, below, 0.0, above, 1.4, 1.1), label, ticks)


def bar_under(sheet: Sheet, room: Room, label: str) -> Room:
    """Room for a bar below what takes `room.gap` under the axes, and for its ticks and label."""
    side = sheet.width - sheet.em * (room.left + room.right)
    lines = len(bar_label_lines(sheet, label, side))
    return room._replace(below=room.gap + room.bar + 2.2 + 1.3 * lines, under=True)


def bar_beside(sheet: Sheet, room: Room, label: str, ticks: Sequence[str]) -> Room:
    """Room for a bar at the right of the axes, and for its ticks and label."""
    widest = max(map(len, ticks), default=0) * LETTER * sheet.small / sheet.text
    right = room.gap + room.bar + 1.4 + widest
    made = room
    for lines in range(1, 6):  # each takes room from the square, and so from the lines
        made = room._replace(right=right + 0.4 + 1.25 * lines)
        side = sheet.width - sheet.em * (made.left + made.right)
        if len(bar_label_lines(sheet, label, side)) <= lines:
            break
    return made


def bar_label_lines(sheet: Sheet, label: str, side: float) -> list[str]:
    """A bar's label in lines no longer than `side` inches, about as long as each other."""
    most = max(12, int(side / (LETTER * sheet.em)))
    lines = -(-len(label) // most)
    return textwrap.wrap(label, min(most, len(label) // max(lines, 1) + 6)) or [""]


_DIGIT = 0.66
"""Width of a digit, in ems: wider than the mean of letters."""


def colour_bar(
    image: AxesImage, frame: Framed, sheet: Sheet, label: str, extend: str = "neither"
) -> None:
    """The bar of an image's colours."""
    way = "horizontal" if frame.under else "vertical"
    bar = frame.figure.colorbar(image, cax=frame.bar, extend=extend, orientation=way)
    if sheet.printed or frame.under:
        label = "\n".join(bar_label_lines(sheet, label, frame.side))
    bar.set_label(label, fontsize=sheet.text, color=INK)
    bar.ax.tick_params(
        which="both", labelsize=sheet.small, width=sheet.pen(0.8), length=0.3 * sheet.text
    )
    bar.ax.tick_params(which="minor", length=0.18 * sheet.text)
    bar.ax.yaxis.get_offset_text().set_fontsize(sheet.small)
    bar.outline.set_visible(False)
    if frame.under:  # a few even steps
        from matplotlib.ticker import MaxNLocator

        bar.locator = MaxNLocator(max(2, int(frame.side / (8 * LETTER * sheet.em))))
        bar.update_ticks()


def shade_bar(image: AxesImage, frame: Framed, sheet: Sheet, shade: Shade, label: str) -> None:
    """The bar of a density's colours, with ticks in its own units."""
    extend = {(True, False): "max", (False, True): "min"}.get((shade.cut, shade.faint), "neither")
    colour_bar(image, frame, sheet, label, extend)
    ticks = bar_ticks(shade)
    at, texts = [tick.at for tick in ticks], [tick.text for tick in ticks]
    if frame.under:
        frame.bar.set_xticks(at, spread(at, texts, frame.side, sheet))
        frame.bar.set_xticks(minor_places(shade), minor=True)
    else:
        frame.bar.set_yticks(at, texts)
        frame.bar.set_yticks(minor_places(shade), minor=True)


def spread(at: Sequence[float], texts: Sequence[str], side: float, sheet: Sheet) -> list[str]:
    """Texts along a bar of so many inches, "" for those that would touch the one before.

    >>> spread([0.0, 0.1, 0.9], ["0.00", "0.10", "0.90"], 1.5, Sheet.column())
    ['0.00', '', '0.90']
    """
    letter, end, kept = _DIGIT * sheet.small / 72, -1.0, []
    for place, text in zip(at, texts, strict=True):
        half = letter * (len(text) + 1) / 2
        free = place * side - half > end
        kept.append(text if free else "")
        if free:
            end = place * side + half
    return kept
