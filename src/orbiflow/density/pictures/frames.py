"""The window and texts of flat pictures, and their figures: room, panels, captions and colour bars."""

# matplotlib types no keyword arguments
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import math
import re
import textwrap
import unicodedata
from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from torch import Tensor, tensor

from orbiflow.arrays import Array
from orbiflow.density.pictures.colours import Shade, bar_ticks, minor_places
from orbiflow.density.spaces import Space, whole_turn
from orbiflow.drawing import Sheet
from orbiflow.errors import OrbiflowError, SettingError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

INK = "#1a1a1a"
MAX_NAME = 40
"""Letters of a column's name that are shown."""

LETTER_EMS = 0.56
"""Mean width of a letter, in ems."""


class View(NamedTuple):
    """A window of side 1 onto the chart of a space, with names for the data's columns.

    - `low`: Its lower corner (d,): on the torus where data are written from, elsewhere 0.
    """

    space: Space
    names: tuple[str, ...]
    low: Array

    def to_chart(self, points: Tensor) -> Tensor:
        """Return points (N, d) of the window, in [0, 1]^d, as chart points."""
        turned = points + tensor(self.low, dtype=points.dtype)
        for axis, (least, most) in real_spans(self.space).items():
            values = least + points[:, axis] * (most - least)
            turned[:, axis] = self.space.axes[axis].turns(values)
        return turned

    def places(self, points: Tensor) -> Array:
        """Return where chart points (N, d) lie in the window, in [0, 1]^d.

        What is beyond the window of a real column is not in [0, 1].
        """
        canonical = chart_points(self.space, points)
        # a translation commutes with the torus' group, and is 0 elsewhere
        inside = self.space.project(canonical - tensor(self.low)).numpy()
        spans = real_spans(self.space)
        data = self.space.from_chart(canonical) if spans else inside
        for axis, (least, most) in spans.items():
            inside[:, axis] = (data[:, axis] - least) / (most - least)
        return inside

    @property
    def volume(self) -> float:
        """The natural measure of the window: of a torus all of it."""
        spans = real_spans(self.space)
        if not spans:
            return self.space.volume
        sides = [most - least for least, most in spans.values()]
        return math.prod([*sides, *(axis.period for axis in self.space.axes if axis.period)])


def real_spans(space: Space) -> dict[int, tuple[float, float]]:
    """Return the values between which a window shows each real column, by its number."""
    lines = {k: axis.even(2) for k, axis in enumerate(space.axes) if axis.is_real}
    return {k: (float(ends[0]), float(ends[1])) for k, ends in lines.items()}


def _own_axes(space: Space) -> list[int]:
    """Return the numbers of columns with periods of their own, and of real ones."""
    return [k for k, axis in enumerate(space.axes) if not axis.is_angle]


def chart_points(space: Space, points: Tensor) -> Tensor:
    """Return chart points (N, d) as float64."""
    if points.ndim != 2 or points.shape[1] != space.dim:
        raise OrbiflowError(f"expected chart points (N, {space.dim}), got {tuple(points.shape)}")
    return points.detach().double().cpu()


def view_of(
    space: Space, names: Sequence[str] | None = None, center: Sequence[float] | None = None
) -> View:
    """Return the window of a space's flat pictures."""
    names = tuple(map(symbol, space.columns if names is None else names))
    if len(names) != len(space.columns):
        raise OrbiflowError(f"expected {len(space.columns)} names of columns, got {list(names)}")
    if not space.is_torus:
        if center is not None and not space.is_round:  # there it is that of a map
            raise SettingError(
                f"{{center}} applies to the torus and to maps, not to the {space.name}"
            )
        return View(space, names, np.zeros(space.dim))
    first = np.array([axis.first_turn for axis in space.axes])
    turn = whole_turn(space.unit or "")
    turns = first + 0.5 if center is None else np.array(center, dtype=float) / turn
    if turns.shape != (space.dim,) or not np.isfinite(turns).all():
        raise SettingError(
            f"{{center}} must be {space.dim} angles, one for each column, got {list(center or ())}"
        )
    # 3.14 radians are meant as pi: the ticks would be cut off beside the window's edge
    even = np.round(24 * turns) / 24
    turns = np.where(abs(turns - even) < 1e-3, even, turns)
    fixed = _own_axes(space)
    turns[fixed] = first[fixed] + 0.5
    return View(space, names, turns - 0.5)


