"""How the boundary of a tile meets the boundaries of its images."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import KDTree

from orbiflow.symmetry.isometry import Array
from orbiflow.tilings.images import Surroundings


class SegmentMatch(NamedTuple):
    """Nearest reversed image segment of each segment of a tile.

    Args:
        distance: (N,) distance in R^4 of (a, b) to the nearest (b', a') of an image.
        partner: (N,) the tile's segment of which that is the image, -1 where there is no image.
    """

    distance: Array
    partner: NDArray[np.int64]

    @property
    def one_to_one(self) -> bool:
        """Whether the partners are a permutation of the segments."""
        return bool((np.sort(self.partner) == np.arange(len(self.partner))).all())


def match_segments(around: Surroundings, tolerance: float) -> SegmentMatch:
    """For each segment (a, b) of the tile the nearest image of a segment that runs from b to a.

    Images are taken counter-clockwise like the tile, so those of elements that reverse orientation
    are read backwards.
    """
    ring = around.ring
    count = len(ring)
    starts, ends = around.images, np.roll(around.images, -1, axis=1)
    plain = ~around.mirrored[:, None, None]
    reverse = np.where(
        plain, np.concatenate([ends, starts], -1), np.concatenate([starts, ends], -1)
    )
    reverse = reverse.reshape(-1, 4)
    source = np.tile(np.arange(count), len(around.images))
    low, high = ring.min(axis=0) - tolerance, ring.max(axis=0) + tolerance
    inside = ((reverse >= np.tile(low, 2)) & (reverse <= np.tile(high, 2))).all(axis=1)
    if not inside.any():
        return SegmentMatch(np.full(count, np.inf), np.full(count, -1))
    segments = np.concatenate([ring, np.roll(ring, -1, axis=0)], axis=1)
    distance, index = KDTree(reverse[inside]).query(segments)
    return SegmentMatch(np.asarray(distance), source[inside][index])


def curve_distance(around: Surroundings) -> float:
    """Largest distance of a vertex of the tile to the boundaries of its images.

    With the images' vertices seen from the tile being the tile's vertices seen from the images,
    this is the Hausdorff distance between the tile's boundary and the union of the others near it.
    """
    if not len(around.images):
        return float("inf")
    tree, _ = segment_tree(around)
    _, distance = tree.query_nearest(
        shapely.points(around.ring), all_matches=False, return_distance=True
    )
    return float(distance.max())


def segment_tree(around: Surroundings) -> tuple[shapely.STRtree, NDArray[np.int64]]:
    """Tree of all segments of all images, and the image of each segment."""
    ends = np.stack([around.images, np.roll(around.images, -1, axis=1)], axis=2)
    owner = np.repeat(np.arange(len(around.images)), len(around.ring))
    segments = np.asarray(shapely.linestrings(ends.reshape(-1, 2, 2)))
    return shapely.STRtree(segments), owner
