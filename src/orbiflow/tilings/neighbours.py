"""The neighbours of a tile: images that share a piece of its boundary, or only points of it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from orbiflow.arguments import instance, number
from orbiflow.geometry import subdivided
from orbiflow.symmetry import Isometry
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings.edge_matching import segment_tree
from orbiflow.tilings.images import Surroundings, surroundings
from orbiflow.tilings.tile import Tile

_SAMPLES = 200  # points on the boundary at least, so that coarse polygons are seen as curves


class Neighbours(NamedTuple):
    """Group elements g != 1 whose image g(T) touches T, nearest first.

    Args:
        edge: those that share a piece of boundary of positive length.
        point: those that only touch at points.
    """

    edge: tuple[Isometry, ...]
    point: tuple[Isometry, ...]


def neighbours(tile: Tile, *, tolerance: float = 1e-7) -> Neighbours:
    """The images of `tile` that touch it.

    Args:
        tile: need not be certified.
        tolerance: what counts as touching, in square roots of the tile's area.

    Raises:
        OrbiflowError: if polygon and group are of very different size.

    >>> from orbiflow.tilings.classes import isohedral_class
    >>> floret = isohedral_class("IH21")
    >>> found = neighbours(Tile(floret.template(), floret.group()))
    >>> len(found.edge), len(found.point)
    (5, 3)
    """
    instance(tile, Tile, "the tile", "Tile(polygon, group) makes one")
    tolerance = number(tolerance, "tolerance", 0)
    return neighbours_among(surroundings(tile, tolerance), tolerance)


def neighbours_among(around: Surroundings, tolerance: float) -> Neighbours:
    """As `neighbours`, for images that are already at hand."""
    if not len(around.images):
        return Neighbours((), ())
    outline = shapely.linearrings(around.ring)
    shapely.prepare(outline)
    touching = shapely.dwithin(outline, shapely.linearrings(around.images), tolerance)
    near = around.select(np.asarray(touching))
    if not len(near.images):
        return Neighbours((), ())
    tree, owner = segment_tree(near)
    points = shapely.points(_boundary_samples(near.ring))
    _, hits = tree.query(points, predicate="dwithin", distance=tolerance)
    shares: NDArray[np.bool_] = np.zeros(len(near.images), dtype=bool)
    shares[owner[hits]] = True
    return Neighbours(near.select(shares).elements, near.select(~shares).elements)


def _boundary_samples(ring: Array) -> Array:
    """Interior points of the segments, midpoints among them: never the corners."""
    per_segment = 2 * math.ceil(_SAMPLES / (2 * len(ring))) + 1 if len(ring) < _SAMPLES else 1
    return subdivided(ring, per_segment, phase=0.5)
