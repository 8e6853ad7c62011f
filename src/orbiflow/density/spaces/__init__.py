"""The four identification spaces: charts, measures and units."""

from orbiflow.density.spaces.catalogue import SPACES, make_space
from orbiflow.density.spaces.flat import KleinBottle, Torus
from orbiflow.density.spaces.patches import KleinCoordinates, from_klein, to_klein
from orbiflow.density.spaces.round import (
    ProjectivePlane,
    RoundSpace,
    Sphere,
    clear_rotation,
    to_latlon,
    to_vectors,
)
from orbiflow.density.spaces.space import MEASURES, Space

__all__ = [
    "MEASURES",
    "SPACES",
    "KleinBottle",
    "KleinCoordinates",
    "ProjectivePlane",
    "RoundSpace",
    "Space",
    "Sphere",
    "Torus",
    "clear_rotation",
    "from_klein",
    "make_space",
    "to_klein",
    "to_latlon",
    "to_vectors",
]
