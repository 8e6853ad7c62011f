"""Solids from cross-sections that walls, slopes and flats join; lengths in mm, z up."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from manifold3d import Error, Manifold, Mesh64, triangulate
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array
from orbiflow.tiles.geometry import orient, polygons_in

GRAIN = 1e-4  # the finest detail in mm: the 32 bits of an STL tell it up to a metre


class CrossSection(NamedTuple):
    """The cross-section of a solid at a height in mm; two at one height are a step."""

    z: float
    region: BaseGeometry


def stacked(*levels: CrossSection) -> Manifold:
    """Return the solid with these cross-sections, from the lowest up, straight between them.

    Of two successive regions one holds the other. A ring that both have becomes an upright wall. The
    rest of their difference is triangulated without new points, each vertex at its own level's
    height: a slope that is exact at both levels, even where rings part or vanish, or a flat at a
    step. So the faces meet by construction, and the library makes sure of it.
    """
    nothing = shapely.Polygon()
    closed = [CrossSection(levels[0].z, nothing), *levels, CrossSection(levels[-1].z, nothing)]
    faces = [part for below, above in pairwise(closed) for part in _between(below, above)]
    points, corners = np.unique(np.concatenate(faces).reshape(-1, 3), axis=0, return_inverse=True)
    made = Manifold(Mesh64(points, corners.reshape(-1, 3).astype(np.uint64)))
    if made.status() != Error.NoError or made.volume() <= 0:
        raise RuntimeError(f"the solid broke its promise to be closed: {made.status()}")
    return made.simplify(GRAIN)


def _between(below: CrossSection, above: CrossSection) -> Iterator[Array]:
    """Yield triangles (n, 3, 3) between two levels, counter-clockwise from outside."""
    old, new = _rings(below), _rings(above)
    shared = [key for key in old if key in new]
    for low, high in ((old.pop(key), new.pop(key)) for key in shared):
        if below.z < above.z:
            sides = np.stack([low, np.roll(low, -1, 0), np.roll(high, -1, 0), high], axis=1)
            yield from (sides[:, [0, 1, 2]], sides[:, [0, 2, 3]])
    grows = above.region.area > below.region.area
    outer, inner = (new, old) if grows else (old, new)
    rings = [*outer.values(), *(ring[::-1] for ring in inner.values())]
    if rings:
        band = np.concatenate(rings)[triangulate([ring[:, :2] for ring in rings])]
        yield band[:, ::-1] if grows else band


def _rings(level: CrossSection) -> dict[bytes, Array]:
    """Return the rings (n, 3) of a level, its region on their left, by their bytes in the plane."""
    rings = dict[bytes, Array]()
    for polygon in polygons_in(shapely.normalize(level.region)):
        for k, line in enumerate([polygon.exterior, *polygon.interiors]):
            ring = orient(shapely.get_coordinates(line)[:-1], counter_clockwise=k == 0)
            rings[ring.tobytes()] = np.column_stack([ring, np.full(len(ring), level.z)])
    return rings
