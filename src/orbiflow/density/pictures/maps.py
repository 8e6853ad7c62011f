"""Pictures of densities of directions or axes on maps, and the map that suits them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models import Density
from orbiflow.density.pictures import frames, projections
from orbiflow.density.pictures.colours import chosen_scale, density_on_map, is_sharp, shading
from orbiflow.density.pictures.frames import chart_points, degrees_text
from orbiflow.density.pictures.map_axes import draw_map_lines, graticule
from orbiflow.density.pictures.overlays import LIGHT, Colouring, log_natural
from orbiflow.density.pictures.projections import Azimuthal, Projection
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.density.spaces import RoundSpace, Space, to_latlon, to_vectors
from orbiflow.drawing import Sheet
from orbiflow.errors import OrbiflowError, SettingError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_PIXELS = 200_000
"""About how many pixels a density is evaluated at: sharp in two columns of a journal."""

_MARGIN = 3
"""Pixels evaluated beyond the outline, which is cut out of the picture as a curve."""

_BESIDE = 120 / 25.4
"""Inches of a printed figure below which discs are above each other, for room round their rims."""


class Map:
    """A map of the sphere or the projective plane, with coastlines (N, 2) in degrees."""

    caption_below = True

    def __init__(
        self, space: Space, projection: Projection, coastlines: Sequence[Array] = ()
    ) -> None:
        self.space, self.projection, self.coastlines = space, projection, coastlines
        self.outline = projection.outline()
        width, height = np.ptp(self.outline, axis=0)
        self.width, self.aspect = float(width), float(width / height)
        self.is_disc = isinstance(projection, Azimuthal)
        self.title_gap = 2.2 if self.is_disc else 0.6

    def places(self, points: Tensor) -> Array:
        """Return places (M, 2) of chart points (N, 2); of axes, those of the end that the map shows."""
        space, projection = self.space, self.projection
        vectors = cast(RoundSpace, space).vectors(chart_points(space, points))
        if space.name == "projective-plane" and isinstance(projection, Azimuthal):
            vectors = np.where(vectors @ projection.frame[2] < 0, -1.0, 1.0)[:, None] * vectors
        latlon = to_latlon(vectors)
        return projection.forward(latlon[projection.contains(latlon)])

    def colouring(self, density: Density, settings: PlotSettings) -> Colouring:
        pixels = pixels_of(self.projection)
        points = cast(RoundSpace, self.space).vectors_to_chart(to_vectors(pixels.latlon))
        values = density_on_map(density, points, settings.measure, pixels.angle)
        log, reason = chosen_scale(density, settings.measure, settings.scale)
        shade = shading(values[pixels.within], pixels.areas[pixels.within], log=log)
        logs = None
        if settings.regions:
            logs = pixels.table(log_natural(density, values, points, settings.measure), math.nan)
        note = ""
        if is_sharp(density, angle=pixels.angle):
            size = f"{math.degrees(pixels.angle):.2g}°"
            note = f"peaks narrower than {size} are averaged over it"
        places = pixels.table(shade.places(values), 0.0)
        return Colouring(places, pixels.extent, shade, reason, note, logs, self.outline)

    def room(self, sheet: Sheet, label: str, ticks: Sequence[str]) -> frames.Room:
        above = 0.8 if sheet.printed else 3.2
        if self.is_disc and (not sheet.printed or sheet.width >= frames.NARROW):
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
        axes.fill(*self.outline.T, color=LIGHT, linewidth=0, zorder=0)

    def draw_axes(self, axes: Axes, sheet: Sheet, side: float, panel: frames.Panel) -> None:
        """Draw the outline, the graticule with its degrees, and coastlines."""
        draw_map_lines(
            axes, self.projection, sheet, side, coastlines=self.coastlines, light=panel.light
        )

    def caption(self, notes: Sequence[str], dots: tuple[int, int] | None) -> str:
        """Return projection, centre, which points are one, lines and dots, and notes.

        >>> from orbiflow.density import Sphere
        >>> from orbiflow.density.pictures.projections import Mollweide
        >>> Map(Sphere(), Mollweide((0.0, 150.0))).caption([], None)
        'The sphere in the Mollweide projection (equal-area), about 150° E. Lines every 30°.'
        """
        parts = [self._description()]
        if self.space.name == "projective-plane":
            parts.append("An axis is drawn at the end in this hemisphere")
            parts[-1] += "; opposite points of the rim are one axis"
        lats, lons = graticule(self.projection)
        steps = {line[1] - line[0] for line in (lats, lons) if len(line) > 1}
        lines = f"Lines every {min(steps):g}°"
        if len(steps) > 1:
            lines = (
                f"Parallels every {lats[1] - lats[0]:g}°, meridians every {lons[1] - lons[0]:g}°"
            )
        parts.append(lines + (", and coastlines" if self.coastlines else ""))
        if dots is not None:
            shown, known = dots
            parts.append(f"Dots are {f'{shown} of ' if shown < known else ''}{known} points")
        parts += [note[0].upper() + note[1:] for note in notes]
        return " ".join(f"{part}." for part in parts)

    def _description(self) -> str:
        projection, frame = self.projection, ""
        lat, lon = projection.center
        if self.space.columns[0] != "lat":
            frame = "; latitudes are from the x, y plane towards z, longitudes from x towards y"
        middle = degrees_text((lon + 180) % 360 - 180, "EW")
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
        if not (isinstance(projection, Azimuthal) and projection.flipped):
            return projection.title
        return "Schmidt net (equal-area)" if projection.is_equal_area else "Wulff net (equal-angle)"

    def samples_caption(self, notes: Sequence[str]) -> str:
        return self.caption(notes or ["dots are points"], None)

    def write_on_screen(
        self,
        frame: frames.Frame,
        sheet: Sheet,
        title: str,
        notes: Sequence[str],
        dots: tuple[int, int] | None,
    ) -> None:
        top = 1 - 1.6 * sheet.em / frame.figure.get_size_inches()[1]
        frame.figure.text(
            0.5, top, f"{title}: {self._subtitle}", ha="center", va="center",
            fontsize=1.15 * sheet.text,
        )  # fmt: skip
        frames.write_caption(frame.figure, self.caption(notes, dots), sheet)


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
    from scipy.ndimage import binary_dilation

    ring = projection.outline()
    low, high = ring.min(axis=0), ring.max(axis=0)
    step = math.sqrt(float(np.prod(high - low)) / (count or _PIXELS))
    counts = np.ceil((high - low) / step).astype(int) + 2 * _MARGIN
    first = (low + high) / 2 - step * counts / 2
    x, y = (first[k] + step * (np.arange(counts[k]) + 0.5) for k in (0, 1))
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    within = Path(ring).contains_points(places)
    shown = within.reshape(counts[::-1])
    shown = binary_dilation(shown, iterations=_MARGIN)
    kept = shown.ravel()
    latlon = projection.inverse(places[kept])
    last = first + step * counts
    extent = (float(first[0]), float(last[0]), float(first[1]), float(last[1]))
    return Pixels(shown, latlon, within[kept], _areas(projection, latlon), step, extent)


def _areas(projection: Projection, latlon: Array) -> Array:
    """Return the areas on the sphere of equal pixels of the map."""
    if projection.is_equal_area:
        return np.ones(len(latlon))
    if isinstance(projection, Azimuthal):
        cosines = to_vectors(latlon) @ projection.frame[2]
        return ((1 + cosines) / 2) ** 2  # conformal: scale 2 / (1 + cos), squared
    return np.cos(np.radians(latlon[:, 0]))


_NET_WORDS = ("inc", "plunge", "dip")
"""How names of the first column begin if rows are directions in a net, not places on a globe."""

_RADII = (5, 10, 15, 20, 30, 40, 50, 60, 75)
_SHARE = 0.995
"""Share of the points that a map of less than the sphere has to show."""


def chosen_map(
    space: Space,
    points: Tensor,
    settings: PlotSettings | None = None,
    names: Sequence[str] | None = None,
) -> Projection:
    """Return the map of a sphere or projective plane that settings ask for, or that suits points.

    `points` are chart points (N, 2); `names` of the data's columns may ask for a net.

    >>> from orbiflow.density import Sphere
    >>> here = Sphere().to_chart([[40.0, 140.0], [44.0, 142.0]])
    >>> chosen_map(Sphere(), here)
    Lambert(center=(42.0, 141.0), radius=5.0, flipped=False)
    """
    if not space.is_round:
        raise OrbiflowError(f"maps are of the sphere and the projective plane, not of {space!r}")
    settings = settings or PlotSettings()
    projection, radius = settings.projection, settings.radius
    middle = settings.center
    if middle is not None and not (len(middle) in (1, 2) and all(map(math.isfinite, middle))):
        raise SettingError(
            "{center} must be a latitude and a longitude, or a longitude, in degrees, such as 40,140, "
            f"got {list(middle)}"
        )
    axial = space.name == "projective-plane"
    cap = None if axial else smallest_cap(cast(RoundSpace, space).vectors(points))
    if projection == "auto":
        if axial:
            a_net = bool(names and names[0].strip().lower().startswith(_NET_WORDS))
            projection = "schmidt" if a_net and middle is None else "lambert"
        elif middle is not None:
            projection = "lambert" if len(middle) == 2 and middle[0] else "equal-earth"
        else:
            projection = "equal-earth" if cap is None and radius is None else "lambert"
    kind = projections.PROJECTIONS[projection]
    if issubclass(kind, projections.WorldMap):
        if axial:
            discs = [n for n, c in projections.PROJECTIONS.items() if issubclass(c, Azimuthal)]
            raise SettingError(
                "a direction and its opposite are one point of the projective plane, which needs a "
                f"map of one hemisphere: {{projection}} must be {', '.join(discs)}, got {projection}"
            )
        if radius is not None:
            raise SettingError(
                f"a map of the whole sphere ({projection}) has no radius: leave {{radius}} out"
            )
        lat, lon = (0.0, 0.0, *(middle or ()))[-2:]
        return kind((lat, lon))
    if projection in ("schmidt", "wulff"):
        if middle is not None:
            raise SettingError(
                f"{{center}} does not apply to a {projection} net, which has the vertical in its "
                "middle: give no centre"
            )
        return kind((90.0, 0.0), float(radius or 90.0), flipped=True)
    reach = 90.0
    if middle is None:
        middle, reach = cap or ((90.0, 0.0), 90.0)
    elif len(middle) == 1:
        middle = (90.0 if axial else 0.0, *middle)
    return kind((middle[0], middle[1]), float(radius or reach))


def smallest_cap(vectors: Array) -> tuple[tuple[float, float], float] | None:
    """Return a centre in whole degrees, and a radius that shows nearly all unit vectors (N, 3).

    It is None if they do not fit into 75 degrees around a centre.
    """
    mean = vectors.mean(axis=0) if len(vectors) else np.zeros(3)
    if np.linalg.norm(mean) < 0.2:
        return None
    lat, lon = to_latlon(mean[None] / np.linalg.norm(mean))[0].round() + 0.0
    middle = to_vectors([[lat, lon]])[0]
    apart = np.degrees(np.arccos(np.clip(vectors @ middle, -1, 1)))
    reach = 1.1 * float(np.quantile(apart, _SHARE, method="higher"))
    fitting = [float(r) for r in _RADII if r >= reach]
    return ((float(lat), float(lon)), fitting[0]) if fitting else None
