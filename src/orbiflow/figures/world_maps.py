"""Maps of the whole sphere, cut along a meridian; exact both ways.

Formulas of J. P. Snyder, Map Projections: A Working Manual (USGS, 1987), where no other source is
named.
"""

from __future__ import annotations

import math
from abc import abstractmethod

import numpy as np

from orbiflow.errors import OrbiflowError
from orbiflow.figures.projections import Projection, of_some_length, refined, wrapped
from orbiflow.symmetry.isometry import Array

_NEWTON = 12
"""Newton steps: from the starts below, rounding is reached in half as many."""


class WorldMap(Projection):
    """The whole sphere, cut along the meridian opposite the map's own.

    Raises:
        OrbiflowError: also for a centre off the equator.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.center[0]:
            raise OrbiflowError(
                f"a map of the whole sphere ({self.name}) is centred on a meridian, not at latitude "
                f"{self.center[0]:g}: give a longitude alone, or another projection"
            )

    @abstractmethod
    def height(self, lat: Array) -> Array:
        """y of latitudes in radians."""

    @abstractmethod
    def latitude(self, y: Array) -> Array:
        """Latitudes in radians of y, those of the poles beyond them."""

    @abstractmethod
    def stretch(self, y: Array) -> Array:
        """x per radian of longitude."""

    def forward(self, latlon: Array) -> Array:
        return self._placed(latlon[:, 0], self._relative(latlon[:, 1]))

    def inverse(self, places: Array) -> Array:
        x, y = places.T
        lat = self.latitude(y)
        lon = x / np.maximum(self.stretch(self.height(lat)), 1e-12)
        return np.stack([np.degrees(lat), wrapped(np.degrees(lon) + self.center[1])], axis=-1)

    def outline(self) -> Array:
        up = np.linspace(-90.0, 90.0, 181)
        side = np.full_like(up, 180.0)
        right, left = self._placed(up, side), self._placed(up[::-1], -side)
        return np.concatenate([right, left, right[:1]])

    def pieces(self, latlon: Array) -> list[Array]:
        latlon = refined(latlon)
        lat, lon = latlon[:, 0], self._relative(latlon[:, 1])
        found: list[Array] = []
        start, head = 0, np.empty((0, 2))
        for k in np.flatnonzero(abs(np.diff(lon)) > 180):
            sign = 1.0 if lon[k] > 0 else -1.0
            beyond = lon[k + 1] + sign * 360
            share = (sign * 180 - lon[k]) / (beyond - lon[k]) if beyond != lon[k] else 0.0
            cut = lat[k] + share * (lat[k + 1] - lat[k])
            line = np.stack([lat[start : k + 1], lon[start : k + 1]], axis=-1)
            found.append(np.concatenate([head, line, [[cut, sign * 180]]]))
            start, head = k + 1, np.array([[cut, -sign * 180]])
        found.append(np.concatenate([head, np.stack([lat[start:], lon[start:]], axis=-1)]))
        return of_some_length([self._placed(*line.T) for line in found])

    def contains(self, latlon: Array) -> Array:
        return np.ones(len(latlon), dtype=bool)

    def _relative(self, lon: Array) -> Array:
        return wrapped(lon - self.center[1])

    def _placed(self, lat: Array, lon: Array) -> Array:
        """Of longitudes from the map's own meridian, -180 and 180 at its two sides."""
        y = self.height(np.radians(lat))
        return np.stack([np.radians(lon) * self.stretch(y), y], axis=-1)


class PlateCarree(WorldMap):
    """Plain latitude and longitude: neither areas nor angles are kept.

    >>> PlateCarree((0.0, 180.0)).forward(np.array([[90.0, 180.0]])).round(4).tolist()
    [[0.0, 1.5708]]
    """

    name, title, is_equal_area = "latlon", "plain latitude and longitude (plate carrée)", False

    def height(self, lat: Array) -> Array:
        return lat

    def latitude(self, y: Array) -> Array:
        return np.clip(y, -math.pi / 2, math.pi / 2)

    def stretch(self, y: Array) -> Array:
        return np.ones_like(y)


class Mollweide(WorldMap):
    """An ellipse of equal areas, the poles points.

    With sin theta = y / sqrt 2, 2 theta + sin 2 theta = pi sin lat; in distances from the pole,
    d = pi / 2 - theta, that is 2 d - sin 2 d = pi (1 - sin lat), which loses no digits there.
    """

    name, title, is_equal_area = "mollweide", "the Mollweide projection (equal-area)", True

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
    """Equal areas, the poles lines, shapes less squeezed than in an ellipse.

    B. Šavrič, T. Patterson, B. Jenny: The Equal Earth map projection (Int. J. Geogr. Inf. Sci. 33,
    2019), equations 7 and 8.
    """

    name, title, is_equal_area = "equal-earth", "the Equal Earth projection (equal-area)", True

    _A = (1.340264, -0.081106, 0.000893, 0.003796)

    def _polynomial(self, theta: Array) -> Array:
        a1, a2, a3, a4 = self._A
        square = theta**2
        return theta * (a1 + square * (a2 + square**2 * (a3 + square * a4)))

    def _slope(self, theta: Array) -> Array:
        a1, a2, a3, a4 = self._A
        square = theta**2
        return a1 + square * (3 * a2 + square**2 * (7 * a3 + square * 9 * a4))

    def _theta(self, y: Array) -> Array:
        theta = y / self._A[0]
        for _ in range(_NEWTON):
            theta = theta - (self._polynomial(theta) - y) / self._slope(theta)
        return np.clip(theta, -math.pi / 3, math.pi / 3)

    def height(self, lat: Array) -> Array:
        return self._polynomial(np.arcsin(math.sqrt(3) / 2 * np.sin(lat)))

    def latitude(self, y: Array) -> Array:
        return np.arcsin(np.clip(2 / math.sqrt(3) * np.sin(self._theta(y)), -1, 1))

    def stretch(self, y: Array) -> Array:
        theta = self._theta(y)
        return 2 / math.sqrt(3) * np.cos(theta) / self._slope(theta)
