"""Which triangle of a mesh a point lies in, for many points at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from orbiflow.typed_shapely import ufuncs

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


class Located(NamedTuple):
    """Where P points lie in a mesh.

    - `triangle`: (P,) the one that holds the point, or the nearest; of several, any.
    - `nearest`: (P, 2) the triangle's point next to it: the point itself inside the mesh.
    """

    triangle: Integers
    nearest: Array


class Locator:
    """The triangles of a mesh in a tree.

    Args:
        points: (N, 2).
        triangles: (M, 3) indices of the points, none of the triangles flat.
    """

    def __init__(self, points: Array, triangles: Integers) -> None:
        self._tree = shapely.STRtree(np.asarray(shapely.polygons(points[triangles])))

    def locate(self, points: Array) -> Located:
        """The triangle of each point (P, 2); finite points alone."""
        found = np.full(len(points), -1)
        where = np.asarray(shapely.points(points))
        index, triangle = self._tree.query(where, predicate="intersects")
        found[index] = triangle
        nearest = points.copy()
        outside = np.flatnonzero(found < 0)
        if len(outside):
            found[outside] = self._tree.nearest(where[outside])
            lines = ufuncs.shortest_line(self._tree.geometries[found[outside]], where[outside])
            nearest[outside] = shapely.get_coordinates(lines)[::2]
        return Located(found, nearest)
