"""Samples of a density of directions or axes beside the data on maps, or beside the density."""

from __future__ import annotations

from typing import Unpack

from torch import Tensor

from orbiflow.density.models import SymmetricDensity
from orbiflow.density.pictures.axes import space_title
from orbiflow.density.pictures.dots import MAX_DOTS, dot_shrink
from orbiflow.density.pictures.frame import Room, two_panels
from orbiflow.density.pictures.legend import write_below
from orbiflow.density.pictures.map_axes import (
    aspect,
    dress_map,
    set_limits,
)
from orbiflow.density.pictures.map_choice import caption
from orbiflow.density.pictures.maps import (
    MapOptions,
    coloured_map,
    map_and_coasts,
    places_on,
)
from orbiflow.density.pictures.projections import Azimuthal
from orbiflow.density.pictures.samples import (
    GROUND,
    colours_note,
    draw_panel,
    head,
    same_number,
    with_words,
)
from orbiflow.drawing import Picture, Sheet

_BESIDE = 120 / 25.4
"""Inches of a printed figure below which discs are above each other, for room round their rims."""


def map_samples_picture(
    density: SymmetricDensity,
    data: Tensor | None,
    drawn: Tensor,
    *,
    measure: str = "natural",
    scale: str = "linear",
    sheet: Sheet | None = None,
    most: int = MAX_DOTS,
    **options: Unpack[MapOptions],
) -> Picture:
    """Data and samples on two maps; without data, the density and samples.

    Args:
        density: on the sphere or the projective plane.
        data, drawn: chart points (N, 2), (M, 2); the same number of each where there are enough.
        measure, scale: of the density's colours.
        sheet: default a screen of 1600 pixels.
        most: dots of each.

    Raises:
        OrbiflowError: as `orbiflow.figures.density_map.map_picture`.
    """
    sheet, space = sheet or Sheet.screen(), density.space
    projection, coasts = map_and_coasts(space, drawn if data is None else data, options)
    pair = [
        ("data", None if data is None else places_on(space, projection, data)),
        ("samples", places_on(space, projection, drawn)),
    ]
    count = same_number([places for _, places in pair], most)
    coloured = coloured_map(density, projection, measure, scale) if data is None else None
    notes = ["dots are points"] if coloured is None else [colours_note(coloured.why)]
    words = caption(space, projection, notes, coasts=bool(coasts))
    disc = isinstance(projection, Azimuthal)
    stacked = not disc or (sheet.printed and sheet.width < _BESIDE)
    room = Room(3.6, 1.8, 3.6, 3.8, 7.4, 0) if disc else Room(3.6, 2.4, 1.8, 2.2, 4.4, 0.0)
    if disc and stacked:
        room = room._replace(gap=5.6)
    ratio = aspect(projection)
    figure, panels, side = two_panels(sheet, with_words(room, words, sheet), ratio, stacked=stacked)
    for axes, (name, places) in zip(panels, pair, strict=True):
        set_limits(axes, projection)
        if places is None:
            assert coloured is not None
            coloured.on(axes)
        else:
            axes.fill(*projection.outline().T, color=GROUND, linewidth=0, zorder=0)
            draw_panel(axes, places, count, dot_shrink(sheet, max(1.0, side / ratio)))
        light = places is not None
        dress_map(axes, projection, sheet, side, coastlines=coasts, light=light)
        pad = sheet.text * (2.2 if disc else 0.6)
        known = len(drawn if name == "samples" or data is None else data)
        axes.set_title(head(name, places, count, known), fontsize=sheet.text, pad=pad)
    if not sheet.printed:
        write_below(figure, words, sheet)
    first = "Density" if data is None else "Data"
    return Picture(figure, sheet, f"{first} and samples on the {space_title(space)}", words)
