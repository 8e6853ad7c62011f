"""Several rings in one file: what touches is joined, and the largest part is the silhouette."""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

from collections.abc import Sequence

import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array
from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.silhouette.outlines import outer_outline, outer_ring


def largest_of(rings: Sequence[Array]) -> tuple[Array, list[str], BaseGeometry]:
    """Return the largest ring of what touching or overlapping ones make together, notes, and all of it.

    A ring inside another, such as a hole's, goes with it.
    """
    whole = shapely.MultiPolygon(polygons_in(shapely.union_all([Polygon(ring) for ring in rings])))
    shape, notes = outer_outline(whole)
    return outer_ring(shape), notes, whole
