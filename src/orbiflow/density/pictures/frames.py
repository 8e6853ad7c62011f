"""Figures for a screen or print: the room around their axes, panels, captions and colour bars."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from orbiflow.density.pictures.axes import INK, LETTER
from orbiflow.density.pictures.colours import Shade, bar_ticks, minor_places
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


class Panel(NamedTuple):
    """Whether a panel's axes are alone in the picture, have texts at the left, are without density."""

    alone: bool = True
    labelled: bool = True
    light: bool = False


def make_frame(sheet: Sheet, room: Room, aspect: float = 1.0) -> Frame:
    """Make a figure as wide as the sheet, with axes of this width over height and a colour bar."""
    side = sheet.width - sheet.em * (room.left + room.right)
    inner = side / aspect
    figure = sheet.figure(inner + sheet.em * (room.below + room.above))
    left, below = sheet.em * room.left, sheet.em * room.below
    gap, thick = sheet.em * room.gap, sheet.em * room.bar
    place = (left + side + gap, below, thick, inner)
    if room.under:
        place = (left, below - gap - thick, side, thick)
    bar = _axes_at(figure, *place)
    return Frame(figure, _axes_at(figure, left, below, side, inner), bar, side, room.under)


def two_panels(
    sheet: Sheet, room: Room, aspect: float, *, stacked: bool
) -> tuple[Figure, tuple[Axes, Axes], float]:
    """Make a figure with two equal axes, side by side or stacked, and return their width in inches."""
    left, gap, right = (sheet.em * room[k] for k in (0, 4, 2))
    side = sheet.width - left - right
    side = side if stacked else (side - gap) / 2
    inner = side / aspect
    below = sheet.em * room.below
    figure = sheet.figure(below + sheet.em * room.above + (2 * inner + gap if stacked else inner))
    corners = [(left, below + inner + gap), (left, below)]
    if not stacked:
        corners = [(left + k * (side + gap), below) for k in (0, 1)]
    first, second = (_axes_at(figure, x, y, side, inner) for x, y in corners)
    return figure, (first, second), side


def _axes_at(figure: Figure, left: float, below: float, width: float, high: float) -> Axes:
    """Make axes at a place in inches."""
    wide, height = figure.get_size_inches()
    return figure.add_axes((left / wide, below / height, width / wide, high / height))


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
    image: AxesImage, frame: Frame, sheet: Sheet, label: str, shade: Shade | None = None
) -> None:
    """Draw the bar of an image's colours; those of a density have ticks in its units."""
    from matplotlib.ticker import MaxNLocator

    cut = shade is not None and shade.cut
    faint = shade is not None and shade.faint
    extend = "neither" if cut == faint else "max" if cut else "min"
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
    if shade is not None:
        at, texts = zip(*bar_ticks(shade), strict=True)
        set_ticks = frame.bar.set_xticks if frame.under else frame.bar.set_yticks
        set_ticks(at, without_overlap(at, texts, frame.side, sheet) if frame.under else texts)
        set_ticks(minor_places(shade), minor=True)
    elif frame.under:  # a few even steps
        bar.locator = MaxNLocator(max(2, int(frame.side / (8 * LETTER * sheet.em))))
        bar.update_ticks()


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
