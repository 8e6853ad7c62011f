"""Projections of the sphere onto a map, and the one that suits.

Directions are degrees (N, 2) of latitude and longitude, places on the map (N, 2) in radii of the
sphere.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, TypeAlias, cast

import numpy as np
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.density.spaces import RoundSpace, Space, to_latlon, to_vectors
from orbiflow.errors import OrbiflowError, SettingError
from orbiflow.settings import as_number

FINEST = 1.0
"""Degrees between points of lines that are drawn, at most, so that curves look smooth."""


@dataclass(frozen=True)
class _Centred:
    """A map of directions about `center`, a latitude and a longitude.

    - `name`: Its name in settings. `title`: Its name in a sentence.
    - `is_disc`: Whether it is a disc. `has_pole_points`: Whether the poles are points of its rim.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    is_disc: ClassVar[bool] = False
    has_pole_points: ClassVar[bool] = False

    center: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        as_number(self.center[0], "the centre's latitude", -90, 90)
        as_number(self.center[1], "the centre's longitude", -360, 360)

    def areas(self, latlon: Array) -> Array:
        """Return the areas (N,) on the sphere of equal small areas of the map, up to a factor."""
        return np.ones(len(latlon))


def refined(latlon: Array) -> Array:
    """Return a line (M, 2) of directions with points at most `FINEST` degrees apart.

    It is straight in latitude and longitude, as in GeoJSON (RFC 7946, 3.1.1), the short way round.
    """
    lon = np.unwrap(latlon[:, 1], period=360.0)
    steps = np.maximum(abs(np.diff(latlon[:, 0])), abs(np.diff(lon)))
    counts = np.maximum(np.ceil(steps / FINEST - 1e-9), 1).astype(int)
    knots = np.concatenate([[0], np.cumsum(counts)])
    at = np.arange(int(knots[-1]) + 1)
    lat, lon = (np.interp(at, knots, values) for values in (latlon[:, 0], lon))
    return np.stack([lat, wrapped(lon)], axis=-1)


def wrapped(lon: Array) -> Array:
    """Return longitudes in [-180, 180)."""
    return (lon + 180.0) % 360.0 - 180.0


def _without_points(lines: list[Array]) -> list[Array]:
    return [line for line in lines if len(line) > 1 and bool((line != line[0]).any())]


@dataclass(frozen=True)
class Azimuthal(_Centred, ABC):
    """A map of what is within `radius` degrees of the centre, in its true direction from there.

    It is seen from outside, north up, and at the poles with the centre's longitude down (north) or up
    (south).

    - `flipped`: Whether it is upside down, so that about the north pole longitudes run clockwise from
      the top: a net of structural geology and palaeomagnetism.
    """

    is_disc = True
    radius: float = 90.0
    flipped: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        as_number(self.radius, "the map's radius", above=0, most=90)

    @abstractmethod
    def distance(self, angle: Array) -> Array:
        """Return the distance from the map's middle at angles in radians from the centre."""

    @abstractmethod
    def angle(self, distance: Array) -> Array:
        """Return the angle in radians at a distance, the inverse of `distance`."""

    @property
    def rim(self) -> float:
        """The map's radius, in radii of the sphere."""
        return float(self.distance(np.array(math.radians(self.radius))))

    @property
    def frame(self) -> Array:
        """Unit vectors (3, 3) to the right, upwards and to the centre."""
        lat, lon = np.radians(self.center)
        east = np.array([-np.sin(lon), np.cos(lon), 0.0])
        out = to_vectors([self.center])[0]
        up = np.array([-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)])
        return np.stack([east, -up if self.flipped else up, out])

    def forward(self, latlon: Array) -> Array:
        """Return the places of directions."""
        return self._placed(to_vectors(latlon))

    def inverse(self, places: Array) -> Array:
        """Return directions of places, even a little off the map; longitudes are in [-180, 180)."""
        distance = np.linalg.norm(places, axis=1)
        angle = self.angle(distance)
        flat = places * (np.sin(angle) / np.maximum(distance, 1e-300))[:, None]
        return to_latlon(np.concatenate([flat, np.cos(angle)[:, None]], axis=1) @ self.frame)

    def outline(self) -> Array:
        """Return the closed ring (N, 2) of places around the map."""
        turn = np.linspace(0, 2 * math.pi, 361)
        return self.rim * np.stack([np.cos(turn), np.sin(turn)], axis=-1)

    def contains(self, latlon: Array) -> Array:
        """Return which directions the map shows, (N,) of bool."""
        return to_vectors(latlon) @ self.frame[2] >= math.cos(math.radians(self.radius)) - 1e-12

    def pieces(self, latlon: Array) -> list[Array]:
        """Return a line (M, 2) of directions in pieces (K, 2), K > 1, cut where the map is."""
        vectors = to_vectors(refined(latlon))
        above = vectors @ self.frame[2] - math.cos(math.radians(self.radius))
        inside = above >= 0
        pieces: list[Array] = []
        ends = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]])))
        for first, last in ends.reshape(-1, 2):
            line = [vectors[first:last]]
            for outer, inner, place in ((first - 1, first, 0), (last, last - 1, 2)):
                if 0 <= outer < len(vectors):
                    share = above[inner] / (above[inner] - above[outer])
                    cut = (1 - share) * vectors[inner] + share * vectors[outer]
                    line.insert(place, cut[None])
            pieces.append(self._placed(np.concatenate(line)))
        return _without_points(pieces)

    def _placed(self, vectors: Array) -> Array:
        right, up, out = (vectors @ self.frame.T).T
        across = np.hypot(right, up)
        size = self.distance(np.arctan2(across, out)) / np.maximum(across, 1e-300)
        return np.stack([right * size, up * size], axis=-1)


