"""How thick a silhouette is at each of its points."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import Voronoi

from orbiflow.geometry import subdivided
from orbiflow.silhouette.mesh import Mesh
from orbiflow.typed_shapely import ufuncs

Array = NDArray[np.float64]

PIECES = 3
"""Parts of each side of the outline: more make the medial axis finer."""

ROUNDING = 1.02
"""Balls reach a little beyond themselves: triangles have size."""


def local_thickness(mesh: Mesh) -> Array:
    """Radius (M,) of the largest disc in the polygon that covers the middle of each triangle.

    The local thickness of Hildebrand and Rüegsegger (1997), over discs about the Voronoi
    vertices of points on the outline, which lie near the medial axis.

    Args:
        mesh: of the polygon.
    """
    polygon = shapely.Polygon(mesh.points[: mesh.size])
    corners = mesh.points[mesh.triangles]
    dense = subdivided(mesh.points[: mesh.size], PIECES)
    centers = Voronoi(dense).vertices
    centers = centers[shapely.contains_xy(polygon, centers[:, 0], centers[:, 1])]
    middle = corners.mean(axis=1)
    outline = polygon.exterior
    shapely.prepare(outline)
    own = ufuncs.distance(ufuncs.points(middle), outline)
    if not len(centers):
        return own
    radius = ufuncs.distance(ufuncs.points(centers), outline)
    found = own.copy()
    for start in range(0, len(middle), 512):  # bounds the memory
        part = middle[start : start + 512]
        apart = np.hypot(*(part[:, None] - centers[None]).transpose(2, 0, 1))
        covering = np.where(apart <= ROUNDING * radius, radius, 0.0).max(axis=1)
        found[start : start + 512] = np.maximum(own[start : start + 512], covering)
    return found
