"""A series of pictures of a space of two dimensions: how its density changes along another column."""

# matplotlib types no keyword arguments
# pyright: reportUnknownMemberType=false

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch

from orbiflow.density.inference import chosen_columns, conditional, marginal
from orbiflow.density.models import Density
from orbiflow.density.pictures import frames
from orbiflow.density.pictures.colours import bar_label, bar_ticks, density_over, is_sharp, shading
from orbiflow.density.pictures.grounds import Ground, GroundColouring
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.density.spaces import ProductSpace
from orbiflow.drawing import Picture, Sheet
from orbiflow.errors import SettingError, literal

PANELS = 6
"""Values that are drawn if none are asked for."""

PIXELS = {True: 60_000, False: 160}
"""Pixels of a map in all, or along the side of a square."""

MOST_ACROSS, WIDE = 3, 1.5
"""Panels side by side at most, and the width over the height of those of which two are."""

DIGITS = 3
"""Digits of a value above its panel."""


class Along(NamedTuple):
    """A column beside a space: its number among all columns, its name, and values of it."""

    column: int
    name: str
    values: tuple[float, ...]


def along_of(density: Density, names: tuple[str, ...], settings: PlotSettings) -> Along:
    """Return the column along which a series goes, and its values.

    These are even ones of a periodic column, and of a real one the middles of parts that have the same
    mass.

    Raises `SettingError` for another column.
    """
    space = density.space
    assert isinstance(space, ProductSpace)
    first = len(names) - space.beside.dim
    called = [name.casefold() for name in names[first:]]
    wanted = (settings.along or names[first]).casefold()
    if wanted not in called:
        listed = literal(", ".join(names[first:]))
        raise SettingError(f"{{along}} must be a column beside the {space.base.name}: {listed}")
    number = called.index(wanted)
    axis = space.beside.axes[number]
    period = axis.period
    values = settings.slices
    if values is None and period:
        low = axis.first_turn
        values = tuple(period * (low + (k + 0.5) / PANELS) for k in range(PANELS))
    elif values is None:
        alone = marginal(density, chosen_columns(space, [first + number], len(names)).axes)
        masses = (torch.arange(PANELS, dtype=torch.float64) + 0.5) / PANELS
        values = tuple(alone.space.from_chart(alone.icdf(masses))[:, 0].tolist())
    return Along(first + number, names[first + number], values)


@torch.no_grad()
def series_picture(
    density: Density,
    along: Along,
    settings: PlotSettings,
    ground: Ground,
    *,
    sheet: Sheet | None = None,
) -> Picture:
    """Draw the densities of a space where another column has some values, in the same colours.

    Args:
        density: A density on a `ProductSpace` whose base has two dimensions.
        along: The column and its values.
        settings: How it is drawn.
        ground: What each is drawn on.
        sheet: The sheet. Default: that of the settings.
    """
    space, sheet = density.space, sheet or settings.sheet
    assert isinstance(space, ProductSpace)
    axis = space.base.chart_dim + along.column - (len(space.columns) - space.beside.dim)
    base = list(range(space.base.chart_dim))
    pixels = ground.pixels(PIXELS[ground.outline is not None])
    parts: list[Density] = []
    for value in along.values:
        turns = space.beside.axes[axis - len(base)].turns(torch.tensor(value, dtype=torch.float64))
        parts.append(conditional(density, {axis: float(turns)}, base))
    tables = [density_over(part, pixels.points, settings.measure, pixels.side) for part in parts]
    areas = None if pixels.areas is None else pixels.areas[pixels.within]
    every = np.concatenate([values[pixels.within] for values in tables])
    log = None if settings.scale == "auto" else settings.scale == "log"
    shade = shading(every, None if areas is None else np.tile(areas, len(tables)), log=log)
    notes = ["Where the other column has the values above the panels"]
    notes.append(f"Colours are {'logarithmic' if shade.log else 'linear'}, the same in all panels")
    if any(is_sharp(part, pixels.side) for part in parts):
        notes.append(f"peaks narrower than {pixels.size} are averaged over it")
    caption = ground.caption(notes, None)
    label = bar_label(shade, ground.space, settings.measure)
    ticks = [tick.text for tick in bar_ticks(shade)]
    page, across = _page(sheet, ground, len(tables), caption, label, ticks)
    for k, (value, values) in enumerate(zip(along.values, tables, strict=True)):
        axes = page.axes(k)
        places = pixels.table(shade.places(values), 0.0)
        colouring = GroundColouring(places, pixels.extent, shade, "", "", None, ground.outline)
        image = colouring.draw(axes)
        ground.draw_axes(axes, sheet, page.side, frames.Panel(False, k % across == 0))
        number = f"{value:.{DIGITS}g}".replace("-", "\N{MINUS SIGN}")
        head = f"{frames.cut(frames.symbol(along.name), 24)} = {number}"
        axes.set_title(head, fontsize=sheet.text, pad=ground.title_gap * sheet.text)
        if k == 0:
            frames.colour_bar(image, page, sheet, label, shade)
    title = f"Density on the {frames.space_title(space.base)} along {frames.cut(along.name, 40)}"
    if not sheet.printed:
        frames.write_caption(page.figure, caption, sheet)
    return Picture(page.figure, sheet, title, caption)


def _page(
    sheet: Sheet, ground: Ground, count: int, caption: str, label: str, ticks: list[str]
) -> tuple[frames.PanelPage, int]:
    """Return a page of equal panels beside one colour bar, and how many are in a row."""
    panel, _ = ground.panels_room(sheet)
    room = panel._replace(left=panel.left + 0.8, above=panel.above + 0.6, gap=1.6, bar=1.2)
    room = frames.room_for_bar_beside(sheet, room, label, ticks).with_words(caption, sheet)
    room = room._replace(right=room.right + panel.right, gap=room.gap + panel.right)
    most = MOST_ACROSS if ground.aspect < WIDE else 2
    across = min(count, 1 if sheet.printed and sheet.width < frames.NARROW_INCHES else most)
    apart = sheet.em * (panel.above + panel.below), sheet.em * panel.gap
    return frames.PanelPage(
        sheet, room, ground.aspect, (-(-count // across), across), apart
    ), across
