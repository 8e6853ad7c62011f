"""Closed rings and polygons: area, centroid, sense, points by arc length. Imports no other room."""

from orbiflow.geometry.arc_length import (
    arc_lengths,
    points_along,
    resampled,
    resampled_with_corners,
    ring_length,
)
from orbiflow.geometry.polygons import polygons_in
from orbiflow.geometry.rings import (
    best_similarity,
    centroid,
    complex_points,
    orient,
    plane_points,
    reverse,
    signed_area,
    subdivided,
)

__all__ = [
    "arc_lengths",
    "best_similarity",
    "centroid",
    "complex_points",
    "orient",
    "plane_points",
    "points_along",
    "polygons_in",
    "resampled",
    "resampled_with_corners",
    "reverse",
    "ring_length",
    "signed_area",
    "subdivided",
]
