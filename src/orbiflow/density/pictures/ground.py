"""Grounds on which densities and points are drawn, the two pictures that all have, and their frame.

A ground is the canonical square (`square`) or a map of directions (`maps`).
"""

from __future__ import annotations

import textwrap
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models import Density
from orbiflow.density.pictures import overlays
from orbiflow.density.pictures.axes import INK, LETTER, space_title
from orbiflow.density.pictures.colours import Shade, bar_label, bar_ticks, minor_places
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.density.regions import DensityRegion
from orbiflow.density.spaces import Space
from orbiflow.drawing import Picture, Sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage
    from matplotlib.patches import Polygon

COLOURS = "viridis"
DOT, LIGHT = "#3b528b", "#f4f4f1"
"""Colours of dots without a density, and of the ground beneath them."""

HALO, LINE = "#16202a", "#ffffff"
"""Colours of lines around regions: their rim, and the line."""

SMALLER = "dots are smaller where they crowd"


@dataclass(frozen=True, eq=False)
class Colouring:
    """The colours of a density on a ground.

    - `places`: Place of each pixel on the colour bar, (rows, columns), the lowest row first.
    - `extent`: Left, right, bottom and top of the pixels on the axes.
    - `shade`: The scale of the colours. `reason`: Why it is linear or logarithmic.
    - `averaging`: A note on peaks narrower than a pixel, "" if there are none.
    - `log_natural`: Called, the logarithms of the density in natural measure, shaped as `places`, NaN
      where there is none; only lines around regions need them.
    - `outline`: Ring (N, 2) beyond which nothing is drawn, None for the whole rectangle.
    """

    places: Array
    extent: tuple[float, float, float, float]
    shade: Shade
    reason: str
    averaging: str
    log_natural: Callable[[], Array]
    outline: Array | None = None

    def draw(self, axes: Axes) -> AxesImage:
        """Draw the colours as one image, cut along the outline, without seams or steps at its rim."""
        image = axes.imshow(
            self.places, extent=self.extent, origin="lower", cmap=COLOURS,
            interpolation="bicubic", vmin=0, vmax=1, aspect="auto", zorder=1,
        )  # fmt: skip
        if self.outline is not None:
            image.set_clip_path(self._clip(axes))
        return image

    def draw_regions(self, axes: Axes, lines: Sequence[DensityRegion], sheet: Sheet) -> None:
        """Draw lines where the density is that of each region's edge, cut along the outline."""
        if not lines:
            return
        from matplotlib.patheffects import Stroke

        logs, (left, right, below, above) = self.log_natural(), self.extent
        rows, columns = logs.shape
        x = left + (right - left) * (np.arange(columns) + 0.5) / columns
        y = below + (above - below) * (np.arange(rows) + 0.5) / rows
        width, clip = 0.11 * sheet.text, self._clip(axes)
        for line, style in zip(lines, overlays.STYLES, strict=False):
            if not np.nanmin(logs) < line.log_prob < np.nanmax(logs):
                continue
            drawn = axes.contour(
                x, y, logs, levels=[line.log_prob], colors=LINE, linestyles=style,
                linewidths=width, zorder=4,
            )  # fmt: skip
            halo = Stroke(linewidth=1.9 * width, foreground=HALO, alpha=0.55)
            if clip is not None:
                drawn.set_clip_path(clip)
            drawn.set_path_effects([halo, Stroke(linewidth=width, foreground=LINE)])

    def _clip(self, axes: Axes) -> Polygon | None:
        from matplotlib.patches import Polygon

        if self.outline is None:
            return None
        return Polygon(self.outline.tolist(), closed=True, transform=axes.transData)


class Panel(NamedTuple):
    """Whether a panel's axes are alone in the picture, have texts at the left, are without density."""

    alone: bool = True
    labelled: bool = True
    light: bool = False


