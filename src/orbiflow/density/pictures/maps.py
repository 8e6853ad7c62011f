"""Pictures of densities of directions or axes on maps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models import Density
from orbiflow.density.pictures.axes import chart_points
from orbiflow.density.pictures.frame import (
    NARROW,
    Frame,
    Room,
    room_for_bar_below,
    room_for_bar_beside,
    write_caption,
)
from orbiflow.density.pictures.ground import (
    LIGHT,
    Colouring,
    Ground,
    Panel,
    Words,
    draw_density,
    draw_samples,
)
from orbiflow.density.pictures.map_axes import draw_map_lines
from orbiflow.density.pictures.map_choice import caption, chosen_map, subtitle
from orbiflow.density.pictures.projections import Azimuthal, Projection
from orbiflow.density.pictures.regions import log_natural, region_lines
from orbiflow.density.pictures.scale import shading
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.density.pictures.values import chosen_scale, density_on_map, is_sharp
from orbiflow.density.spaces import RoundSpace, Space, checked_table, to_latlon, to_vectors
from orbiflow.drawing import Picture, Sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_PIXELS = 200_000
"""About how many pixels a density is evaluated at: sharp in two columns of a journal."""

_MARGIN = 3
"""Pixels evaluated beyond the outline, which is cut out of the picture as a curve."""

_BESIDE = 120 / 25.4
"""Inches of a printed figure below which discs are above each other, for room round their rims."""


def map_picture(
    density: Density,
    samples: Tensor | None = None,
    settings: PlotSettings | None = None,
    *,
    about: Tensor | None = None,
    coastlines: Sequence[ArrayLike] = (),
    sheet: Sheet | None = None,
) -> Picture:
    """Draw a density on a map with its graticule.

    The density is evaluated at each pixel of the map, so that nothing is stretched or sewn; the
    pixels end at a curve. On the projective plane each axis is drawn at the end that the map shows.

    Args:
        density: A density on the sphere or the projective plane.
        samples: Data or samples to draw as dots, chart points (N, 2). Of too many a random choice is
            drawn, always the same; dots are smaller where they crowd.
        settings: How it is drawn.
        about: Chart points (N, 2) that the map should show. Default: `samples`.
        coastlines: Lines (M, 2) of latitude and longitude.
        sheet: The sheet. Default: that of the settings.

    Raises:
        OrbiflowError: If the density is on another space, or settings do not fit it.
    """
    settings = settings or PlotSettings()
    if about is None:
        about = torch.empty(0, 2) if samples is None else samples
    ground = Map(density.space, _projection(density.space, about, settings), coastlines)
    lines = region_lines(density, settings)
    return draw_density(ground, density, settings, dots=samples, regions=lines, sheet=sheet)


def map_samples_picture(
    density: Density,
    data: Tensor | None,
    samples: Tensor,
    settings: PlotSettings | None = None,
    *,
    coastlines: Sequence[ArrayLike] = (),
    sheet: Sheet | None = None,
) -> Picture:
    """Draw data and samples on two maps; without data, the density and samples.

    Args:
        density: A density on the sphere or the projective plane.
        data: Chart points (N, 2).
        samples: Chart points (M, 2).
        settings: How it is drawn.
        coastlines: Lines (M, 2) of latitude and longitude.
        sheet: The sheet. Default: that of the settings.

    Raises:
        OrbiflowError: As `map_picture`.
    """
    settings = settings or PlotSettings()
    projection = _projection(density.space, samples if data is None else data, settings)
    ground = Map(density.space, projection, coastlines)
    return draw_samples(ground, density, settings, data, samples, sheet=sheet)


def _projection(space: Space, about: Tensor, settings: PlotSettings) -> Projection:
    return chosen_map(space, chart_points(space, about), settings, settings.names)


class Map(Ground):
    """A map of the sphere or the projective plane.

    Raises:
        OrbiflowError: If coastlines are not lines (N, 2) of latitude and longitude.
    """

    caption_below = True

    def __init__(
        self, space: Space, projection: Projection, coastlines: Sequence[ArrayLike] = ()
    ) -> None:
        self.space, self.projection = space, projection
        self.coastlines = [checked_table(line, (2,), "a coastline") for line in coastlines]
        for line in self.coastlines:
            to_vectors(line)  # refuses latitudes beyond the poles
        self.outline = projection.outline()
        width, height = np.ptp(self.outline, axis=0)
        self.width, self.aspect = float(width), float(width / height)
        self.is_disc = isinstance(projection, Azimuthal)
        self.title_gap = 2.2 if self.is_disc else 0.6

    def places(self, points: Tensor) -> Array:
        return places_on(self.space, self.projection, points)

    def colouring(self, density: Density, settings: PlotSettings) -> Colouring:
        pixels = pixels_of(self.projection)
        points = cast(RoundSpace, self.space).vectors_to_chart(to_vectors(pixels.latlon))
        values = density_on_map(density, points, settings.measure, pixels.angle)
        chosen = chosen_scale(density, settings.measure, settings.scale)
        shade = shading(values[pixels.within], pixels.areas[pixels.within], log=chosen.log)

        def logs() -> Array:
            found = log_natural(density, values, points, settings.measure)
            return pixels.table(found, math.nan)

        note = ""
        if is_sharp(density, angle=pixels.angle):
            size = f"{math.degrees(pixels.angle):.2g}°"
            note = f"peaks narrower than {size} are averaged over it"
        places = pixels.table(shade.places(values), 0.0)
        return Colouring(places, pixels.extent, shade, chosen.reason, note, logs, self.outline)

    def room(self, sheet: Sheet, label: str, ticks: Sequence[str]) -> Room:
        above = 0.8 if sheet.printed else 3.2
        if self.is_disc and (not sheet.printed or sheet.width >= NARROW):
            beside = Room(3.6, 1.8, 0.0, above + 1.2, 4.4, 1.2)
            return room_for_bar_beside(sheet, beside, label, ticks)
        left, right, top = (3.4, 3.4, 1.2) if self.is_disc else (3.6, 1.8, 0.0)
        under = Room(left, 0.0, right, above + top, 2.2, 1.0)
        return room_for_bar_below(sheet, under, label)

    def panels_room(self, sheet: Sheet) -> tuple[Room, bool]:
        if not self.is_disc:
            return Room(3.6, 2.4, 1.8, 2.2, 4.4, 0.0), True
        stacked = sheet.printed and sheet.width < _BESIDE
        return Room(3.6, 1.8, 3.6, 3.8, 5.6 if stacked else 7.4, 0.0), stacked

    def fill(self, axes: Axes) -> None:
        axes.fill(*self.outline.T, color=LIGHT, linewidth=0, zorder=0)

    def draw_axes(self, axes: Axes, sheet: Sheet, side: float, panel: Panel) -> None:
        """Draw the outline, the graticule with its degrees, and coastlines."""
        draw_map_lines(
            axes, self.projection, sheet, side, coastlines=self.coastlines, light=panel.light
        )

    def caption(self, notes: Sequence[str], dots: tuple[int, int] | None) -> str:
        return caption(
            self.space, self.projection, notes, dots=dots, coastlines=bool(self.coastlines)
        )

    def samples_caption(self, notes: Sequence[str]) -> str:
        return self.caption(notes or ["dots are points"], None)

    def write_on_screen(self, frame: Frame, sheet: Sheet, title: str, words: Words) -> None:
        top = 1 - 1.6 * sheet.em / frame.figure.get_size_inches()[1]
        frame.figure.text(
            0.5, top, f"{title}: {subtitle(self.projection)}", ha="center", va="center",
            fontsize=1.15 * sheet.text,
        )  # fmt: skip
        write_caption(frame.figure, words.caption, sheet)


class Pixels(NamedTuple):
    """The pixels of a map that are drawn, in a rectangle whose lowest row is the first.

    - `shown`: Which pixels are on the map or next to it, (rows, columns) of bool.
    - `latlon`: Directions (N, 2) of these.
    - `within`: Which of these are on the map, (N,) of bool.
    - `areas`: Their areas (N,) on the sphere, up to a factor.
    - `angle`: A pixel's side on the sphere in radians, where it is largest.
    - `extent`: Left, right, bottom and top of the rectangle on the map.
    """

    shown: Array
    latlon: Array
    within: Array
    areas: Array
    angle: float
    extent: tuple[float, float, float, float]

    def table(self, values: Array, elsewhere: float) -> Array:
        """Return values (N,) in the rectangle, (rows, columns), with another value elsewhere."""
        table = np.full(self.shown.shape, elsewhere)
        table[self.shown] = values
        return table


def pixels_of(projection: Projection, count: int | None = None) -> Pixels:
    """Return about `count` pixels of a map, by default `_PIXELS`."""
    from matplotlib.path import Path

    ring = projection.outline()
    low, high = ring.min(axis=0), ring.max(axis=0)
    step = math.sqrt(float(np.prod(high - low)) / (count or _PIXELS))
    counts = np.ceil((high - low) / step).astype(int) + 2 * _MARGIN
    first = (low + high) / 2 - step * counts / 2
    x, y = (first[k] + step * (np.arange(counts[k]) + 0.5) for k in (0, 1))
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    within = Path(ring).contains_points(places)
    shown = within.reshape(counts[::-1])
    for _ in range(_MARGIN):
        shown = _grown(shown)
    kept = shown.ravel()
    latlon = projection.inverse(places[kept])
    last = first + step * counts
    extent = (float(first[0]), float(last[0]), float(first[1]), float(last[1]))
    return Pixels(shown, latlon, within[kept], _areas(projection, latlon), step, extent)


def _grown(shown: Array) -> Array:
    wider = shown.copy()
    wider[1:] |= shown[:-1]
    wider[:-1] |= shown[1:]
    wider[:, 1:] |= shown[:, :-1]
    wider[:, :-1] |= shown[:, 1:]
    return wider


def _areas(projection: Projection, latlon: Array) -> Array:
    """Return the areas on the sphere of equal pixels of the map."""
    if projection.is_equal_area:
        return np.ones(len(latlon))
    if isinstance(projection, Azimuthal):
        cosines = to_vectors(latlon) @ projection.frame[2]
        return ((1 + cosines) / 2) ** 2  # conformal: scale 2 / (1 + cos), squared
    return np.cos(np.radians(latlon[:, 0]))


def places_on(space: Space, projection: Projection, points: Tensor) -> Array:
    """Return the places (M, 2) of those of chart points (N, 2) that are on a map.

    Axes are placed at the end that the map shows.
    """
    vectors = cast(RoundSpace, space).vectors(chart_points(space, points))
    if space.name == "projective-plane" and isinstance(projection, Azimuthal):
        vectors = np.where(vectors @ projection.frame[2] < 0, -1.0, 1.0)[:, None] * vectors
    latlon = to_latlon(vectors)
    return projection.forward(latlon[projection.contains(latlon)])
