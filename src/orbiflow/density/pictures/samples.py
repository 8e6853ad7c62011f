"""Samples of a density beside the data, or beside the density where there are none."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Unpack

from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models import SymmetricDensity
from orbiflow.density.pictures.axes import (
    ANGLE_AXES,
    check_plane,
    dress,
    space_title,
    view_of,
)
from orbiflow.density.pictures.dots import (
    MAX_DOTS,
    dot_shrink,
    draw_dots,
)
from orbiflow.density.pictures.frame import (
    NARROW,
    Room,
    two_panels,
)
from orbiflow.density.pictures.legend import (
    caption,
    wrapped_words,
    write_below,
)
from orbiflow.density.pictures.square import DensityOptions, square_colours
from orbiflow.drawing import Picture, Sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DOT = "#3b528b"
GROUND = "#f4f4f1"


def samples_png(
    density: SymmetricDensity,
    data: Tensor | None,
    drawn: Tensor,
    *,
    width_px: int = 1600,
    **options: Unpack[DensityOptions],
) -> bytes:
    """PNG of `samples_picture`, which has the `options`, for a screen.

    Raises:
        OrbiflowError: as `samples_picture`, and for a size that cannot be made.
    """
    sheet = Sheet.screen(width_px)
    return samples_picture(density, data, drawn, sheet=sheet, **options).file()


def samples_picture(
    density: SymmetricDensity,
    data: Tensor | None,
    drawn: Tensor,
    *,
    measure: str = "natural",
    scale: str = "linear",
    names: Sequence[str] | None = None,
    center: Sequence[float] | None = None,
    sheet: Sheet | None = None,
    most: int = MAX_DOTS,
) -> Picture:
    """Data and samples side by side on the canonical square; without data, the density and samples.

    Args:
        density: on a two-dimensional space.
        data, drawn: chart points (N, 2), (M, 2), such as `space.to_chart(table)` and
            `density.sample((M,))`; the same number of each where there are enough.
        measure, scale: of the density's colours; see `density_picture`.
        names, center: of the axes; see `orbiflow.figures.density_axes.view_of`.
        sheet: default a screen of 1600 pixels.
        most: dots of each.

    Raises:
        OrbiflowError: for a space of another dimension, points of another shape, or names or a
            centre that do not fit.
    """
    sheet, space = sheet or Sheet.screen(), density.space
    check_plane(space)
    view = view_of(space, names, center)
    pair = [("data", None if data is None else view.places(data)), ("samples", view.places(drawn))]
    count = same_number([points for _, points in pair], most)
    coloured = square_colours(density, view, measure, scale) if data is None else None
    words = caption(
        space, dots=True, notes=[] if coloured is None else [colours_note(coloured.why)]
    )
    stacked = sheet.printed and sheet.width < NARROW
    angles = space.name in ANGLE_AXES
    room = Room(*((5.4, 4.2, 1.6, 2.4, 4.2, 0.0) if angles else (1.0, 1.0, 1.0, 2.4, 1.6, 0.0)))
    if stacked:
        room = room._replace(gap=room.below + 2.0)
    figure, panels, side = two_panels(sheet, with_words(room, words, sheet), stacked=stacked)
    for axes, (name, points) in zip(panels, pair, strict=True):
        if points is None:
            assert coloured is not None
            coloured.on(axes)
        else:
            draw_panel(axes, points, count, dot_shrink(sheet, side))
        dress(axes, view, sheet, places=False, upward=stacked or axes is panels[0])
        axes.set_title(head(name, points, count), fontsize=sheet.text, pad=0.7 * sheet.text)
    if not sheet.printed:
        write_below(figure, words, sheet)
    first = "Density" if data is None else "Data"
    return Picture(figure, sheet, f"{first} and samples on the {space_title(space)}", words)


def same_number(pair: Sequence[Array | None], most: int) -> int:
    """How many dots of each are drawn."""
    lengths = [len(points) for points in pair if points is not None and len(points)]
    return min([most, *lengths])


def colours_note(why: str) -> str:
    """Of a density without a bar of its own."""
    return f"{why}, from the least (dark) to the largest (light) density"


def with_words(room: Room, words: str, sheet: Sheet) -> Room:
    """Room for them below, on a screen; in print they are the caption."""
    if sheet.printed:
        return room
    return room._replace(below=room.below + 1.3 * (len(wrapped_words(words, sheet)) + 1))


def draw_panel(axes: Axes, points: Array, count: int, shrink: float) -> None:
    """Points (N, 2) on a light ground."""
    axes.set_facecolor(GROUND)
    draw_dots(axes, points, 0.5, limit=count, fill=DOT, shrink=shrink)


def head(name: str, points: Array | None, count: int, known: int = 0) -> str:
    """What a panel shows, of so many `known` points, which may not all be in it."""
    if points is None:
        return "density"
    shown, known = min(count, len(points)), max(known, len(points))
    return f"{shown} of {known} {name}" if shown < known else f"{known} {name}"
