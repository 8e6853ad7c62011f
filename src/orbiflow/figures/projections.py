"""Projections of the sphere onto a map: what all of them do, and lines on them.

Directions are degrees (N, 2) of latitude and longitude, places on the map (N, 2) in radii of the
sphere.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from orbiflow.arguments import number
from orbiflow.symmetry.isometry import Array

FINEST = 1.0
"""Degrees between points of lines that are drawn, at most: curves look like curves."""


@dataclass(frozen=True)
class Projection(ABC):
    """A map of directions.

    - `name`: as asked for. `title`: in a sentence.
    - `is_equal_area`: whether equal areas of the sphere are equal on the map.
    - `center`: latitude and longitude of the map's middle.

    Raises:
        OrbiflowError: for a centre that is no direction.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    is_equal_area: ClassVar[bool]

    center: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        number(self.center[0], "the centre's latitude", -90, 90)
        number(self.center[1], "the centre's longitude", -360, 360)

    @abstractmethod
    def forward(self, latlon: Array) -> Array:
        """Places of directions."""

    @abstractmethod
    def inverse(self, places: Array) -> Array:
        """Directions of places, those next to the outline continued beyond it; longitudes in
        [-180, 180).
        """

    @abstractmethod
    def outline(self) -> Array:
        """(N, 2) closed ring of places around the map."""

    @abstractmethod
    def pieces(self, latlon: Array) -> list[Array]:
        """A line (M, 2) of directions on the map, cut where the map is: places (K, 2), K > 1, each."""

    @abstractmethod
    def contains(self, latlon: Array) -> Array:
        """Which directions the map shows, (N,) of bool."""


def refined(latlon: Array) -> Array:
    """A line (M, 2) of directions with points at most `FINEST` degrees apart.

    Straight in latitude and longitude, as GeoJSON has it (RFC 7946, 3.1.1), the short way round.
    """
    lon = np.unwrap(latlon[:, 1], period=360.0)
    steps = np.maximum(abs(np.diff(latlon[:, 0])), abs(np.diff(lon)))
    counts = np.maximum(np.ceil(steps / FINEST - 1e-9), 1).astype(int)
    knots = np.concatenate([[0], np.cumsum(counts)])
    at = np.arange(knots[-1] + 1)
    lat, lon = (np.interp(at, knots, values) for values in (latlon[:, 0], lon))
    return np.stack([lat, wrapped(lon)], axis=-1)


def wrapped(lon: Array) -> Array:
    """Longitudes in [-180, 180)."""
    return (lon + 180.0) % 360.0 - 180.0


def of_some_length(lines: list[Array]) -> list[Array]:
    """Those of lines (M, 2) that are more than a point."""
    return [line for line in lines if len(line) > 1 and bool((line != line[0]).any())]
