"""Pictures of densities of directions or axes on maps, with graticule, degrees and coastlines."""

# matplotlib types no keyword arguments
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models import Density
from orbiflow.density.pictures import frames
from orbiflow.density.pictures.colours import round_pixel
from orbiflow.density.pictures.frames import INK, LETTER_EMS, chart_points, degrees_text
from orbiflow.density.pictures.grounds import LIGHT, Ground, Pixels
from orbiflow.density.pictures.projections import Azimuthal, Projection
from orbiflow.density.spaces import RoundSpace, Space, to_latlon, to_vectors
from orbiflow.drawing import Sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PIXELS = 200_000
"""About how many pixels a density is evaluated at: sharp in two columns of a journal."""

_MARGIN = 3
"""Pixels evaluated beyond the outline, which is cut out of the picture as a curve."""

_BESIDE = 120 / 25.4
"""Inches of a printed figure below which discs are above each other, for room round their rims."""


class Map(Ground):
    """A map of the sphere or the projective plane, with coastlines (N, 2) in degrees."""

    def __init__(
        self, space: Space, projection: Projection, coastlines: Sequence[Array] = ()
    ) -> None:
        self.space, self.projection, self.coastlines = space, projection, coastlines
        self.outline = self.ring = projection.outline()
        width, height = np.ptp(self.ring, axis=0)
        self.width, self.aspect = float(width), float(width / height)
        self.is_disc = projection.is_disc
        self.title_gap = 2.2 if self.is_disc else 0.6

    def places(self, points: Tensor) -> Array:
        """Return places (M, 2) of chart points (N, 2); of axes, those of the end that the map shows."""
        space, projection = self.space, self.projection
        vectors = cast(RoundSpace, space).vectors(chart_points(space, points))
        if space.name == "projective-plane" and isinstance(projection, Azimuthal):
            vectors = np.where(vectors @ projection.frame[2] < 0, -1.0, 1.0)[:, None] * vectors
        latlon = to_latlon(vectors)
        return projection.forward(latlon[projection.contains(latlon)])

    def pixels_for(self, density: Density) -> int:  # noqa: ARG002
        return _PIXELS

    def pixels(self, count: int) -> Pixels:
        from matplotlib.path import Path
        from scipy.ndimage import binary_dilation

        ring, projection = self.ring, self.projection
        low, high = ring.min(axis=0), ring.max(axis=0)
        step = math.sqrt(float((high - low).prod()) / count)
        counts = np.ceil((high - low) / step).astype(int) + 2 * _MARGIN
        first = (low + high) / 2 - step * counts / 2
        axes: list[Array] = [first[k] + step * (np.arange(int(counts[k])) + 0.5) for k in (0, 1)]
        places: Array = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
        within = Path(ring).contains_points(places)
        shown = binary_dilation(within.reshape(counts[::-1]), iterations=_MARGIN)
        kept, last = shown.ravel(), first + step * counts
        latlon = projection.inverse(places[kept])
        points = cast(RoundSpace, self.space).vectors_to_chart(to_vectors(latlon))
        extent = (float(first[0]), float(last[0]), float(first[1]), float(last[1]))
        areas, size = projection.areas(latlon), f"{math.degrees(step):.2g}°"
        return Pixels(points, shown, within[kept], areas, round_pixel(step), size, extent)

    def room(self, sheet: Sheet, label: str, ticks: Sequence[str]) -> frames.Room:
        above = 0.8 if sheet.printed else 3.2
        if self.is_disc and (not sheet.printed or sheet.width >= frames.NARROW_INCHES):
            beside = frames.Room(3.6, 1.8, 0.0, above + 1.2, 4.4, 1.2)
            return frames.room_for_bar_beside(sheet, beside, label, ticks)
        left, right, top = (3.4, 3.4, 1.2) if self.is_disc else (3.6, 1.8, 0.0)
        under = frames.Room(left, 0.0, right, above + top, 2.2, 1.0)
        return frames.room_for_bar_below(sheet, under, label)

    def panels_room(self, sheet: Sheet) -> tuple[frames.Room, bool]:
        if not self.is_disc:
            return frames.Room(3.6, 2.4, 1.8, 2.2, 4.4, 0.0), True
        stacked = sheet.printed and sheet.width < _BESIDE
        return frames.Room(3.6, 1.8, 3.6, 3.8, 5.6 if stacked else 7.4, 0.0), stacked

    def fill(self, axes: Axes) -> None:
        axes.fill(*self.ring.T, color=LIGHT, linewidth=0, zorder=0)

    def draw_axes(self, axes: Axes, sheet: Sheet, side: float, panel: frames.Panel) -> None:
        """Draw the outline, the graticule with its degrees, and coastlines, without a frame."""
        projection, ring = self.projection, self.ring
        axes.set_axis_off()
        axes.set_xticks([])
        axes.set_yticks([])
        axes.set_xlim(*(ring[:, 0].min(), ring[:, 0].max()))
        axes.set_ylim(*(ring[:, 1].min(), ring[:, 1].max()))
        axes.set_aspect("equal")
        axes.plot(*ring.T, color=INK, linewidth=sheet.pen(1.2, 0.4), clip_on=False, zorder=7)
        lats, lons = graticule(projection)
        style: dict[str, Any] = {"color": "#9a9a96" if panel.light else "#ffffff"}
        style |= {"alpha": 0.8 if panel.light else 0.35, "linewidth": sheet.pen(0.6, 0.2)}
        for each in (*map(parallel, lats), *map(meridian, lons)):
            for piece in projection.pieces(each):
                axes.plot(*piece.T, **style, zorder=3, solid_capstyle="butt")
        labels = _Labels(axes, self, sheet, 72 * side / self.width, panel.light)
        if self.coastlines:
            self._draw_coastlines(axes, sheet, _TOLERANCE / labels.size, panel.light)
        (labels.along_the_rim if self.is_disc else labels.along_the_sides)(lats, lons)

    def _draw_coastlines(self, axes: Axes, sheet: Sheet, apart: float, light: bool) -> None:
        from matplotlib.collections import LineCollection
        from shapely import LineString

        pieces = [piece for line in self.coastlines for piece in self.projection.pieces(line)]
        # below the resolution of any printer; islands of a point stay as dots
        fine = [np.array(LineString(piece).simplify(apart).coords) for piece in pieces]
        drawn = LineCollection(
            fine, colors="#85857f" if light else COAST, zorder=4, capstyle="round",
            linewidths=sheet.pen(0.7, 0.25),
        )  # fmt: skip
        axes.add_collection(drawn, autolim=False)

    def caption(self, notes: Sequence[str], dots: tuple[int, int] | None) -> str:
        """Return projection, centre, which points are one, lines and dots, and notes.

        >>> from orbiflow.density import Sphere
        >>> from orbiflow.density.pictures.projections import Mollweide
        >>> Map(Sphere(), Mollweide((0.0, 150.0))).caption([], None)
        'The sphere in the Mollweide projection (equal-area), about 150° E. Lines every 30°.'
        """
        parts = [self._description()]
        if self.space.name == "projective-plane":
            parts.append(
                "An axis is drawn at the end in this hemisphere; opposite points of the rim are one "
                "axis"
            )
        steps = [line[1] - line[0] for line in graticule(self.projection) if len(line) > 1]
        lines = f"Lines every {min(steps):g}°"
        if min(steps) < max(steps):
            lines = "Parallels every {:g}°, meridians every {:g}°".format(*steps)
        parts.append(lines + (", and coastlines" if self.coastlines else ""))
        if dots is not None:
            shown, count = dots
            parts.append(f"Dots are {f'{shown} of ' if shown < count else ''}{count} points")
        return frames.sentences([*parts, *notes])

    def _description(self) -> str:
        projection, frame = self.projection, ""
        lat, lon = projection.center
        if self.space.columns[0] != "lat":
            frame = "; latitudes are from the x, y plane towards z, longitudes from x towards y"
        middle = longitude_text(lon, "EW", from_zero=cast(RoundSpace, self.space).from_zero)
        if not isinstance(projection, Azimuthal):
            return f"The sphere in {projection.title}, about {middle}{frame}"
        if projection.flipped:
            return (
                f"Lower hemisphere, {self._subtitle}: the vertical (latitude, plunge or inclination "
                "90°) is in the middle, longitude (trend, declination) runs clockwise from the top"
            )
        within = f"What is within {projection.radius:g}°"
        if projection.radius == 90:
            within = "The hemisphere"
        where = f"{degrees_text(lat, 'NS')}, {middle}"
        if abs(lat) == 90:
            where = f"the {'north' if lat > 0 else 'south'} pole"
        return f"{within} about {where} in {projection.title}, seen from outside{frame}"

    @property
    def _subtitle(self) -> str:
        """The projection as a title has it."""
        projection = self.projection
        if not projection.flipped:
            return projection.title
        return (
            "Schmidt net (equal-area)"
            if projection.name == "lambert"
            else "Wulff net (equal-angle)"
        )

    def samples_caption(self, notes: Sequence[str]) -> str:
        return self.caption(notes or ["dots are points"], None)

    def write_title(self, axes: Axes, sheet: Sheet, title: str) -> None:
        figure = cast("Figure", axes.figure)
        top = 1 - 1.6 * sheet.em / figure.get_size_inches()[1]
        figure.text(
            0.5, top, f"{title}: {self._subtitle}", ha="center", va="center",
            fontsize=1.15 * sheet.text,
        )  # fmt: skip