class Lambert(Azimuthal):
    """Lambert's azimuthal projection, of equal areas.

    >>> Lambert((0.0, 0.0)).forward(np.array([[0.0, 90.0]])).round(6).tolist()
    [[1.414214, 0.0]]
    """

    name, title = "lambert", "Lambert's azimuthal projection (equal-area)"

    def distance(self, angle: Array) -> Array:
        return 2 * np.sin(angle / 2)

    def angle(self, distance: Array) -> Array:
        return 2 * np.arcsin(np.clip(distance / 2, 0, 1))


class Stereographic(Azimuthal):
    """The stereographic projection, which keeps angles: circles stay circles."""

    name, title = "stereographic", "the stereographic projection (true angles, not areas)"

    def distance(self, angle: Array) -> Array:
        return 2 * np.tan(angle / 2)

    def angle(self, distance: Array) -> Array:
        return 2 * np.arctan(distance / 2)

    def areas(self, latlon: Array) -> Array:
        return ((1 + to_vectors(latlon) @ self.frame[2]) / 2) ** 2  # scale 2 / (1 + cos), squared


_NEWTON = 12
"""Newton steps, twice as many as are needed from the starts below."""


class WorldMap(_Centred, ABC):
    """A map of the whole sphere, cut along the meridian opposite the map's own."""

    flipped: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.center[0]:
            raise SettingError(
                f"a map of the whole sphere ({self.name}) is centred on a meridian, not at latitude "
                f"{self.center[0]:g}: give {{center}} a longitude alone, or choose another projection"
            )

    @abstractmethod
    def height(self, lat: Array) -> Array:
        """Return y of latitudes in radians."""

    @abstractmethod
    def latitude(self, y: Array) -> Array:
        """Return latitudes in radians of y, those of the poles beyond them."""

    @abstractmethod
    def stretch(self, y: Array) -> Array:
        """Return x per radian of longitude."""

    def forward(self, latlon: Array) -> Array:
        """Return the places of directions."""
        return self._placed(latlon[:, 0], wrapped(latlon[:, 1] - self.center[1]))

    def inverse(self, places: Array) -> Array:
        """Return directions of places, even a little off the map; longitudes are in [-180, 180)."""
        x, y = places.T
        lat = self.latitude(y)
        lon = x / np.maximum(self.stretch(self.height(lat)), 1e-12)
        return np.stack([np.degrees(lat), wrapped(np.degrees(lon) + self.center[1])], axis=-1)

    def outline(self) -> Array:
        """Return the closed ring (N, 2) of places around the map."""
        up = np.linspace(-90.0, 90.0, 181)
        side = np.full_like(up, 180.0)
        right, left = self._placed(up, side), self._placed(up[::-1], -side)
        return np.concatenate([right, left, right[:1]])

    def contains(self, latlon: Array) -> Array:
        """Return which directions the map shows: all."""
        return np.ones(len(latlon), dtype=bool)

    def pieces(self, latlon: Array) -> list[Array]:
        """Return a line (M, 2) of directions in pieces (K, 2), K > 1, cut where the map is."""
        latlon = refined(latlon)
        lat, lon = latlon[:, 0], wrapped(latlon[:, 1] - self.center[1])
        pieces: list[Array] = []
        start, head = 0, np.empty((0, 2))
        for k in np.flatnonzero(abs(np.diff(lon)) > 180):
            sign = 1.0 if lon[k] > 0 else -1.0
            beyond = lon[k + 1] + sign * 360
            share = (sign * 180 - lon[k]) / (beyond - lon[k]) if beyond != lon[k] else 0.0
            cut = lat[k] + share * (lat[k + 1] - lat[k])
            line = np.stack([lat[start : k + 1], lon[start : k + 1]], axis=-1)
            pieces.append(np.concatenate([head, line, [[cut, sign * 180]]]))
            start, head = k + 1, np.array([[cut, -sign * 180]])
        pieces.append(np.concatenate([head, np.stack([lat[start:], lon[start:]], axis=-1)]))
        return _without_points([self._placed(*line.T) for line in pieces])

    def _placed(self, lat: Array, lon: Array) -> Array:
        """Return places of longitudes from the map's own meridian, -180 and 180 at its two sides."""
        y = self.height(np.radians(lat))
        return np.stack([np.radians(lon) * self.stretch(y), y], axis=-1)


