"""Figures of a density, and of points beside it, on the canonical square or on a map."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import torch
from torch import Tensor

from orbiflow.density.models import Density
from orbiflow.density.pictures import frames, overlays
from orbiflow.density.pictures.axes import chart_points, space_title
from orbiflow.density.pictures.coastlines import coastlines_for
from orbiflow.density.pictures.colours import bar_label, bar_ticks
from orbiflow.density.pictures.maps import Map, chosen_map
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.density.pictures.square import Square
from orbiflow.density.regions import DensityRegion
from orbiflow.drawing import Picture, Sheet

Ground: TypeAlias = Square | Map
"""What densities and points of a space are drawn on."""


def density_picture(
    density: Density,
    samples: Tensor | None = None,
    settings: PlotSettings | None = None,
    *,
    sheet: Sheet | None = None,
) -> Picture:
    """Draw a density on the canonical square, with the edges marked that are the same edge.

    Edges of one colour and number of arrow heads are identified, in the sense of the arrows. Ticks
    are in the user's units where the chart is a plain rescaling of them (torus, Klein bottle).
    Peaks narrower than a pixel are averaged over it, and a note says so.

    Args:
        density: A density on a two-dimensional space.
        samples: Data or samples to draw as dots, chart points (N, 2). Of too many a random choice is
            drawn, always the same; dots are smaller where they crowd, so that peaks stay in sight.
        settings: How it is drawn.
        sheet: The sheet. Default: that of the settings.

    Raises:
        OrbiflowError: If the space has another dimension, or samples or settings do not fit it.
    """
    settings = settings or PlotSettings()
    square = Square(density.space, settings)
    return draw_density(square, density, settings, dots=samples, sheet=sheet)


def samples_picture(
    density: Density,
    data: Tensor | None,
    samples: Tensor,
    settings: PlotSettings | None = None,
    *,
    sheet: Sheet | None = None,
) -> Picture:
    """Draw data (N, 2) and samples (M, 2) on two squares; without data, the density and samples.

    Points are of the chart, such as `space.to_chart(table)` and `density.sample((M,))`.
    """
    settings = settings or PlotSettings()
    square = Square(density.space, settings)
    return draw_samples(square, density, settings, data, samples, sheet=sheet)


def map_picture(
    density: Density,
    samples: Tensor | None = None,
    settings: PlotSettings | None = None,
    *,
    sheet: Sheet | None = None,
) -> Picture:
    """Draw a density on the sphere or the projective plane on a map with its graticule.

    The density is evaluated at each pixel of the map, so that nothing is stretched or sewn; the
    pixels end at a curve. On the projective plane each axis is drawn at the end that the map shows.
    Arguments are those of `density_picture`.
    """
    settings = settings or PlotSettings()
    ground = _map_about(density, samples, settings)
    return draw_density(ground, density, settings, dots=samples, sheet=sheet)


def map_samples_picture(
    density: Density,
    data: Tensor | None,
    samples: Tensor,
    settings: PlotSettings | None = None,
    *,
    sheet: Sheet | None = None,
) -> Picture:
    """Draw data (N, 2) and samples (M, 2) on two maps, as `samples_picture` does on two squares."""
    settings = settings or PlotSettings()
    ground = _map_about(density, samples if data is None else data, settings)
    return draw_samples(ground, density, settings, data, samples, sheet=sheet)


def _map_about(density: Density, points: Tensor | None, settings: PlotSettings) -> Map:
    space = density.space
    about = chart_points(space, torch.empty(0, 2) if points is None else points)
    chosen = chosen_map(space, about, settings, settings.names)
    return Map(space, chosen, coastlines_for(space, settings))


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
    notes = [*([] if places is None else [overlays.SMALLER]), colouring.reason]
    notes += [overlays.region_note(masses)] if masses else []
    notes += [colouring.averaging] if colouring.averaging else []
    count = None if places is None else (min(most, len(places)), len(places))
    caption = ground.caption(notes, count)
    room = ground.room(sheet, label, [tick.text for tick in bar_ticks(shade)])
    if ground.caption_below:
        room = room.with_words(caption, sheet)
    frame = frames.make_frame(sheet, room, ground.aspect)
    image = colouring.draw(frame.axes)
    colouring.draw_regions(frame.axes, regions, sheet)
    if places is not None:
        scale = _dot_scale(ground, sheet, frame.side)
        overlays.draw_dots_over(
            frame.axes, places, frame.side / ground.width, limit=most, scale=scale
        )
    ground.draw_axes(frame.axes, sheet, frame.side, frames.Panel())
    frames.colour_bar(image, frame, sheet, label, shade)
    title = f"Density on the {space_title(ground.space)}"
    if not sheet.printed:
        ground.write_on_screen(frame, sheet, title, notes, count)
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
    figure, both, side = frames.two_panels(sheet, room, ground.aspect, stacked=stacked)
    for axes, (name, points) in zip(both, panels.items(), strict=True):
        if colouring is not None and points is None:
            colouring.draw(axes)
        else:
            ground.fill(axes)
            scale = _dot_scale(ground, sheet, side)
            overlays.draw_dots(axes, places[name], 0.5, limit=count, fill=overlays.DOT, scale=scale)
        panel = frames.Panel(False, stacked or axes is both[0], points is not None)
        ground.draw_axes(axes, sheet, side, panel)
        head = "density"
        if points is not None:
            shown = min(count, len(places[name]))
            head = f"{f'{shown} of ' if shown < len(points) else ''}{len(points)} {name}"
        axes.set_title(head, fontsize=sheet.text, pad=ground.title_gap * sheet.text)
    if not sheet.printed:
        frames.write_caption(figure, words, sheet)
    first = "Density" if data is None else "Data"
    return Picture(figure, sheet, f"{first} and samples on the {space_title(ground.space)}", words)


def _dot_scale(ground: Ground, sheet: Sheet, side: float) -> float:
    """Return what to multiply the area of dots by, on axes `side` inches wide: 1 on a screen."""
    return max(0.2, (max(1.0, side / ground.aspect) / 5.6) ** 2) if sheet.printed else 1.0
