"""Maps of what is round a centre, a hemisphere at most; exact both ways (Snyder, 1987)."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from orbiflow.arguments import number
from orbiflow.density.spaces.round import to_latlon, to_vectors
from orbiflow.figures.projections import Projection, of_some_length, refined
from orbiflow.symmetry.isometry import Array


@dataclass(frozen=True)
class Azimuthal(Projection):
    """What is within `radius` degrees of the centre, in its true direction from there.

    Seen from outside, north up, and at the poles the centre's longitude down (north) or up (south).

    - `flipped`: upside down, so that about the north pole longitudes run clockwise from the top: a net
      of structural geology and palaeomagnetism.

    Raises:
        OrbiflowError: also for a radius that is not above 0 and at most 90.
    """

    radius: float = 90.0
    flipped: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        number(self.radius, "the map's radius", 0, 90, above=True)

    @abstractmethod
    def distance(self, angle: Array) -> Array:
        """Of a place from the map's middle, of angles in radians from the centre."""

    @abstractmethod
    def angle(self, distance: Array) -> Array:
        """The inverse of `distance`."""

    @property
    def rim(self) -> float:
        """The map's radius, in radii of the sphere."""
        return float(self.distance(np.array(math.radians(self.radius))))

    @property
    def frame(self) -> Array:
        """(3, 3): unit vectors to the right, upwards and to the centre."""
        lat, lon = np.radians(self.center)
        east = np.array([-np.sin(lon), np.cos(lon), 0.0])
        out = to_vectors([self.center])[0]
        up = np.array([-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)])
        return np.stack([east, -up if self.flipped else up, out])

    def forward(self, latlon: Array) -> Array:
        return self._placed(to_vectors(latlon))

    def inverse(self, places: Array) -> Array:
        distance = np.linalg.norm(places, axis=1)
        angle = self.angle(distance)
        flat = places * (np.sin(angle) / np.maximum(distance, 1e-300))[:, None]
        return to_latlon(np.concatenate([flat, np.cos(angle)[:, None]], axis=1) @ self.frame)

    def outline(self) -> Array:
        turn = np.linspace(0, 2 * math.pi, 361)
        return self.rim * np.stack([np.cos(turn), np.sin(turn)], axis=-1)

    def contains(self, latlon: Array) -> Array:
        return to_vectors(latlon) @ self.frame[2] >= math.cos(math.radians(self.radius)) - 1e-12

    def pieces(self, latlon: Array) -> list[Array]:
        vectors = to_vectors(refined(latlon))
        limit = math.cos(math.radians(self.radius))
        above = vectors @ self.frame[2] - limit
        inside = above >= 0
        found: list[Array] = []
        ends = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]])))
        for first, last in ends.reshape(-1, 2):
            line = [vectors[first:last]]
            for outer, inner, place in ((first - 1, first, 0), (last, last - 1, 2)):
                if 0 <= outer < len(vectors):
                    share = above[inner] / (above[inner] - above[outer])
                    cut = (1 - share) * vectors[inner] + share * vectors[outer]
                    line.insert(place, cut[None])
            found.append(self._placed(np.concatenate(line)))
        return of_some_length(found)

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
    is_equal_area = True

    def distance(self, angle: Array) -> Array:
        return 2 * np.sin(angle / 2)

    def angle(self, distance: Array) -> Array:
        return 2 * np.arcsin(np.clip(distance / 2, 0, 1))


class Stereographic(Azimuthal):
    """The stereographic projection, which keeps angles: circles stay circles."""

    name, title = "stereographic", "the stereographic projection (true angles, not areas)"
    is_equal_area = False

    def distance(self, angle: Array) -> Array:
        return 2 * np.tan(angle / 2)

    def angle(self, distance: Array) -> Array:
        return 2 * np.arctan(distance / 2)