def require_plane(space: Space) -> None:
    """Check that a space has two dimensions, and a chart of the square."""
    if not space.is_planar:
        raise OrbiflowError(
            f"a picture needs two dimensions, this {space.name} has {space.dimensions}"
        )


def space_title(space: Space) -> str:
    """Return the space's name as it stands in a sentence.

    >>> from orbiflow.density import make_space
    >>> space_title(make_space("klein-bottle"))
    'Klein bottle'
    """
    if real := real_spans(space):
        return "cylinder" if len(real) == 1 and space.dim == 2 else "product of circles and lines"
    if space.data_group is not None and space.data_group.name:
        return f"plane modulo {space.data_group.name}"
    return space.name.replace("-", " ").replace("klein", "Klein")


def cut(name: str, most: int) -> str:
    """Return a name of at most so many letters."""
    return name if len(name) <= most else f"{name[: most - 1]}…"


SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")


def symbol(name: str) -> str:
    """Return a name as it is printed: that of a Greek letter, with a number or without, as the letter.

    >>> symbol("phi"), symbol("Chi1"), symbol("chi_2"), symbol("phi angle")
    ('φ', 'χ₁', 'χ₂', 'phi angle')
    """
    match = re.fullmatch(r"([a-z]+?)_?(\d*)", name.strip().casefold())
    try:
        letter = unicodedata.lookup(f"GREEK SMALL LETTER {match[1]}") if match else ""
    except KeyError:
        return name
    return f"{letter}{match[2].translate(SUBSCRIPTS)}" if match else name


def axis_label(view: View, column: int) -> str:
    """Return the name and the unit of an angle, which the name may have already."""
    name = cut(view.names[column], MAX_NAME)
    has_unit = re.search(r"[(\[](deg|rad|turn|°)", name)
    return (
        name if has_unit or column in _own_axes(view.space) else f"{name} ({view.space.unit or ''})"
    )


def shortened(label: str, side: float, sheet: Sheet) -> str:
    """Return an axis label, cut in print to what fits along `side` inches.

    >>> shortened("a name that goes on and on (degrees)", 1.5, Sheet.column())
    'a name that g… (degrees)'
    """
    room = int(side / (LETTER_EMS * sheet.em))
    if not sheet.printed or len(label) <= room:
        return label
    name, opening, unit = label.rpartition(" (")
    ending = opening + unit if room - len(unit) > 8 else ""
    return cut(name, room - len(ending)) + ending


def legible(at: list[float], texts: list[str], side: float, size: float) -> list[str]:
    """Return texts of `size` points along `side` inches, every second one left out if they touch."""
    widest = max(map(len, texts)) * LETTER_EMS * size / 72
    if len(at) < 3 or 1.3 * widest < (at[1] - at[0]) * side:
        return texts
    return [text if k % 2 == 0 else "" for k, text in enumerate(texts)]


def angle_axis(view: View, axis: int) -> tuple[str, list[float], list[str]]:
    """Return the label of an axis of a torus or Klein bottle, and the places and texts of its ticks."""
    if span := real_spans(view.space).get(axis):
        return axis_label(view, axis), *_ticks(*span)
    if axis in _own_axes(view.space):
        period = view.space.axes[axis].period
        if len(f"{period / 4:g}") > QUARTER_LETTERS:
            low = float(view.low[axis])
            return axis_label(view, axis), *_ticks(low * period, (low + 1) * period)
    if view.space.is_torus:
        low = float(view.low[axis])
        quarters = range(math.ceil(4 * low - 1e-9), math.floor(4 * low + 4 + 1e-9) + 1)
        places, turns = [k / 4 - low for k in quarters], [k / 4 for k in quarters]
        label = axis_label(view, axis)
    else:  # the first column, theta, goes up: half a turn; phi starts a quarter before 0
        places = [k / 4 for k in range(5)]
        turns = [k / 4 - 0.25 for k in range(5)] if axis == 0 else [k / 8 for k in range(5)]
        label = axis_label(view, 1 - axis)
    return label, places, [turn_text(view.space, axis, t) for t in turns]