COAST = "#ffffff"
_TOLERANCE = 0.03
"""Points (1/72 inch) by which a coast may be off, so that files stay small."""


def graticule(projection: Projection) -> tuple[list[float], list[float]]:
    """Return the latitudes and longitudes, in degrees, of the lines that are drawn."""
    step = along = 30.0
    if isinstance(projection, Azimuthal):
        step = next(s for s in (1.0, 2.0, 5.0, 10.0, 15.0, 30.0) if s >= projection.radius / 3.5)
        # meridians draw together towards the poles
        nearest = min(abs(projection.center[0]), 89.0)
        along = min(30.0, step / max(np.cos(np.radians(nearest)), 0.05))
        along = min((s for s in (1, 2, 5, 10, 15, 30) if s >= 0.7 * along), default=30.0)
    lats = np.arange(-90 + step, 90, step)
    return lats.tolist(), np.arange(-180.0, 180.0, along).tolist()


def parallel(lat: float) -> Array:
    """Return the parallel of a latitude, (361, 2)."""
    lon = np.linspace(-180.0, 180.0, 361)
    return np.stack([np.full_like(lon, lat), lon], axis=-1)


def meridian(lon: float) -> Array:
    """Return the meridian of a longitude from pole to pole, (181, 2)."""
    lat = np.linspace(-90.0, 90.0, 181)
    return np.stack([lat, np.full_like(lat, lon)], axis=-1)