class Ground(ABC):
    """What densities and points of a space are drawn on.

    - `width`, `aspect`: Its width in units of the axes, and its width over its height.
    - `title_gap`: Distance of a panel's title, in sizes of the text.
    - `caption_below`: Whether the caption of a single picture is below it on a screen.
    """

    space: Space
    width: float
    aspect: float
    title_gap: float
    caption_below: bool

    @abstractmethod
    def places(self, points: Tensor) -> Array:
        """Return where chart points (N, 2) lie on the axes, those on the ground alone."""

    @abstractmethod
    def colouring(self, density: Density, settings: PlotSettings) -> Colouring:
        """Return the colours of a density."""

    @abstractmethod
    def room(self, sheet: Sheet, label: str, ticks: Sequence[str]) -> Room:
        """Return the room around a single picture and its colour bar."""

    @abstractmethod
    def panels_room(self, sheet: Sheet) -> tuple[Room, bool]:
        """Return the room around two panels, and whether one is above the other."""

    @abstractmethod
    def fill(self, axes: Axes) -> None:
        """Fill the ground with one light colour."""

    @abstractmethod
    def draw_axes(self, axes: Axes, sheet: Sheet, side: float, panel: Panel) -> None:
        """Draw limits, ticks, labels and lines of axes `side` inches wide."""

    @abstractmethod
    def caption(self, notes: Sequence[str], dots: tuple[int, int] | None) -> str:
        """Return what is seen, and `notes`, as sentences."""

    @abstractmethod
    def samples_caption(self, notes: Sequence[str]) -> str:
        """Return the caption of points on two grounds."""

    @abstractmethod
    def write_on_screen(
        self, frame: Frame, sheet: Sheet, title: str, caption: str, notes: Sequence[str], dots: bool
    ) -> None:
        """Write the title, and the caption or a legend with notes, on a picture for a screen."""

    def dot_scale(self, sheet: Sheet, side: float) -> float:
        """Return what to multiply the area of dots by, on axes `side` inches wide: 1 on a screen."""
        return max(0.2, (max(1.0, side / self.aspect) / 5.6) ** 2) if sheet.printed else 1.0


def draw_density(
    ground: Ground,
    density: Density,
    settings: PlotSettings,
    *,
    dots: Tensor | None = None,
    regions: Sequence[DensityRegion] | None = None,
    sheet: Sheet | None = None,
) -> Picture:
    """Draw a density on a ground, chart points (N, 2) as dots over it, and a colour bar."""
    sheet = sheet or settings.sheet
    regions = overlays.region_lines(density, settings) if regions is None else regions
    colouring = ground.colouring(density, settings)
    shade = colouring.shade
    label = bar_label(shade, ground.space, settings.measure)
    places = None if dots is None else ground.places(dots)
    most = settings.samples or overlays.MAX_DOTS
    masses = sorted(settings.regions or ())
    notes = [*([] if places is None else [SMALLER]), colouring.reason]
    notes += [overlays.region_note(masses)] if masses else []
    notes += [colouring.averaging] if colouring.averaging else []
    count = None if places is None else (min(most, len(places)), len(places))
    caption = ground.caption(notes, count)
    room = ground.room(sheet, label, [tick.text for tick in bar_ticks(shade)])
    if ground.caption_below:
        room = room.with_words(caption, sheet)
    frame = make_frame(sheet, room, ground.aspect)
    image = colouring.draw(frame.axes)
    colouring.draw_regions(frame.axes, regions, sheet)
    if places is not None:
        scale = ground.dot_scale(sheet, frame.side)
        overlays.draw_dots_over(
            frame.axes, places, frame.side / ground.width, limit=most, scale=scale
        )
    ground.draw_axes(frame.axes, sheet, frame.side, Panel())
    shade_bar(image, frame, sheet, shade, label)
    title = f"Density on the {space_title(ground.space)}"
    if not sheet.printed:
        ground.write_on_screen(frame, sheet, title, caption, notes, places is not None)
    return Picture(frame.figure, sheet, title, caption)


def draw_samples(
    ground: Ground,
    density: Density,
    settings: PlotSettings,
    data: Tensor | None,
    samples: Tensor,
    *,
    sheet: Sheet | None = None,
) -> Picture:
    """Draw data (N, 2), or else the density, beside samples (M, 2): chart points, as many of each."""
    sheet = sheet or settings.sheet
    panels = {"data": data, "samples": samples}
    places = {n: ground.places(points) for n, points in panels.items() if points is not None}
    count = min(
        [settings.samples or overlays.MAX_DOTS, *(len(own) for own in places.values() if len(own))]
    )
    colouring = ground.colouring(density, settings) if data is None else None
    bar = "from the least (dark) to the largest (light) density"
    words = ground.samples_caption([] if colouring is None else [f"{colouring.reason}, {bar}"])
    room, stacked = ground.panels_room(sheet)
    room = room.with_words(words, sheet)
    figure, both, side = two_panels(sheet, room, ground.aspect, stacked=stacked)
    for axes, (name, points) in zip(both, panels.items(), strict=True):
        if colouring is not None and points is None:
            colouring.draw(axes)
        else:
            ground.fill(axes)
            scale = ground.dot_scale(sheet, side)
            overlays.draw_dots(axes, places[name], 0.5, limit=count, fill=DOT, scale=scale)
        panel = Panel(False, stacked or axes is both[0], points is not None)
        ground.draw_axes(axes, sheet, side, panel)
        head = "density"
        if points is not None:
            shown = min(count, len(places[name]))
            head = f"{f'{shown} of ' if shown < len(points) else ''}{len(points)} {name}"
        axes.set_title(head, fontsize=sheet.text, pad=ground.title_gap * sheet.text)
    if not sheet.printed:
        write_caption(figure, words, sheet)
    first = "Density" if data is None else "Data"
    return Picture(figure, sheet, f"{first} and samples on the {space_title(ground.space)}", words)


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
