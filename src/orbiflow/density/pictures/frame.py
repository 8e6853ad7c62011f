"""The axes of a flat picture, its colour bar, and the room around them in units of the text's size."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from orbiflow.density.pictures.axes import INK, LETTER
from orbiflow.density.pictures.scale import Shade, bar_ticks, minor_places
from orbiflow.drawing import Sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

NARROW = 70 / 25.4
"""Inches of a printed figure below which there is no room beside the axes."""

DIGIT = 0.66
"""Width of a digit in ems: digits are wider than the mean of letters."""


class Room(NamedTuple):
    """The room around the axes of a picture, in ems.

    - `gap`, `bar`: The distance from the axes to the colour bar, and its width; or `gap` alone, the
      distance between two panels.
    - `under`: Whether the bar is below the axes, within `below`, or beside them, within `right`.
    """

    left: float
    below: float
    right: float
    above: float
    gap: float
    bar: float
    under: bool = False

    def with_words(self, words: str, sheet: Sheet) -> Room:
        """Return room for a caption below, which only a picture for a screen has."""
        if sheet.printed:
            return self
        return self._replace(below=self.below + 1.3 * (len(caption_lines(words, sheet)) + 1))


class Frame(NamedTuple):
    """A figure with its axes, `side` inches wide, and those of its colour bar, below or beside."""

    figure: Figure
    axes: Axes
    bar: Axes
    side: float
    under: bool = False


def make_frame(sheet: Sheet, room: Room, aspect: float = 1.0) -> Frame:
    """Make a figure as wide as the sheet, with axes of this width over height and a colour bar."""
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
    return Frame(figure, axes(left, below, side, inner), bar, side, room.under)


def two_panels(
    sheet: Sheet, room: Room, aspect: float = 1.0, *, stacked: bool = False
) -> tuple[Figure, tuple[Axes, Axes], float]:
    """Make a figure with two equal axes, side by side or stacked, and return their width in inches."""
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


def printed_room(
    sheet: Sheet, left: float, below: float, above: float, label: str, ticks: Sequence[str]
) -> Room:
    """Return room in print for a bar: below the axes where the sheet is narrow, else beside them."""
    if sheet.width < NARROW:
        return room_for_bar_below(sheet, Room(left, below, 1.4, above, below, 1.0), label)
    return room_for_bar_beside(sheet, Room(left, below, 0.0, above, 1.4, 1.1), label, ticks)


def room_for_bar_below(sheet: Sheet, room: Room, label: str) -> Room:
    """Add room for a bar, its ticks and its label below what takes `room.gap` under the axes."""
    side = sheet.width - sheet.em * (room.left + room.right)
    lines = len(label_lines(sheet, label, side))
    return room._replace(below=room.gap + room.bar + 2.2 + 1.3 * lines, under=True)


def room_for_bar_beside(sheet: Sheet, room: Room, label: str, ticks: Sequence[str]) -> Room:
    """Add room for a bar, its ticks and its label at the right of the axes."""
    widest = max(map(len, ticks), default=0) * LETTER * sheet.small / sheet.text
    right = room.gap + room.bar + 1.4 + widest
    made = room
    for lines in range(1, 6):  # each takes room from the axes, and so from the lines
        made = room._replace(right=right + 0.4 + 1.25 * lines)
        side = sheet.width - sheet.em * (made.left + made.right)
        if len(label_lines(sheet, label, side)) <= lines:
            break
    return made


def label_lines(sheet: Sheet, label: str, side: float) -> list[str]:
    """Break a bar's label into lines of about equal length, none longer than `side` inches."""
    most = max(12, int(side / (LETTER * sheet.em)))
    lines = -(-len(label) // most)
    return textwrap.wrap(label, min(most, len(label) // max(lines, 1) + 6)) or [""]


def caption_lines(words: str, sheet: Sheet) -> list[str]:
    """Break a caption into lines as wide as a picture for a screen."""
    return textwrap.wrap(words, int(0.94 * 72 * sheet.width / (0.9 * LETTER * sheet.small)))


def write_caption(figure: Figure, words: str, sheet: Sheet) -> None:
    """Write a caption in the lower left corner of a picture for a screen."""
    figure.text(
        0.03, 0.6 * sheet.em / figure.get_size_inches()[1], "\n".join(caption_lines(words, sheet)),
        fontsize=sheet.small, color=INK, va="bottom", linespacing=1.35, parse_math=False,
    )  # fmt: skip


def colour_bar(
    image: AxesImage, frame: Frame, sheet: Sheet, label: str, extend: str = "neither"
) -> None:
    """Draw the bar of an image's colours."""
    way = "horizontal" if frame.under else "vertical"
    bar = frame.figure.colorbar(image, cax=frame.bar, extend=extend, orientation=way)
    if sheet.printed or frame.under:
        label = "\n".join(label_lines(sheet, label, frame.side))
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


def shade_bar(image: AxesImage, frame: Frame, sheet: Sheet, shade: Shade, label: str) -> None:
    """Draw the bar of a density's colours, with ticks in the density's units."""
    extend = {(True, False): "max", (False, True): "min"}.get((shade.cut, shade.faint), "neither")
    colour_bar(image, frame, sheet, label, extend)
    ticks = bar_ticks(shade)
    at, texts = [tick.at for tick in ticks], [tick.text for tick in ticks]
    if frame.under:
        frame.bar.set_xticks(at, without_overlap(at, texts, frame.side, sheet))
        frame.bar.set_xticks(minor_places(shade), minor=True)
    else:
        frame.bar.set_yticks(at, texts)
        frame.bar.set_yticks(minor_places(shade), minor=True)


def without_overlap(
    at: Sequence[float], texts: Sequence[str], side: float, sheet: Sheet
) -> list[str]:
    """Return texts along a bar of `side` inches, "" for those that would touch the one before.

    >>> without_overlap([0.0, 0.1, 0.9], ["0.00", "0.10", "0.90"], 1.5, Sheet.column())
    ['0.00', '', '0.90']
    """
    letter, end, kept = DIGIT * sheet.small / 72, -1.0, []
    for place, text in zip(at, texts, strict=True):
        half = letter * (len(text) + 1) / 2
        free = place * side - half > end
        kept.append(text if free else "")
        if free:
            end = place * side + half
    return kept