QUARTER_LETTERS = 3
"""The most letters of a quarter of a period for ticks at each: hours have, and days of the year not."""


def turn_text(space: Space, axis: int, turns: float) -> str:
    """Return a value of a periodic column as text: an angle in its unit, or a number."""
    if axis not in _own_axes(space):
        return angle_text(turns, space.unit)
    text = f"{turns * space.axes[axis].period:g}"
    return text.replace("-", "\N{MINUS SIGN}")


def _ticks(least: float, most: float) -> tuple[list[float], list[str]]:
    """Return places in [0, 1] of round numbers between two, and their texts."""
    from matplotlib.ticker import MaxNLocator

    values = [v for v in MaxNLocator(5).tick_values(least, most) if least <= v <= most]
    texts = [f"{value:.6g}".replace("-", "\N{MINUS SIGN}") for value in values]
    return [float(value - least) / (most - least) for value in values], texts


def angle_text(turns: float, unit: str | None) -> str:
    """Return an angle as text in its unit.

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


def degrees_text(value: float, letters: str) -> str:
    """Return degrees with the letter of their direction, or with a sign if there are no letters.

    >>> degrees_text(-30.0, "NS"), degrees_text(180.0, "EW"), degrees_text(330.0, "")
    ('30° S', '180°', '330°')
    """
    if not letters:
        return f"{value:g}°".replace("-", "\N{MINUS SIGN}")
    letter = "" if value in (0, 180, -180) else f" {letters[int(value < 0)]}"
    return f"{abs(value):g}°{letter}"


NARROW_INCHES = 70 / 25.4
"""Inches of a printed figure below which there is no room beside the axes."""

DIGIT_EMS = 0.66
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


class Panel(NamedTuple):
    """Whether a panel's axes are alone in the picture, have texts at the left, are without density."""

    alone: bool = True
    labelled: bool = True
    light: bool = False


