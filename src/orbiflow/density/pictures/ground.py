"""Grounds on which densities and points are drawn, and the two pictures that all grounds have.

A ground is the canonical square (`square`) or a map of directions (`maps`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models import Density
from orbiflow.density.pictures.axes import space_title
from orbiflow.density.pictures.dots import MAX_DOTS, dot_scale, draw_dots, draw_dots_over
from orbiflow.density.pictures.frame import (
    Frame,
    Room,
    make_frame,
    shade_bar,
    two_panels,
    write_caption,
)
from orbiflow.density.pictures.regions import RegionLine, draw_regions, region_note
from orbiflow.density.pictures.scale import Shade, bar_label, bar_ticks
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.density.spaces import Space
from orbiflow.drawing import Picture, Sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage
    from matplotlib.patches import Polygon

COLOURS = "viridis"
DOT, LIGHT = "#3b528b", "#f4f4f1"
"""Colours of dots without a density, and of the ground beneath them."""

SMALLER = "dots are smaller where they crowd"


@dataclass(frozen=True, eq=False)
class Colouring:
    """The colours of a density on a ground.

    - `places`: Place of each pixel on the colour bar, (rows, columns), the lowest row first.
    - `extent`: Left, right, bottom and top of the pixels on the axes.
    - `shade`: The scale of the colours. `reason`: Why it is linear or logarithmic.
    - `averaging`: A note on peaks narrower than a pixel, "" if there are none.
    - `log_natural`: Called, the logarithms of the density in natural measure, shaped as `places`;
      only lines around regions need them.
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

    def draw_regions(self, axes: Axes, lines: Sequence[RegionLine], sheet: Sheet) -> None:
        """Draw lines around regions, cut along the outline."""
        if lines:
            draw_regions(axes, lines, self.log_natural(), self.extent, sheet, self._clip(axes))

    def _clip(self, axes: Axes) -> Polygon | None:
        from matplotlib.patches import Polygon

        if self.outline is None:
            return None
        return Polygon(self.outline.tolist(), closed=True, transform=axes.transData)


class Panel(NamedTuple):
    """How the axes of a panel are drawn.

    - `alone`: Whether they are the only ones of the picture, with room around them.
    - `labelled`: Whether the left side has texts.
    - `light`: Whether the ground is light, without a density.
    """

    alone: bool = True
    labelled: bool = True
    light: bool = False


class Words(NamedTuple):
    """What is said of a picture: its caption, the notes in it, and whether there are dots."""

    caption: str
    notes: Sequence[str]
    dots: bool


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
    def write_on_screen(self, frame: Frame, sheet: Sheet, title: str, words: Words) -> None:
        """Write the title and what the signs mean on a picture for a screen."""

    def dot_scale(self, sheet: Sheet, side: float) -> float:
        """Return what to multiply the area of dots by, on axes `side` inches wide."""
        return dot_scale(sheet, max(1.0, side / self.aspect))


def draw_density(
    ground: Ground,
    density: Density,
    settings: PlotSettings,
    *,
    dots: Tensor | None = None,
    regions: Sequence[RegionLine] = (),
    sheet: Sheet | None = None,
) -> Picture:
    """Draw a density on a ground, chart points (N, 2) as dots over it, and a colour bar."""
    sheet = sheet or settings.sheet
    colouring = ground.colouring(density, settings)
    shade = colouring.shade
    label = bar_label(shade, ground.space, settings.measure)
    places = None if dots is None else ground.places(dots)
    most = settings.samples or MAX_DOTS
    notes = [*([] if places is None else [SMALLER]), colouring.reason]
    notes += [region_note(regions)] if regions else []
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
        draw_dots_over(frame.axes, places, frame.side / ground.width, limit=most, scale=scale)
    ground.draw_axes(frame.axes, sheet, frame.side, Panel())
    shade_bar(image, frame, sheet, shade, label)
    title = f"Density on the {space_title(ground.space)}"
    if not sheet.printed:
        words = Words(caption, notes, places is not None)
        ground.write_on_screen(frame, sheet, title, words)
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
    count = min([settings.samples or MAX_DOTS, *(len(own) for own in places.values() if len(own))])
    colouring = ground.colouring(density, settings) if data is None else None
    words = ground.samples_caption([] if colouring is None else [_without_bar(colouring.reason)])
    room, stacked = ground.panels_room(sheet)
    room = room.with_words(words, sheet)
    figure, both, side = two_panels(sheet, room, ground.aspect, stacked=stacked)
    for axes, (name, points) in zip(both, panels.items(), strict=True):
        if colouring is not None and points is None:
            colouring.draw(axes)
        else:
            ground.fill(axes)
            scale = ground.dot_scale(sheet, side)
            draw_dots(axes, places[name], 0.5, limit=count, fill=DOT, scale=scale)
        panel = Panel(False, stacked or axes is both[0], points is not None)
        ground.draw_axes(axes, sheet, side, panel)
        head = "density" if points is None else _head(name, min(count, len(places[name])), points)
        axes.set_title(head, fontsize=sheet.text, pad=ground.title_gap * sheet.text)
    if not sheet.printed:
        write_caption(figure, words, sheet)
    first = "Density" if data is None else "Data"
    return Picture(figure, sheet, f"{first} and samples on the {space_title(ground.space)}", words)


def _without_bar(reason: str) -> str:
    return f"{reason}, from the least (dark) to the largest (light) density"


def _head(name: str, shown: int, points: Tensor) -> str:
    return f"{shown} of {len(points)} {name}" if shown < len(points) else f"{len(points)} {name}"
