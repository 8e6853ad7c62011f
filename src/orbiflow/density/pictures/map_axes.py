"""Lines on maps: the outline, the graticule with its degrees, and coastlines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density.pictures.frames import INK, LETTER, degrees_text
from orbiflow.density.pictures.projections import Azimuthal, Mollweide, Projection, WorldMap
from orbiflow.drawing import Sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COAST = "#ffffff"
_TOLERANCE = 0.03
"""Points (1/72 inch) by which a coast may be off, so that files stay small."""


def draw_map_lines(
    axes: Axes,
    projection: Projection,
    sheet: Sheet,
    side: float,
    *,
    coastlines: Sequence[Array] = (),
    light: bool = False,
) -> None:
    """Draw a map's outline, graticule, labels and coastlines (M, 2) on axes without a frame."""
    ring = projection.outline()
    axes.set_axis_off()
    axes.set_xticks([])
    axes.set_yticks([])
    axes.set_xlim(*(ring[:, 0].min(), ring[:, 0].max()))
    axes.set_ylim(*(ring[:, 1].min(), ring[:, 1].max()))
    axes.set_aspect("equal")
    axes.plot(*ring.T, color=INK, linewidth=sheet.pen(1.2, 0.4), clip_on=False, zorder=7)
    lats, lons = graticule(projection)
    line = "#9a9a96" if light else "#ffffff"
    style: dict[str, Any] = {"color": line, "linewidth": sheet.pen(0.6, 0.2)}
    style |= {"alpha": 0.8 if light else 0.35, "zorder": 3, "solid_capstyle": "butt"}
    for each in (*map(parallel, lats), *map(meridian, lons)):
        for piece in projection.pieces(each):
            axes.plot(*piece.T, **style)
    labels = _Labels(axes, projection, sheet, side, light)
    if len(coastlines):
        from matplotlib.collections import LineCollection
        from shapely import LineString

        whole = [np.asarray(line, dtype=float) for line in coastlines]
        pieces = [piece for line in whole for piece in projection.pieces(line)]
        # below the resolution of any printer; islands of a point stay as dots
        apart = _TOLERANCE / labels.size
        fine = [np.array(LineString(piece).simplify(apart).coords) for piece in pieces]
        drawn = LineCollection(
            fine, colors="#85857f" if light else COAST, zorder=4, capstyle="round",
            linewidths=sheet.pen(0.7 if light else 0.9, 0.25),
        )  # fmt: skip
        axes.add_collection(drawn, autolim=False)
    if isinstance(projection, WorldMap):
        labels.along_the_sides(lats, lons)
    else:
        labels.along_the_rim(lats, lons)


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


class _Labels:
    """The degrees beside the lines of a graticule, none of which touch."""

    def __init__(
        self, axes: Axes, projection: Projection, sheet: Sheet, side: float, light: bool
    ) -> None:
        self.axes, self.projection, self.sheet, self.light = axes, projection, sheet, light
        self.size = 72 * side / float(np.ptp(projection.outline()[:, 0]))  # points a unit
        self.is_net = isinstance(projection, Azimuthal) and projection.flipped
        self.north_south, self.east_west = ("", "") if self.is_net else ("NS", "EW")
        self.boxes: list[Array] = []

    def latitude(self, lat: float) -> str:
        return degrees_text(lat, self.north_south)

    def longitude(self, lon: float) -> str:
        return degrees_text(lon % 360 if self.is_net else lon, self.east_west)

    def along_the_sides(self, lats: list[float], lons: list[float]) -> None:
        """Write latitudes at the left and longitudes below, or on the equator if poles are points."""
        projection, gap = self.projection, 0.5 * self.sheet.small
        west = projection.center[1] - 180 + 1e-7
        for lat in lats:
            end = projection.forward(np.array([[lat, west]]))[0]
            self._outside(self.latitude(lat), end, (-gap, 0.0), ha="right", va="center")
        inside = isinstance(projection, Mollweide)
        middle, at = projection.center[1], 0.0 if inside else -90.0
        ends = projection.forward(np.array([[at, middle], [at, middle + 60.0]]))
        room = self.size * float(np.ptp(ends[:, 0]))
        letters = 7.5 * LETTER * self.sheet.small  # texts must not touch
        step = next((s for s in (60.0, 90.0, 120.0) if room * s / 60 > letters), 180.0)
        turns = sorted(((lon - middle + 180) % 360 - 180) for lon in lons if lon % step == 0)
        turns = [*turns, 180.0] if turns[0] == -180 else turns
        for turn in turns:
            lon = np.array([[at, middle + turn - 1e-7 * np.sign(turn)]])
            place = projection.forward(lon)[0]
            text = self.longitude((middle + turn + 180) % 360 - 180)
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
        size = np.array([(len(text) + 0.8) * LETTER, 1.3]) * self.sheet.small
        left = {"left": 0.0, "center": 0.5, "right": 1.0}[ha]
        low = {"bottom": 0.0, "center": 0.5, "top": 1.0}[va]
        corner = np.asarray(at) - size * (left, low)
        box = np.stack([corner, corner + size])
        if any((box[0] < other[1]).all() and (other[0] < box[1]).all() for other in self.boxes):
            return False
        self.boxes.append(box)
        return True