class PanelPage:
    """A figure with equal panels in rows, from the top left.

    - `side`: How many inches wide a panel is. `bar_side`: How many a colour bar is long.

    Args:
        sheet: The sheet, whose width the figure has.
        room: The room around all panels.
        aspect: The width of a panel over its height.
        shape: How many rows of panels there are, and how many are in one.
        apart: The inches between two panels.
    """

    def __init__(
        self,
        sheet: Sheet,
        room: Room,
        aspect: float = 1.0,
        shape: tuple[int, int] = (1, 1),
        apart: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        (rows, self._columns), self._room, em = shape, room, sheet.em
        self._left, self._below = em * room.left, em * room.below
        self._wide = sheet.width - em * (room.left + room.right)
        self.side = (self._wide - (self._columns - 1) * apart[1]) / self._columns
        self._step = self.side / aspect + apart[0], self.side + apart[1]
        self._tall = rows * self._step[0] - apart[0]
        self._size = self.side, self.side / aspect
        self.figure = sheet.figure(self._tall + em * (room.below + room.above))
        self.under = room.under
        self.bar_side = self._wide if room.under else self._tall
        self._gap, self._thick = em * room.gap, em * room.bar

    def axes(self, number: int = 0) -> Axes:
        """Make the axes of a panel, by its number."""
        row, column = divmod(number, self._columns)
        below = self._below + self._tall - self._size[1] - row * self._step[0]
        return axes_at(self.figure, self._left + column * self._step[1], below, *self._size)

    def bar(self) -> Axes:
        """Make the axes of a colour bar, below the panels or at their right."""
        if self.under:
            below = self._below - self._gap - self._thick
            return axes_at(self.figure, self._left, below, self._wide, self._thick)
        left = self._left + self._wide + self._gap
        return axes_at(self.figure, left, self._below, self._thick, self._tall)


def axes_at(figure: Figure, left: float, below: float, width: float, high: float) -> Axes:
    """Make axes at a place in inches."""
    wide, height = figure.get_size_inches()
    return figure.add_axes((left / wide, below / height, width / wide, high / height))


def printed_room(
    sheet: Sheet, left: float, below: float, above: float, label: str, ticks: Sequence[str]
) -> Room:
    """Return room in print for a bar: below the axes where the sheet is narrow, else beside them."""
    if sheet.width < NARROW_INCHES:
        return room_for_bar_below(sheet, Room(left, below, 1.4, above, below, 1.0), label)
    return room_for_bar_beside(sheet, Room(left, below, 0.0, above, 1.4, 1.1), label, ticks)


def room_for_bar_below(sheet: Sheet, room: Room, label: str) -> Room:
    """Add room for a bar, its ticks and its label below what takes `room.gap` under the axes."""
    side = sheet.width - sheet.em * (room.left + room.right)
    lines = len(label_lines(sheet, label, side))
    return room._replace(below=room.gap + room.bar + 2.2 + 1.3 * lines, under=True)


def room_for_bar_beside(sheet: Sheet, room: Room, label: str, ticks: Sequence[str]) -> Room:
    """Add room for a bar, its ticks and its label at the right of the axes."""
    widest = max(map(len, ticks), default=0) * LETTER_EMS * sheet.small / sheet.text
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
    most = max(12, int(side / (LETTER_EMS * sheet.em)))
    lines = -(-len(label) // most)
    return textwrap.wrap(label, min(most, len(label) // max(lines, 1) + 6)) or [""]


def sentences(parts: Sequence[str]) -> str:
    """Return parts of a caption as sentences."""
    return " ".join(f"{part[0].upper()}{part[1:]}." for part in parts)


def caption_lines(words: str, sheet: Sheet) -> list[str]:
    """Break a caption into lines as wide as a picture for a screen."""
    return textwrap.wrap(words, int(0.93 * 72 * sheet.width / (0.93 * LETTER_EMS * sheet.small)))


def write_caption(figure: Figure, words: str, sheet: Sheet) -> None:
    """Write a caption in the lower left corner of a picture for a screen."""
    figure.text(
        0.03, 0.6 * sheet.em / figure.get_size_inches()[1], "\n".join(caption_lines(words, sheet)),
        fontsize=sheet.small, color=INK, va="bottom", linespacing=1.35, parse_math=False,
    )  # fmt: skip


def colour_bar(
    image: AxesImage, page: PanelPage, sheet: Sheet, label: str, shade: Shade | None = None
) -> None:
    """Draw the bar of an image's colours; those of a density have ticks in its units."""
    from matplotlib.ticker import MaxNLocator

    extend = "neither"
    if shade is not None and shade.cut != shade.faint:
        extend = "max" if shade.cut else "min"
    way, side = "horizontal" if page.under else "vertical", page.bar_side
    bar = page.figure.colorbar(image, cax=page.bar(), extend=extend, orientation=way)
    if sheet.printed or page.under:
        label = "\n".join(label_lines(sheet, label, side))
    bar.set_label(label, fontsize=sheet.text, color=INK)
    bar.ax.tick_params(
        which="both", labelsize=sheet.small, width=sheet.pen(0.8), length=0.3 * sheet.text
    )
    bar.ax.tick_params(which="minor", length=0.18 * sheet.text)
    bar.ax.yaxis.get_offset_text().set_fontsize(sheet.small)
    bar.outline.set_visible(False)
    if shade is not None:
        at, texts = zip(*bar_ticks(shade), strict=True)
        axis = bar.ax.xaxis if page.under else bar.ax.yaxis
        axis.set_ticks(at, without_overlap(at, texts, side, sheet) if page.under else texts)
        axis.set_ticks(minor_places(shade), minor=True)
    elif page.under:  # a few even steps
        bar.locator = MaxNLocator(max(2, int(side / (8 * LETTER_EMS * sheet.em))))
        bar.update_ticks()


def without_overlap(
    at: Sequence[float], texts: Sequence[str], side: float, sheet: Sheet
) -> list[str]:
    """Return texts along a bar of `side` inches, "" for those that would touch the one before.

    >>> without_overlap([0.0, 0.1, 0.9], ["0.00", "0.10", "0.90"], 1.5, Sheet.column())
    ['0.00', '', '0.90']
    """
    letter, end, kept = DIGIT_EMS * sheet.small / 72, -1.0, list[str]()
    for place, text in zip(at, texts, strict=True):
        half = letter * (len(text) + 1) / 2
        free = place * side - half > end
        kept.append(text if free else "")
        end = place * side + half if free else end
    return kept
