"""A density of directions or axes on a map."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict, Unpack, cast

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models import SymmetricDensity
from orbiflow.density.pictures.axes import chart_points, space_title
from orbiflow.density.pictures.dots import (
    MAX_DOTS,
    dot_shrink,
    draw_dots_over,
)
from orbiflow.density.pictures.frame import (
    NARROW,
    Room,
    bar_beside,
    bar_under,
    framed,
    shade_bar,
)
from orbiflow.density.pictures.legend import (
    SMALLER,
    wrapped_words,
    write_below,
)
from orbiflow.density.pictures.map_axes import (
    aspect,
    dress_map,
    set_limits,
)
from orbiflow.density.pictures.map_choice import (
    caption,
    chosen_map,
    subtitle,
)
from orbiflow.density.pictures.projections import Azimuthal, Projection
from orbiflow.density.pictures.regions import (
    RegionLine,
    draw_regions,
    log_natural,
    region_note,
)
from orbiflow.density.pictures.scale import (
    Shade,
    bar_label,
    bar_ticks,
    shading,
)
from orbiflow.density.pictures.square import COLOURS
from orbiflow.density.pictures.values import (
    chosen_scale,
    density_on_map,
    is_sharp_on_map,
)
from orbiflow.density.spaces import (
    RoundSpace,
    Space,
    checked_table,
    to_latlon,
    to_vectors,
)
from orbiflow.drawing import Picture, Sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage

_PIXELS = 200_000
"""At which a density is evaluated, about: sharp in two columns of a journal."""

_MARGIN = 3
"""Pixels evaluated beyond the outline, which is cut out of the picture as a curve."""


class MapOptions(TypedDict, total=False):
    """Of `map_picture` and `map_samples_picture`; see `orbiflow.figures.map_choice.chosen_map`."""

    projection: str | Projection
    center: Sequence[float] | None
    radius: float | None
    names: Sequence[str] | None
    coastlines: Sequence[ArrayLike] | None


def map_picture(
    density: SymmetricDensity,
    samples: Tensor | None = None,
    *,
    measure: str = "natural",
    scale: str = "linear",
    sheet: Sheet | None = None,
    about: Tensor | None = None,
    most: int = MAX_DOTS,
    regions: Sequence[RegionLine] = (),
    **options: Unpack[MapOptions],
) -> Picture:
    """A density on a map with its graticule.

    The density is evaluated at each pixel of the map, so that nothing is stretched or sewn; the pixels
    end at a curve. On the projective plane each axis is drawn at that of its ends which the map shows.

    Args:
        density: on the sphere or the projective plane.
        samples: data or samples to draw as dots, chart points (N, 2); smaller where they crowd.
        measure, scale: as for `orbiflow.figures.density_square.density_picture`.
        sheet: default a screen of 1600 pixels.
        most: dots, of more samples a random choice that is always the same.
        about: chart points (N, 2) that the map should show, default `samples`.
        regions: of highest density, whose edges are drawn as lines.

    Raises:
        OrbiflowError: for another space, and for options that do not fit it.
    """
    sheet, space = sheet or Sheet.screen(), density.space
    if about is None:
        about = torch.empty(0, 2) if samples is None else samples
    projection, coasts = map_and_coasts(space, about, options)
    drawn = coloured_map(density, projection, measure, scale)
    shade = drawn.shade
    label = bar_label(shade, space, measure)
    dots = None if samples is None else places_on(space, projection, samples)
    notes = [*([] if dots is None else [SMALLER]), drawn.why]
    notes += [region_note(regions)] if regions else []
    if is_sharp_on_map(density, drawn.pixels.angle):
        size = f"{math.degrees(drawn.pixels.angle):.2g}°"
        notes.append(f"peaks narrower than {size} are averaged over it")
    counts = None if dots is None else (min(most, len(dots)), len(dots))
    words = caption(space, projection, notes, dots=counts, coasts=bool(coasts))
    room = _room(sheet, projection, label, [tick.text for tick in bar_ticks(shade)], words)
    frame = framed(sheet, None, room=room, aspect=aspect(projection))
    set_limits(frame.axes, projection)
    image = drawn.on(frame.axes)
    if regions:
        drawn.draw_regions(frame.axes, regions, sheet)
    if dots is not None:
        shrink = dot_shrink(sheet, max(1.0, frame.side / aspect(projection)))
        left, right = frame.axes.get_xlim()
        draw_dots_over(frame.axes, dots, frame.side / (right - left), limit=most, shrink=shrink)
    dress_map(frame.axes, projection, sheet, frame.side, coastlines=coasts)
    shade_bar(image, frame, sheet, shade, label)
    title = f"Density on the {space_title(space)}"
    if not sheet.printed:
        frame.figure.text(
            0.5, 1 - 1.6 * sheet.em / frame.figure.get_size_inches()[1],
            f"{title}: {subtitle(projection)}", ha="center", va="center",
            fontsize=1.15 * sheet.text,
        )  # fmt: skip
        write_below(frame.figure, words, sheet)
    return Picture(frame.figure, sheet, title, words)


def map_and_coasts(
    space: Space, about: Tensor, options: MapOptions
) -> tuple[Projection, list[Array]]:
    """What is asked for, or suits.

    Raises:
        OrbiflowError: as `chosen_map`, and for coastlines that are not (N, 2).
    """
    asked: dict[str, Any] = dict(options)
    lines = asked.pop("coastlines", None) or ()
    coasts = [checked_table(line, (2,), "a coastline") for line in lines]
    for line in coasts:
        to_vectors(line)
    if isinstance(asked.get("projection"), Projection):
        return asked["projection"], coasts
    return chosen_map(space, chart_points(space, about), **asked), coasts


class ColouredMap(NamedTuple):
    """A density on a map.

    - `places`: (N,) of its pixels on the colour bar.
    - `why`: the scale is linear or logarithmic.
    - `log_natural`: called, (N,) logarithms of the density in natural measure: for lines alone.
    """

    projection: Projection
    pixels: Pixels
    places: Array
    shade: Shade
    why: str
    log_natural: Callable[[], Array]

    def draw_regions(self, axes: Axes, regions: Sequence[RegionLine], sheet: Sheet) -> None:
        """Lines about regions, cut out along the outline as the picture is."""
        from matplotlib.patches import Polygon

        table = np.full(self.pixels.shown.shape, np.nan)
        table[self.pixels.shown] = self.log_natural()
        ends, counts = np.reshape(self.pixels.extent, (2, 2)), table.shape[::-1]
        x, y = (
            low + (high - low) * (np.arange(count) + 0.5) / count
            for (low, high), count in zip(ends, counts, strict=True)
        )
        ring = Polygon(self.projection.outline().tolist(), closed=True, transform=axes.transData)
        draw_regions(axes, regions, x, y, table, sheet, ring)

    def on(self, axes: Axes) -> AxesImage:
        """One picture cut out along the outline: neither seams nor steps at the rim."""
        from matplotlib.patches import Polygon

        table = np.zeros(self.pixels.shown.shape)
        table[self.pixels.shown] = self.places
        image = axes.imshow(
            table, extent=self.pixels.extent, origin="lower", cmap=COLOURS,
            interpolation="bicubic", vmin=0, vmax=1, aspect="auto", zorder=1,
        )  # fmt: skip
        set_limits(axes, self.projection)
        ring = self.projection.outline().tolist()
        image.set_clip_path(Polygon(ring, closed=True, transform=axes.transData))
        return image


def coloured_map(
    density: SymmetricDensity, projection: Projection, measure: str, scale: str
) -> ColouredMap:
    """The colours of a density on a map.

    Raises:
        OrbiflowError: for an unknown measure or scale.
    """
    pixels = pixels_of(projection)
    points = cast(RoundSpace, density.space).vectors_to_chart(to_vectors(pixels.latlon))
    values = density_on_map(density, points, measure, pixels.angle)
    chosen = chosen_scale(density, measure, scale)
    shade = shading(values[pixels.within], pixels.areas[pixels.within], log=chosen.log)

    def logs() -> Array:
        return log_natural(density, values, points, measure)

    return ColouredMap(projection, pixels, shade.places(values), shade, chosen.why, logs)


class Pixels(NamedTuple):
    """Of a map that are drawn: a rectangle of (rows, columns) of them, from below.

    - `shown`: (rows, columns) of bool, those on the map or next to it.
    - `latlon`: (N, 2) directions of those.
    - `within`: (N,) of bool, those of them on the map.
    - `areas`: (N,) on the sphere, up to a factor.
    - `angle`: a pixel's side on the sphere, in radians, where it is largest.
    - `extent`: of the rectangle on the map: left, right, below, above.
    """

    shown: Array
    latlon: Array
    within: Array
    areas: Array
    angle: float
    extent: tuple[float, float, float, float]


def pixels_of(projection: Projection, count: int | None = None) -> Pixels:
    """About `count` pixels, default `_PIXELS`."""
    from matplotlib.path import Path

    ring = projection.outline()
    low, high = ring.min(axis=0), ring.max(axis=0)
    step = math.sqrt(float(np.prod(high - low)) / (count or _PIXELS))
    counts = np.ceil((high - low) / step).astype(int) + 2 * _MARGIN
    middle = (low + high) / 2
    first = middle - step * counts / 2
    x, y = (first[k] + step * (np.arange(counts[k]) + 0.5) for k in (0, 1))
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    outline = Path(ring)
    within = outline.contains_points(places)
    shown = within.reshape(counts[::-1])
    for _ in range(_MARGIN):
        shown = _grown(shown)
    kept = shown.ravel()
    latlon = projection.inverse(places[kept])
    extent = (
        *(first[0] + step * np.array([0, counts[0]])),
        *(first[1] + step * np.array([0, counts[1]])),
    )
    areas = _areas(projection, latlon)
    return Pixels(shown, latlon, within[kept], areas, step, extent)  # pyright: ignore


def _grown(shown: Array) -> Array:
    wider = shown.copy()
    wider[1:] |= shown[:-1]
    wider[:-1] |= shown[1:]
    wider[:, 1:] |= shown[:, :-1]
    wider[:, :-1] |= shown[:, 1:]
    return wider


def _areas(projection: Projection, latlon: Array) -> Array:
    """Of equal pixels of the map on the sphere."""
    if projection.is_equal_area:
        return np.ones(len(latlon))
    if isinstance(projection, Azimuthal):
        cosines = to_vectors(latlon) @ projection.frame[2]
        return ((1 + cosines) / 2) ** 2  # conformal: scale 2 / (1 + cos), squared
    return np.cos(np.radians(latlon[:, 0]))


def places_on(space: Space, projection: Projection, points: Tensor) -> Array:
    """Places (M, 2) of chart points (N, 2), of axes at the end that the map shows; those on it alone.

    Raises:
        OrbiflowError: for points of another shape.
    """
    vectors = cast(RoundSpace, space).vectors(chart_points(space, points))
    if space.name == "projective-plane" and isinstance(projection, Azimuthal):
        vectors = np.where(vectors @ projection.frame[2] < 0, -1.0, 1.0)[:, None] * vectors
    latlon = to_latlon(vectors)
    return projection.forward(latlon[projection.contains(latlon)])


def _room(
    sheet: Sheet, projection: Projection, label: str, ticks: Sequence[str], words: str
) -> Room:
    disc = isinstance(projection, Azimuthal)
    above = 0.8 if sheet.printed else 3.2
    beside = disc and (not sheet.printed or sheet.width >= NARROW)
    if beside:
        made = Room(3.6, 1.8, 0.0, above + 1.2, 4.4, 1.2)
        return _with_words(bar_beside(sheet, made, label, ticks), sheet, words)
    edges = (3.4, 3.4, 1.2) if disc else (3.6, 1.8, 0.0)
    made = Room(edges[0], 0.0, edges[1], above + edges[2], 2.2, 1.0)
    return _with_words(bar_under(sheet, made, label), sheet, words)


def _with_words(room: Room, sheet: Sheet, words: str) -> Room:
    if sheet.printed:
        return room
    more = 1.3 * (len(wrapped_words(words, sheet)) + 1)
    return room._replace(below=room.below + more, gap=room.gap)
