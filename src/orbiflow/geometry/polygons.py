"""Shapely's geometries taken apart."""

from __future__ import annotations

from collections.abc import Iterable

from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry


def polygons_in(geometry: BaseGeometry) -> list[Polygon]:
    """The polygons that `geometry` is made of, lines and points left out."""
    if isinstance(geometry, Polygon):
        return [] if geometry.is_empty else [geometry]
    parts: Iterable[BaseGeometry] = getattr(geometry, "geoms", ())
    return [polygon for part in parts for polygon in polygons_in(part)]
