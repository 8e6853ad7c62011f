"""Curves cut at the edge of a page."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from orbiflow.export.curves import Curve
from orbiflow.export.scene import Box
from orbiflow.geometry import polygons_in


def inside(curve: Curve, box: Box, *, slack: float = 1e-9) -> bool:
    """Whether the box surely holds the curve: its control points are in it."""
    (left, top), (right, bottom) = curve.bounds()
    return bool(
        left >= box.left - slack
        and top >= box.top - slack
        and right <= box.right + slack
        and bottom <= box.bottom + slack
    )


def clipped_region(curve: Curve, box: Box, tolerance: float) -> list[Curve]:
    """What of the region inside a closed curve is in the box, as closed curves.

    The curve itself if all of it is; else polygons within `tolerance` of it.
    """
    if inside(curve, box):
        return [curve]
    polygon = shapely.Polygon(curve.flattened(tolerance))
    if not polygon.is_valid:
        polygon = shapely.make_valid(polygon)
    common = shapely.intersection(polygon, shapely.box(*box))
    return [
        Curve.polyline(np.asarray(part.exterior.coords)[:-1], closed=True)
        for part in polygons_in(common)
    ]


def clipped_line(curve: Curve, box: Box, tolerance: float) -> list[Curve]:
    """What of an open curve is in the box."""
    if inside(curve, box):
        return [curve]
    points = curve.flattened(tolerance)
    line = shapely.LineString(np.concatenate([points, points[:1]]) if curve.closed else points)
    common = shapely.intersection(line, shapely.box(*box))
    return [Curve.polyline(part) for part in _lines(common)]


def _lines(geometry: BaseGeometry) -> list[np.ndarray]:
    if geometry.geom_type == "LineString":
        return [] if geometry.is_empty else [shapely.get_coordinates(geometry)]
    return [line for part in getattr(geometry, "geoms", ()) for line in _lines(part)]