class PlateCarree(WorldMap):
    """The projection in plain latitude and longitude, which keeps neither areas nor angles.

    >>> PlateCarree((0.0, 180.0)).forward(np.array([[90.0, 180.0]])).round(4).tolist()
    [[0.0, 1.5708]]
    """

    name, title = "latlon", "plain latitude and longitude (plate carrée)"

    def height(self, lat: Array) -> Array:
        return lat

    def latitude(self, y: Array) -> Array:
        return np.clip(y, -math.pi / 2, math.pi / 2)

    def stretch(self, y: Array) -> Array:
        return np.ones_like(y)

    def areas(self, latlon: Array) -> Array:
        return np.cos(np.radians(latlon[:, 0]))


class Mollweide(WorldMap):
    """A projection onto an ellipse, of equal areas, in which the poles are points.

    With sin theta = y / sqrt 2, 2 theta + sin 2 theta = pi sin lat; in distances from the pole,
    d = pi / 2 - theta, that is 2 d - sin 2 d = pi (1 - sin lat), which loses no digits there.
    """

    has_pole_points = True
    name, title = "mollweide", "the Mollweide projection (equal-area)"

    def height(self, lat: Array) -> Array:
        rest = 2 * math.pi * np.sin((math.pi / 2 - abs(lat)) / 2) ** 2
        distance = np.cbrt(0.75 * rest)  # of the first terms
        for _ in range(_NEWTON):
            slope = np.maximum(4 * np.sin(distance) ** 2, 1e-300)
            distance = distance - (2 * distance - np.sin(2 * distance) - rest) / slope
        return math.sqrt(2) * np.copysign(np.cos(distance), lat)

    def latitude(self, y: Array) -> Array:
        distance = np.arccos(np.clip(abs(y) / math.sqrt(2), 0, 1))
        share = np.clip((2 * distance - np.sin(2 * distance)) / (2 * math.pi), 0, 1)
        return np.copysign(math.pi / 2 - 2 * np.arcsin(np.sqrt(share)), y)

    def stretch(self, y: Array) -> Array:
        return 2 * math.sqrt(2) / math.pi * np.sqrt(np.clip(1 - y**2 / 2, 0, 1))