def longitude_text(lon: float, letters: str, *, from_zero: bool) -> str:
    """Return a longitude as text, from -180 to 180 or from 0 to 360 degrees."""
    first = 0 if from_zero else -180
    return degrees_text((lon - first) % 360 + first, letters)


class _Labels:
    """The degrees beside the lines of a graticule, `size` points a unit, none of which touch."""

    def __init__(self, axes: Axes, ground: Map, sheet: Sheet, size: float, light: bool) -> None:
        projection = ground.projection
        self.axes, self.projection, self.sheet, self.light = axes, projection, sheet, light
        self.size, self.is_net = size, projection.flipped
        self.from_zero = self.is_net or cast(RoundSpace, ground.space).from_zero
        self.north_south, self.east_west = ("", "") if self.is_net else ("NS", "EW")
        self.boxes: list[Array] = []

    def latitude(self, lat: float) -> str:
        return degrees_text(lat, self.north_south)

    def longitude(self, lon: float) -> str:
        return longitude_text(lon, self.east_west, from_zero=self.from_zero)

    def along_the_sides(self, lats: list[float], lons: list[float]) -> None:
        """Write latitudes at the left and longitudes below, or on the equator if poles are points."""
        projection, gap = self.projection, 0.5 * self.sheet.small
        west = projection.center[1] - 180 + 1e-7
        for lat in lats:
            end = projection.forward(np.array([[lat, west]]))[0]
            self._outside(self.latitude(lat), end, (-gap, 0.0), ha="right", va="center")
        inside = projection.has_pole_points
        middle, at = projection.center[1], 0.0 if inside else -90.0
        ends = projection.forward(np.array([[at, middle], [at, middle + 60.0]]))
        room = self.size * float(np.ptp(ends[:, 0]))
        letters = 7.5 * LETTER_EMS * self.sheet.small  # texts must not touch
        step = next((s for s in (60.0, 90.0, 120.0) if room * s / 60 > letters), 180.0)
        turns = sorted(((lon - middle + 180) % 360 - 180) for lon in lons if lon % step == 0)
        turns = [*turns, 180.0] if turns[0] == -180 else turns
        for turn in turns:
            lon = np.array([[at, middle + turn - 1e-7 * np.sign(turn)]])
            place = projection.forward(lon)[0]
            text = self.longitude(middle + turn)
            if not inside:
                self._outside(text, place, (0.0, -gap), ha="center", va="top")
            elif abs(turn) != 180:
                self._inside(text, place)

    def along_the_rim(self, lats: list[float], lons: list[float]) -> None:
        """Write texts where lines meet the rim, else on them."""
        projection = self.projection
        assert isinstance(projection, Azimuthal)
        lat0, lon0 = projection.center
        polar = abs(lat0) > 89
        level = min(lats, key=lambda lat: abs(lat - lat0))
        order = sorted(lons, key=lambda v: (v % 90 != 0, v % 60 != 0))
        missed = [lon for lon in order if not self._at_rim(meridian(lon), self.longitude(lon))]
        if not polar:
            lats = [lat for lat in lats if not self._at_rim(parallel(lat), self.latitude(lat))]
        inside = [(self.latitude(lat), lat, lon0 + (15 if polar else 0)) for lat in lats]
        inside += [(self.longitude(lon), level, lon) for lon in ([] if polar else missed)]
        for text, lat, lon in inside:
            direction = np.array([[lat, lon]])
            if projection.contains(direction)[0]:
                self._inside(text, projection.forward(direction)[0])

    def _at_rim(self, line: Array, text: str) -> bool:
        """Write a text outside the rim, where a line meets it, and return whether there was room."""
        projection = self.projection
        assert isinstance(projection, Azimuthal)
        done = False
        for piece in projection.pieces(line):
            for end in piece[[0, -1]]:
                radius = float(np.hypot(*end))
                at_rim = abs(radius / projection.rim - 1) < 1e-3
                if not at_rim or abs(projection.inverse(end[None])[0, 0]) > 89:
                    continue
                way = end / radius
                ha = "left" if way[0] > 0.3 else "right" if way[0] < -0.3 else "center"
                va = "bottom" if way[1] > 0.3 else "top" if way[1] < -0.3 else "center"
                shift = 0.45 * self.sheet.small * way
                done = self._outside(text, end, shift, ha=ha, va=va) or done
        return done

    def _outside(self, text: str, place: Array, shift: Any, *, ha: str, va: str) -> bool:
        if not self._free(text, self.size * place + shift, ha, va):
            return False
        self.axes.annotate(
            text, (float(place[0]), float(place[1])), xytext=tuple(shift), ha=ha, va=va,
            textcoords="offset points",
            fontsize=self.sheet.small, color=INK, annotation_clip=False,
        )  # fmt: skip
        return True

    def _inside(self, text: str, place: Array) -> None:
        projection = self.projection
        if isinstance(projection, Azimuthal) and np.hypot(*place) > 0.92 * projection.rim:
            return
        if not self._free(text, self.size * place, "center", "center"):
            return
        box = {"boxstyle": "round,pad=0.15", "linewidth": 0.0}
        box |= {"facecolor": "#ffffff" if self.light else "#000000", "alpha": 0.4}
        self.axes.text(
            float(place[0]), float(place[1]), text, ha="center", va="center",
            fontsize=self.sheet.small, color=INK if self.light else "#ffffff", bbox=box, zorder=6,
        )  # fmt: skip

    def _free(self, text: str, at: Array, ha: str, va: str) -> bool:
        """Return whether there is no text yet, and reserve the place."""
        size = np.array([(len(text) + 0.8) * LETTER_EMS, 1.3]) * self.sheet.small
        left = {"left": 0.0, "center": 0.5, "right": 1.0}[ha]
        low = {"bottom": 0.0, "center": 0.5, "top": 1.0}[va]
        corner = np.asarray(at) - size * (left, low)
        box = np.stack([corner, corner + size])
        if any((box[0] < other[1]).all() and (other[0] < box[1]).all() for other in self.boxes):
            return False
        self.boxes.append(box)
        return True