class EqualEarth(WorldMap):
    """A projection of equal areas in which the poles are lines, and shapes less squeezed.

    B. Šavrič, T. Patterson, B. Jenny: The Equal Earth map projection (Int. J. Geogr. Inf. Sci. 33,
    2019), equations 7 and 8.
    """

    name, title = "equal-earth", "the Equal Earth projection (equal-area)"

    _Y = np.polynomial.Polynomial((0, 1.340264, 0, -0.081106, 0, 0, 0, 0.000893, 0, 0.003796))
    _SLOPE = _Y.deriv()

    def _theta(self, y: Array) -> Array:
        theta = y / self._Y.coef[1]
        for _ in range(_NEWTON):
            theta = theta - (self._Y(theta) - y) / self._SLOPE(theta)
        return np.clip(theta, -math.pi / 3, math.pi / 3)

    def height(self, lat: Array) -> Array:
        return self._Y(np.arcsin(math.sqrt(3) / 2 * np.sin(lat)))

    def latitude(self, y: Array) -> Array:
        return np.arcsin(np.clip(2 / math.sqrt(3) * np.sin(self._theta(y)), -1, 1))

    def stretch(self, y: Array) -> Array:
        theta = self._theta(y)
        return 2 / math.sqrt(3) * np.cos(theta) / self._SLOPE(theta)


Projection: TypeAlias = Azimuthal | WorldMap

PROJECTIONS: dict[str, type[Projection]] = {
    **{c.name: c for c in (Lambert, Stereographic)},
    "schmidt": Lambert,
    "wulff": Stereographic,
    **{c.name: c for c in (EqualEarth, Mollweide, PlateCarree)},
}
"""By their names in settings; Schmidt's and Wulff's nets of structural geology are `flipped`."""


_NET_WORDS = ("inc", "plunge", "dip")
"""How names of the first column begin if rows are directions in a net, not places on a globe."""

_RADII = (5, 10, 15, 20, 30, 40, 50, 60, 75)
_SHARE = 0.995
"""Share of the points that a map of less than the sphere has to show."""


def chosen_map(space: Space, points: Tensor, settings: PlotSettings | None = None) -> Projection:
    """Return the map of a sphere or projective plane that settings ask for, or that suits points.

    `points` are chart points (N, 2); names of the data's columns may ask for a net.

    >>> from orbiflow.density import Sphere
    >>> here = Sphere().to_chart([[40.0, 140.0], [44.0, 142.0]])
    >>> chosen_map(Sphere(), here)
    Lambert(center=(42.0, 141.0), radius=5.0, flipped=False)
    """
    if not (space.is_round and space.has_chart):
        raise OrbiflowError(
            f"maps are of the sphere and the projective plane, not of the {space.name}: draw columns "
            "of `orbiflow density sample` beside those of the data"
        )
    settings = settings or PlotSettings()
    projection, radius, middle = settings.projection, settings.radius, settings.center
    if middle is not None and not (len(middle) in (1, 2) and all(map(math.isfinite, middle))):
        raise SettingError(
            "{center} must be a latitude and a longitude, or a longitude, in degrees, such as 40,140, "
            f"got {list(middle)}"
        )
    axial = space.name == "projective-plane"
    cap = None if axial else smallest_cap(cast(RoundSpace, space).vectors(points))
    if projection == "auto":
        if axial:
            names = settings.names or ("",)
            a_net = names[0].strip().lower().startswith(_NET_WORDS)
            projection = "schmidt" if a_net and middle is None else "lambert"
        elif middle is not None:
            projection = "lambert" if len(middle) == 2 and middle[0] else "equal-earth"
        else:
            projection = "equal-earth" if cap is None and radius is None else "lambert"
    kind = PROJECTIONS[projection]
    if issubclass(kind, WorldMap):
        if axial:
            discs = [n for n, c in PROJECTIONS.items() if issubclass(c, Azimuthal)]
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
